#include "invgrad/rank/block_groups.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <set>
#include <utility>

#include "fmt/core.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/core/union_find.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/small_covariance.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/rank/at_bounds.h"
#include "invgrad/stored_jacobian.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using SparseMatrix = Eigen::SparseMatrix<double>;

// J without its zeros.
SparseMatrix ToSparse(const JacobianOperator& J) {
  SparseMatrix result;
  if (const auto* sparse = dynamic_cast<const SparseJacobian*>(&J)) {
    result = sparse->matrix();
  } else {
    MatrixXd dense;
    J.ToDense(&dense);
    result = dense.sparseView(1.0, 0.0);
  }
  result.prune([](Index, Index, double value) { return value != 0.0; });
  result.makeCompressed();
  return result;
}

bool CheckMemory(const SparseMatrix& J, std::string* error) {
  // Copies of J and one triangle, and A^T A.
  std::vector<double> row_sizes(static_cast<std::size_t>(J.rows()), 0.0);
  for (Index e = 0; e < J.nonZeros(); ++e) ++row_sizes[J.innerIndexPtr()[e]];
  const double normal = std::inner_product(
      row_sizes.begin(), row_sizes.end(), row_sizes.begin(), 0.0);
  const double n = static_cast<double>(J.cols());
  constexpr double kBytes = 16.0;  // an entry
  return FitsInMemory("the rank report",
                      {{"J", 5.0 * kBytes * static_cast<double>(J.nonZeros())},
                       {"J^T J", kBytes * std::min(normal, n * n)}},
                      0.0,
                      error);
}

// Whether Plus moves the component i alone, by the length of the step along
// tangent direction j: to one side at least, as an angle may wrap around.
bool MovesComponent(const ceres::Manifold& manifold,
                    const double* values,
                    int i,
                    int j) {
  const Eigen::Map<const VectorXd> x(values, manifold.AmbientSize());
  constexpr double kSame = 1e-9;
  constexpr std::array<double, 2> kSides = {0.1, -0.1};
  return std::any_of(kSides.begin(), kSides.end(), [&](double h) {
    const VectorXd step = h * VectorXd::Unit(manifold.TangentSize(), j);
    const VectorXd expected = x + h * VectorXd::Unit(x.size(), i);
    VectorXd moved(x.size());
    return manifold.Plus(values, step.data(), moved.data()) &&
           ((moved - expected).array().abs() <=
            kSame * (x.array().abs() + std::abs(h)))
               .all();
  });
}

// The component of each tangent direction of a block, or -1.
std::vector<int> Components(const ceres::Manifold* manifold,
                            const double* values,
                            int tangent_size) {
  std::vector<int> components(static_cast<std::size_t>(tangent_size), -1);
  if (manifold == nullptr) {
    std::iota(components.begin(), components.end(), 0);
  } else if (tangent_size > 0) {
    RowMajorMatrix P(manifold->AmbientSize(), tangent_size);
    CHECK(manifold->PlusJacobian(values, P.data()));  // as in Linearize
    for (int j = 0; j < tangent_size; ++j) {
      Index i = 0;
      const double largest = P.col(j).cwiseAbs().maxCoeff(&i);
      if (P(i, j) == 1.0 && largest == P.col(j).cwiseAbs().sum() &&
          MovesComponent(*manifold, values, static_cast<int>(i), j)) {
        components[j] = static_cast<int>(i);
      }
    }
  }
  return components;
}

void DescribeBlocks(const RankReport::Options& options,
                    const ceres::Problem& problem,
                    const ProblemStructure& structure,
                    RankReport* report) {
  for (const auto& from : structure.parameter_blocks) {
    RankReport::Block block;
    block.values = from.values;
    if (options.block_name) block.name = options.block_name(from.values);
    if (block.name.empty()) {
      block.name = fmt::format("block {}", report->blocks.size());
    }
    block.size = from.ambient_size;
    block.tangent_size = from.tangent_size;
    block.column = from.column;
    block.components =
        Components(from.manifold, from.values, from.tangent_size);
    report->blocks.push_back(std::move(block));
  }
  report->num_residuals = structure.num_residuals;
  report->num_parameters = structure.num_parameters;
  report->num_constant_blocks =
      problem.NumParameterBlocks() - static_cast<int>(report->blocks.size());
}

// The largest absolute value of each row.
VectorXd RowMaxima(const SparseMatrix& J) {
  VectorXd maxima = VectorXd::Zero(J.rows());
  for (Index e = 0; e < J.nonZeros(); ++e) {
    double& of_row = maxima[J.innerIndexPtr()[e]];
    of_row = std::max(of_row, std::abs(J.valuePtr()[e]));
  }
  return maxima;
}

