#include "invgrad/rank/describe_group.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "invgrad/rank/choose_anchors.h"
#include "invgrad/rank/decompositions.h"
#include "invgrad/rank/gauge_match.h"
#include "invgrad/rank/localized_basis.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

class GroupDescription {
 public:
  GroupDescription(const RankReport::Options& options,
                   const ceres::Problem& problem,
                   const BlockGroup& group,
                   int g,
                   RankReport* report)
      : options_(options),
        group_(group),
        g_(g),
        report_(*report),
        matcher_(options, problem, *report, group) {}

  // Reports directions that are independent of the previous ones: first
  // directions within one block, then those that touch few blocks, gauge
  // freedoms, and the rest.
  void DescribeNullSpace(const MatrixXd& V) {
    dimension_ = V.cols();
    reported_.resize(V.rows(), 0);
    const LocalizedBasis basis = Localize(V, group_.offsets);
    const std::vector<int>& blocks = basis.single_blocks;
    for (Index j = 0; j < basis.single.cols();) {
      const Index num = std::count(blocks.begin(), blocks.end(), blocks[j]);
      const MatrixXd within = basis.single.middleCols(j, num);
      for (const auto v : within.colwise()) Report(v);
      Suggest(within, 1);
      j += num;
    }
    if (basis.rest.cols() == 0) return;
    const GaugeMatch gauge = matcher_.Best(
        options_.threshold * report_.s_max, dimension_, basis.rest.cols());
    const auto touches_few = [&](const VectorXd& v) {
      return 2 * NumParts(v, group_.offsets) <
             static_cast<int>(group_.blocks.size());
    };
    for (const auto v : basis.localized_rest.colwise()) {
      if (touches_few(v)) Report(v);
    }
    ReportGauge(gauge);
    for (const auto v : basis.localized_rest.colwise()) {
      if (!touches_few(v)) Report(v);
    }
    constexpr int kMaxAnchors = 20;
    Suggest(basis.rest, kMaxAnchors);
  }

  // Of the pairs with equal values, those whose columns of J are parallel: a
  // null vector has no other entries.
  void FindEqualParameters(const MatrixXd& V) {
    std::vector<Parameter> parameters = ParametersOf(V);
    std::sort(parameters.begin(),
              parameters.end(),
              [](const Parameter& a, const Parameter& b) {
                return std::tie(a.value, a.row) < std::tie(b.value, b.row);
              });
    for (auto a = parameters.begin(); a != parameters.end(); ++a) {
      // Others of equal value, such as amplitudes, may lie between two rates.
      const auto b =
          std::find_if(a + 1, parameters.end(), [&](const Parameter& other) {
            return !HasEqualValue(*a, other) || IsParallel(V, *a, other);
          });
      if (b == parameters.end() || !HasEqualValue(*a, *b)) continue;
      report_.equal_parameters.push_back(
          {{a->block, b->block}, {a->tangent, b->tangent}, a->value});
    }
  }

  void DescribeWeak(const MatrixXd& V) {
    // Names a gauge freedom that a weak prior removes, if it explains all weak
    // directions, or this one.
    const std::string name = matcher_.NameOf(V);
    for (const auto v : V.colwise()) {
      RankReport::Direction direction = MakeDirection(v);
      direction.gauge = name.empty() ? matcher_.NameOf(v) : name;
      report_.weak.push_back(std::move(direction));
    }
  }

 private:
  struct Parameter {
    double value = 0.0;
    int row = 0;  // of V
    int block = 0;
    int tangent = 0;
    double share = 0.0;  // |V^T e_row|^2
  };

  // a.value <= b.value
  static bool HasEqualValue(const Parameter& a, const Parameter& b) {
    constexpr double kEqual = 1e-9;
    return b.value - a.value <= kEqual * std::abs(a.value);
  }

  // Whether V spans a vector of the two parameters alone.
  static bool IsParallel(const MatrixXd& V,
                         const Parameter& a,
                         const Parameter& b) {
    constexpr double kUnseen = 1.0 - 1e-9;
    const double sum = a.share + b.share;
    if (sum < kUnseen) return false;
    const double largest_share =
        0.5 * sum +
        std::hypot(0.5 * (a.share - b.share), V.row(a.row).dot(V.row(b.row)));
    return largest_share >= kUnseen;
  }

