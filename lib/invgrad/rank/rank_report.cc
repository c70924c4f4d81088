#include "invgrad/rank_report.h"

#include <algorithm>
#include <utility>

#include "fmt/core.h"
#include "invgrad/internal/logging.h"
#include "invgrad/rank/block_groups.h"
#include "invgrad/rank/describe_group.h"
#include "invgrad/rank/smallest_singular.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// The small singular values of each group's A, and the largest value of all
// groups.
bool Decompose(const RankReport::Options& options,
               const std::vector<BlockGroup>& groups,
               std::vector<SmallestSingular>* small,
               RankReport* report,
               std::string* error) {
  std::vector<double> estimates;
  for (const BlockGroup& group : groups) {
    estimates.push_back(LargestSingularValue(group.A));
    report->s_max = std::max(report->s_max, estimates.back());
  }
  // The estimates are lower bounds. With this margin the search finds all
  // directions that are weak relative to the exact largest value.
  constexpr double kMargin = 1.5;
  const double limit = kMargin * options.weak_threshold * report->s_max;
  small->resize(groups.size());
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const BlockGroup& group = groups[g];
    SmallestSingular* of_group = &(*small)[g];
    const bool is_dense = IsDense(options, group);
    if (!(is_dense ? DenseSmallestSingular(group.A, limit, of_group, error)
                   : SparseSmallestSingular(group.A,
                                            estimates[g],
                                            limit,
                                            options.max_directions,
                                            of_group,
                                            error))) {
      *error = fmt::format("the group of {}: {}",
                           report->blocks[group.blocks.front()].name,
                           *error);
      return false;
    }
    if (is_dense)
      report->s_max = std::max(report->s_max, of_group->s.maxCoeff());
  }
  return true;
}

Index Count(const VectorXd& s, double limit) {
  return (s.array() <= limit).count();
}

VectorXd Sorted(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return Eigen::Map<const VectorXd>(values.data(),
                                    static_cast<Index>(values.size()));
}

void SummarizeSpectrum(const RankReport::Options& options,
                       const std::vector<BlockGroup>& groups,
                       const std::vector<SmallestSingular>& small,
                       RankReport* report) {
  std::vector<double> all;  // relative to s_max
  Index num_undetermined = 0;
  for (const RankReport::Unused& unused : report->unused) {
    all.insert(all.end(), unused.tangent.size(), 0.0);
    num_undetermined += static_cast<Index>(unused.tangent.size());
  }
  report->has_all_singular_values = true;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    report->has_all_singular_values &= IsDense(options, groups[g]);
    report->is_complete &= small[g].complete;
    num_undetermined += Count(small[g].s, options.threshold * report->s_max);
    for (const double s : small[g].s) all.push_back(s / report->s_max);
  }
  report->singular_values = Sorted(all);
  report->rank = report->num_parameters - static_cast<int>(num_undetermined);
}

bool UnscaledSpectrum(const std::vector<BlockGroup>& groups,
                      RankReport* report,
                      std::string* error) {
  std::vector<double> all;
  for (const BlockGroup& group : groups) {
    VectorXd s;
    if (!DenseSingularValues(group.A * group.lengths.asDiagonal(), &s, error))
      return false;
    all.insert(all.end(), s.begin(), s.end());
  }
  all.resize(static_cast<std::size_t>(report->num_parameters), 0.0);
  const VectorXd s = Sorted(all);
  if (s.size() > 0 && s.tail<1>()[0] > 0.0) {
    report->unscaled_singular_values = s / s.tail<1>()[0];
  }
  return true;
}

}  // namespace

bool RankReport::Options::IsValid(std::string* error) const {
  CHECK(error != nullptr);
  // Smaller singular values are rounding errors.
  constexpr double kSmallest = 1e-12;
  if (!(threshold > kSmallest && threshold < 1.0)) {
    *error = "threshold must be in (1e-12, 1)";
  } else if (!(weak_threshold >= threshold && weak_threshold < 1.0)) {
    *error = "weak_threshold must be in [threshold, 1)";
  } else if (max_directions < 1) {
    *error = "max_directions must be at least 1";
  } else if (max_dense_size < 0) {
    *error = "max_dense_size must be at least 0";
  } else {
    return true;
  }
  return false;
}

bool ComputeRankReport(const RankReport::Options& options,
                       const ceres::Problem& problem,
                       RankReport* report,
                       std::string* error) {
  CHECK(report != nullptr);
  CHECK(error != nullptr);
  if (!options.IsValid(error)) return false;
  RankReport result;
  result.threshold = options.threshold;
  result.weak_threshold = options.weak_threshold;
  std::vector<BlockGroup> groups;
  std::vector<SmallestSingular> small;  // of each group
  if (!GroupBlocks(options, problem, &result, nullptr, &groups, error) ||
      !Decompose(options, groups, &small, &result, error)) {
    return false;
  }
  SummarizeSpectrum(options, groups, small, &result);
  if (result.has_all_singular_values &&
      !UnscaledSpectrum(groups, &result, error)) {
    return false;
  }
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const Index num_null = Count(small[g].s, options.threshold * result.s_max);
    const Index num_weak =
        Count(small[g].s, options.weak_threshold * result.s_max) - num_null;
    DescribeGroup(options,
                  problem,
                  groups[g],
                  static_cast<int>(g),
                  small[g].V.leftCols(num_null),
                  small[g].V.middleCols(num_null, num_weak),
                  &result);
  }
  std::stable_sort(
      result.weak.begin(),
      result.weak.end(),
      [](const RankReport::Direction& a, const RankReport::Direction& b) {
        return a.singular_value < b.singular_value;
      });
  *report = std::move(result);
  return true;
}

}  // namespace invgrad