// Sets columns of rounding errors to zero, with their lengths.
void RemoveRounding(const RankReport& report,
                    SparseMatrix* J,
                    VectorXd* lengths,
                    std::vector<bool>* is_rounding) {
  is_rounding->assign(static_cast<std::size_t>(lengths->size()), false);
  const VectorXd row_maxima = RowMaxima(*J);
  const auto is_short_in_rows = [&](int column) {
    for (SparseMatrix::InnerIterator it(*J, column); it; ++it) {
      const double largest = row_maxima[it.row()];
      if (std::abs(it.value()) > RoundingFloor::kRounding * largest) {
        return false;
      }
    }
    return true;
  };
  for (const RankReport::Block& block : report.blocks) {
    const auto value = [&block](int i) {
      const int component = block.components[i];
      return component < 0 ? 0.0 : block.values[component];
    };
    RoundingFloor floor;
    for (int i = 0; i < block.tangent_size; ++i) {
      floor.Add((*lengths)[block.column + i], value(i));
    }
    for (int i = 0; i < block.tangent_size; ++i) {
      double& length = (*lengths)[block.column + i];
      const bool is_above = block.components[i] < 0
                                ? floor.IsAbove(length)
                                : floor.IsAbove(length, value(i)) &&
                                      is_short_in_rows(block.column + i);
      if (length == 0.0 || !is_above) continue;
      length = 0.0;
      (*is_rounding)[block.column + i] = true;
    }
  }
  J->prune([lengths](Index, Index j, double) { return (*lengths)[j] != 0.0; });
}

void FindShortColumns(const RankReport::Options& options,
                      const VectorXd& lengths,
                      RankReport* report) {
  constexpr double kShort = 0.02;
  constexpr double kComparable = 0.1;
  for (std::size_t b = 0; b < report->blocks.size(); ++b) {
    const RankReport::Block& block = report->blocks[b];
    if (block.tangent_size != 3 || block.size != 3) continue;
    if (options.group_sizes && !options.group_sizes(block.values).empty()) {
      continue;
    }
    std::array<int, 3> order = {0, 1, 2};
    const auto length = [&](int i) { return lengths[block.column + i]; };
    std::sort(order.begin(), order.end(), [&](int i, int j) {
      return length(i) < length(j);
    });
    const double relative = length(order[0]) / length(order[1]);
    if (relative > 0.0 && relative <= kShort &&
        length(order[1]) >= kComparable * length(order[2])) {
      report->short_columns.push_back(
          {static_cast<int>(b), order[0], relative});
    }
  }
}

// D: the lengths, or their root mean square in each group of one unit.
bool FindScales(const RankReport::Options& options,
                const RankReport& report,
                VectorXd* lengths,
                std::string* error) {
  if (!options.group_sizes) return true;
  for (const RankReport::Block& block : report.blocks) {
    const std::vector<int> sizes = options.group_sizes(block.values);
    if (sizes.empty()) continue;
    if (*std::min_element(sizes.begin(), sizes.end()) < 1 ||
        std::accumulate(sizes.begin(), sizes.end(), 0) != block.tangent_size) {
      *error = fmt::format(
          "the group_sizes of `{}` must be positive and add up to {}",
          block.name,
          block.tangent_size);
      return false;
    }
    int begin = block.column;
    for (const int size : sizes) {
      auto group = lengths->segment(begin, size);
      const double scale = group.norm() / std::sqrt(size);
      for (double& length : group) {
        if (length > 0.0) length = scale;
      }
      begin += size;
    }
  }
  return true;
}

void FindUnused(const VectorXd& lengths,
                const std::vector<bool>& is_rounding,
                const ProblemStructure& structure,
                RankReport* report) {
  std::vector<bool> is_named(report->blocks.size(), false);
  for (const auto& argument : structure.arguments) {
    if (argument.block >= 0) is_named[argument.block] = true;
  }
  for (std::size_t b = 0; b < report->blocks.size(); ++b) {
    const RankReport::Block& block = report->blocks[b];
    RankReport::Unused unused;
    unused.block = static_cast<int>(b);
    unused.in_no_residual = !is_named[b];
    for (int i = 0; i < block.tangent_size; ++i) {
      if (lengths[block.column + i] > 0.0) continue;
      unused.tangent.push_back(i);
      unused.has_rounding |= is_rounding[block.column + i];
    }
    if (unused.tangent.empty()) continue;
    unused.whole_block =
        static_cast<int>(unused.tangent.size()) == block.tangent_size;
    report->unused.push_back(std::move(unused));
  }
  for (const double length : lengths) {
    if (length == 0.0) continue;
    if (report->longest_column == 0.0) report->shortest_column = length;
    report->shortest_column = std::min(report->shortest_column, length);
    report->longest_column = std::max(report->longest_column, length);
  }
}