  // Those that V moves by more than a small share, except zeros and tangent
  // directions without a value. There are a few for each column of V.
  std::vector<Parameter> ParametersOf(const MatrixXd& V) const {
    constexpr double kLeastShare = 1e-3;
    std::vector<Parameter> parameters;
    for (std::size_t b = 0; b < group_.blocks.size(); ++b) {
      const RankReport::Block& block = report_.blocks[group_.blocks[b]];
      for (int i = group_.offsets[b]; i < group_.offsets[b + 1]; ++i) {
        const int tangent = group_.columns[i] - block.column;
        const int component = block.components[tangent];
        const double share = V.row(i).squaredNorm();
        if (component < 0 || share < kLeastShare) continue;
        const double value = block.values[component];
        if (value == 0.0) continue;
        parameters.push_back({value, i, group_.blocks[b], tangent, share});
      }
    }
    return parameters;
  }

  // Adds v, of length one, to the reported span. Returns false if v is not
  // independent of it.
  bool Report(const VectorXd& v) {
    if (reported_.cols() == dimension_ || !Extend(v, &reported_)) return false;
    report_.undetermined.push_back(MakeDirection(v));
    return true;
  }

  void ReportGauge(const GaugeMatch& gauge) {
    RankReport::GaugeFreedom freedom;
    freedom.group = g_;
    freedom.name = gauge.name;
    freedom.num_generators = gauge.num_generators;
    for (Index j = 0; j < gauge.directions.cols(); ++j) {
      if (!Report(gauge.directions.col(j))) continue;
      report_.undetermined.back().gauge = gauge.name;
      report_.undetermined.back().generator = gauge.generators[j];
      freedom.directions.push_back(
          static_cast<int>(report_.undetermined.size()) - 1);
    }
    if (freedom.directions.empty()) return;
    report_.gauges.push_back(std::move(freedom));
  }

  void Suggest(const MatrixXd& directions, int max_anchors) {
    // A block whose tangent directions are all components.
    std::vector<bool> can_hold_rows;
    for (const int b : group_.blocks) {
      const std::vector<int>& components = report_.blocks[b].components;
      can_hold_rows.push_back(
          std::count(components.begin(), components.end(), -1) == 0);
    }
    for (const Anchor& anchor : ChooseAnchors(
             directions, group_.offsets, can_hold_rows, max_anchors)) {
      RankReport::Suggestion suggestion;
      suggestion.group = g_;
      suggestion.block = group_.blocks[anchor.block];
      const RankReport::Block& block = report_.blocks[suggestion.block];
      for (const int row : anchor.rows) {
        suggestion.tangent.push_back(
            group_.columns[group_.offsets[anchor.block] + row] - block.column);
      }
      suggestion.whole_block =
          static_cast<int>(anchor.rows.size()) == block.tangent_size;
      suggestion.num_removed = anchor.num_removed;
      report_.suggestions.push_back(std::move(suggestion));
    }
  }

  // v: scaled, of length one, one entry a column of the group.
  RankReport::Direction MakeDirection(const VectorXd& v) const {
    RankReport::Direction direction;
    direction.group = g_;
    direction.singular_value = (group_.A * v).norm() / report_.s_max;
    VectorXd motion = v.cwiseQuotient(group_.lengths);
    Index largest = 0;
    motion.cwiseAbs().maxCoeff(&largest);
    motion /= static_cast<double>(motion[largest]);
    for (std::size_t b = 0; b < group_.blocks.size(); ++b) {
      const int begin = group_.offsets[b];
      const int end = group_.offsets[b + 1];
      const double length = v.segment(begin, end - begin).norm();
      if (length <= kNoPart) continue;
      const RankReport::Block& block = report_.blocks[group_.blocks[b]];
      RankReport::Part part;
      part.block = group_.blocks[b];
      part.share = length * length;
      part.motion = VectorXd::Zero(block.tangent_size);
      for (int i = begin; i < end; ++i) {
        part.motion[group_.columns[i] - block.column] = motion[i];
      }
      direction.parts.push_back(std::move(part));
    }
    std::stable_sort(direction.parts.begin(),
                     direction.parts.end(),
                     [](const RankReport::Part& a, const RankReport::Part& b) {
                       return a.share > b.share;
                     });
    return direction;
  }

  const RankReport::Options& options_;
  const BlockGroup& group_;
  const int g_;
  RankReport& report_;
  const GaugeMatcher matcher_;
  Index dimension_ = 0;  // of the null space
  MatrixXd reported_;    // orthonormal basis of the reported span
};

}  // namespace

void DescribeGroup(const RankReport::Options& options,
                   const ceres::Problem& problem,
                   const BlockGroup& group,
                   int g,
                   const MatrixXd& null_space,
                   const MatrixXd& weak,
                   RankReport* report) {
  if (null_space.cols() == 0 && weak.cols() == 0) return;
  GroupDescription description(options, problem, group, g, report);
  if (null_space.cols() > 0) {
    description.DescribeNullSpace(null_space);
    description.FindEqualParameters(null_space);
  }
  if (weak.cols() > 0) description.DescribeWeak(weak);
}

}  // namespace invgrad