// Sets the group of each block, and fills blocks and columns of the groups.
// Returns for each row of J its row in its group, or -1 if it is zero.
std::vector<int> FindGroups(const SparseMatrix& J,
                            const VectorXd& lengths,
                            RankReport* report,
                            std::vector<BlockGroup>* groups) {
  UnionFind sets(report->blocks.size());
  std::vector<int> block_of_row(static_cast<std::size_t>(J.rows()), -1);
  for (std::size_t b = 0; b < report->blocks.size(); ++b) {
    const RankReport::Block& block = report->blocks[b];
    for (int e = J.outerIndexPtr()[block.column];
         e < J.outerIndexPtr()[block.column + block.tangent_size];
         ++e) {
      int& first = block_of_row[J.innerIndexPtr()[e]];
      if (first < 0) first = static_cast<int>(b);
      sets.Join(first, static_cast<int>(b));
    }
  }
  std::vector<int> group_of_set(report->blocks.size(), -1);
  for (std::size_t b = 0; b < report->blocks.size(); ++b) {
    RankReport::Block& block = report->blocks[b];
    const auto block_lengths =
        lengths.segment(block.column, block.tangent_size).array();
    if (!(block_lengths > 0.0).any()) continue;
    int& g = group_of_set[sets.Find(static_cast<int>(b))];
    if (g < 0) {
      g = static_cast<int>(groups->size());
      groups->emplace_back();
    }
    BlockGroup& group = (*groups)[g];
    block.group = g;
    group.blocks.push_back(static_cast<int>(b));
    group.offsets.push_back(static_cast<int>(group.columns.size()));
    for (int i = 0; i < block.tangent_size; ++i) {
      if (block_lengths[i] > 0.0) group.columns.push_back(block.column + i);
    }
  }
  report->num_groups = static_cast<int>(groups->size());
  std::vector<int> num_rows(groups->size(), 0);
  std::vector<int> local_rows;
  local_rows.reserve(block_of_row.size());
  for (const int b : block_of_row) {
    local_rows.push_back(b < 0 ? -1 : num_rows[report->blocks[b].group]++);
  }
  for (std::size_t g = 0; g < groups->size(); ++g) {
    BlockGroup& group = (*groups)[g];
    group.offsets.push_back(static_cast<int>(group.columns.size()));
    group.A.resize(num_rows[g], static_cast<Index>(group.columns.size()));
  }
  return local_rows;
}

// Fills A and D.
void FillJacobian(const SparseMatrix& J,
                  const VectorXd& lengths,
                  const std::vector<int>& local_rows,
                  BlockGroup* group) {
  group->lengths = lengths(group->columns);
  for (Index j = 0; j < group->A.cols(); ++j) {
    group->A.startVec(j);
    for (SparseMatrix::InnerIterator it(J, group->columns[j]); it; ++it) {
      group->A.insertBack(local_rows[it.row()], j) =
          it.value() / group->lengths[j];
    }
  }
  group->A.finalize();
}

}  // namespace

bool MayBeDense(const BlockGroup& group) {
  constexpr double kMaxEntries = 4e7;  // 320 MB
  return static_cast<double>(group.A.rows()) *
             static_cast<double>(group.A.cols()) <=
         kMaxEntries;
}

bool IsDense(const RankReport::Options& options, const BlockGroup& group) {
  return group.A.cols() <= options.max_dense_size && MayBeDense(group);
}

bool GroupBlocks(const RankReport::Options& options,
                 const ceres::Problem& problem,
                 RankReport* report,
                 std::vector<std::vector<int>>* at_bound,
                 std::vector<BlockGroup>* groups,
                 std::string* error) {
  ProblemLinearizer::Options linearizer_options;
  linearizer_options.apply_loss_function = options.apply_loss_function;
  linearizer_options.evaluation_callback = options.evaluation_callback;
  const ProblemLinearizer linearizer(&problem, linearizer_options);
  Linearization linearization;
  if (!linearizer.Linearize(
          LinearizationParts::Jacobian(), &linearization, error)) {
    return false;
  }
  SparseMatrix J = ToSparse(*linearization.jacobian);
  report->cost = linearization.cost;
  linearization = Linearization();
  if (!CheckMemory(J, error)) return false;
  const ProblemStructure& structure = linearizer.structure();
  DescribeBlocks(options, problem, structure, report);

  VectorXd lengths(J.cols());
  for (Index j = 0; j < J.cols(); ++j) {
    const int begin = J.outerIndexPtr()[j];
    lengths[j] = Eigen::Map<const VectorXd>(J.valuePtr() + begin,
                                            J.outerIndexPtr()[j + 1] - begin)
                     .stableNorm();
  }
  if (at_bound != nullptr) {
    *at_bound = DirectionsAtBounds(problem, report->blocks);
    RemoveColumns(report->blocks, *at_bound, &J, &lengths);
  }
  std::vector<bool> is_rounding;
  RemoveRounding(*report, &J, &lengths, &is_rounding);
  FindUnused(lengths, is_rounding, structure, report);
  FindShortColumns(options, lengths, report);
  if (!FindScales(options, *report, &lengths, error)) return false;
  const std::vector<int> local_rows = FindGroups(J, lengths, report, groups);
  for (BlockGroup& group : *groups) {
    FillJacobian(J, lengths, local_rows, &group);
  }
  for (const auto& residual_block : structure.residual_blocks) {
    std::vector<BlockArgument> arguments;
    std::set<int> named;
    for (int i = 0; i < residual_block.num_arguments; ++i) {
      const int a = residual_block.first_argument + i;
      const int b = structure.arguments[a].block;
      arguments.push_back({structure.values[a], b});
      if (b >= 0 && report->blocks[b].group >= 0) {
        named.insert(report->blocks[b].group);
      }
    }
    for (const int g : named) (*groups)[g].arguments.push_back(arguments);
  }
  return true;
}

}  // namespace invgrad
