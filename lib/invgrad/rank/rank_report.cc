#include "invgrad/rank/rank_report.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "Eigen/SparseCore"
#include "glog/logging.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/core/jacobian_operator.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/rank/anchor.h"
#include "invgrad/rank/gauge_match.h"
#include "invgrad/rank/largest_singular_value.h"
#include "invgrad/rank/localized_basis.h"
#include "invgrad/rank/smallest_singular.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using SparseMatrix = Eigen::SparseMatrix<double>;

// A dense matrix of so many entries takes 320 MB.
constexpr double kLargestDense = 4e7;

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

VectorXd ColumnNorms(const SparseMatrix& J) {
  VectorXd norms(J.cols());
  for (Index j = 0; j < J.cols(); ++j) {
    const Index begin = J.outerIndexPtr()[j];
    norms[j] = Eigen::Map<const VectorXd>(J.valuePtr() + begin,
                                          J.outerIndexPtr()[j + 1] - begin)
                   .stableNorm();
  }
  return norms;
}

// Sets that grow together.
class UnionFind {
 public:
  explicit UnionFind(int size) : parents_(size) {
    std::iota(parents_.begin(), parents_.end(), 0);
  }
  int Find(int i) {
    while (parents_[i] != i) i = parents_[i] = parents_[parents_[i]];
    return i;
  }
  void Join(int i, int j) { parents_[Find(i)] = Find(j); }

 private:
  std::vector<int> parents_;
};

// Blocks that residuals tie together by derivatives that are not zero, and
// their part of J.
struct Group {
  std::vector<int> blocks;
  std::vector<int> columns;  // of J, without unused ones
  std::vector<int> offsets;  // where each block's columns begin; one more
  SparseMatrix J;
  SparseMatrix A;  // J D^-1
  std::vector<int> residual_blocks;
  SmallestSingular small;  // of A
  bool is_dense = false;
};

class Analysis {
 public:
  Analysis(const RankReport::Options& options,
           const ceres::Problem& problem,
           RankReport* report)
      : options_(options), problem_(problem), report_(*report) {}

  bool Run(std::string* error) {
    if (!Linearize(error)) return false;
    FindUnused();
    MakeGroups();
    if (!Decompose(error)) return false;
    SummarizeSpectrum();
    if (!UnscaledSpectrum(error)) return false;
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      Describe(static_cast<int>(g));
    }
    const auto by_singular_value = [](const RankReport::Direction& a,
                                      const RankReport::Direction& b) {
      return a.singular_value < b.singular_value;
    };
    std::stable_sort(
        report_.weak.begin(), report_.weak.end(), by_singular_value);
    return true;
  }

 private:
  bool Linearize(std::string* error) {
    ProblemLinearizer::Options options;
    options.apply_loss_function = options_.apply_loss_function;
    options.evaluation_callback = options_.evaluation_callback;
    const ProblemLinearizer linearizer(&problem_, options);
    LinearizationParts parts;
    parts.jacobian = true;
    Linearization linearization;
    if (!linearizer.Linearize(parts, &linearization, error)) return false;
    J_ = ToSparse(*linearization.jacobian);
    report_.num_residuals = linearizer.num_residuals();
    report_.num_parameters = linearizer.num_parameters();
    report_.threshold = options_.threshold;
    report_.weak_threshold = options_.weak_threshold;
    const std::vector<double*>& blocks = linearizer.parameter_blocks();
    report_.num_constant_blocks =
        problem_.NumParameterBlocks() - static_cast<int>(blocks.size());
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      AddBlock(blocks[b], linearizer.column(static_cast<int>(b)));
    }
    return ReadResidualBlocks(error);
  }

  void AddBlock(double* values, int column) {
    RankReport::Block block;
    block.values = values;
    if (options_.block_name) block.name = options_.block_name(values);
    if (block.name.empty()) {
      block.name = "block " + std::to_string(report_.blocks.size());
    }
    block.size = problem_.ParameterBlockSize(values);
    block.tangent_size = problem_.ParameterBlockTangentSize(values);
    block.column = column;
    const ceres::Manifold* manifold = problem_.GetManifold(values);
    block.components.assign(block.tangent_size, -1);
    if (manifold == nullptr) {
      std::iota(block.components.begin(), block.components.end(), 0);
    } else if (block.tangent_size > 0) {
      RowMajorMatrix P(block.size, block.tangent_size);
      CHECK(manifold->PlusJacobian(values, P.data()));  // the linearizer did
      for (int j = 0; j < block.tangent_size; ++j) {
        Index i = 0;
        const double largest = P.col(j).cwiseAbs().maxCoeff(&i);
        if (P(i, j) == 1.0 && largest == P.col(j).cwiseAbs().sum()) {
          block.components[j] = static_cast<int>(i);
        }
      }
    }
    block_of_[values] = static_cast<int>(report_.blocks.size());
    report_.blocks.push_back(std::move(block));
    block_of_column_.insert(block_of_column_.end(),
                            report_.blocks.back().tangent_size,
                            static_cast<int>(report_.blocks.size()) - 1);
  }

  bool ReadResidualBlocks(std::string* error) {
    std::vector<ceres::ResidualBlockId> ids;
    problem_.GetResidualBlocks(&ids);
    arguments_.resize(ids.size());
    for (std::size_t r = 0; r < ids.size(); ++r) {
      problem_.GetParameterBlocksForResidualBlock(ids[r], &arguments_[r]);
    }
    // J three times and one of its triangles, and A^T A.
    const double bytes = 16.0;
    const double entries = static_cast<double>(J_.nonZeros());
    double normal = 0.0;
    const Eigen::SparseMatrix<double, Eigen::RowMajor> rows = J_;
    for (Index i = 0; i < rows.rows(); ++i) {
      const double size = rows.outerIndexPtr()[i + 1] - rows.outerIndexPtr()[i];
      normal += size * size;
    }
    const double n = J_.cols();
    return FitsInMemory("the rank report",
                        {{"J", 5.0 * bytes * entries},
                         {"J^T J", bytes * std::min(normal, n * n)}},
                        0.0,
                        error);
  }

  void FindUnused() {
    norms_ = ColumnNorms(J_);
    std::unordered_set<const double*> named;
    for (const std::vector<double*>& arguments : arguments_) {
      named.insert(arguments.begin(), arguments.end());
    }
    for (std::size_t b = 0; b < report_.blocks.size(); ++b) {
      const RankReport::Block& block = report_.blocks[b];
      RankReport::Unused unused;
      unused.block = static_cast<int>(b);
      unused.in_no_residual = named.count(block.values) == 0;
      for (int i = 0; i < block.tangent_size; ++i) {
        if (norms_[block.column + i] == 0.0) unused.tangent.push_back(i);
      }
      if (unused.tangent.empty()) continue;
      unused.whole_block =
          static_cast<int>(unused.tangent.size()) == block.tangent_size;
      report_.unused.push_back(std::move(unused));
    }
    for (Index j = 0; j < norms_.size(); ++j) {
      if (norms_[j] == 0.0) continue;
      if (report_.longest_column == 0.0) report_.shortest_column = norms_[j];
      report_.shortest_column = std::min(report_.shortest_column, norms_[j]);
      report_.longest_column = std::max(report_.longest_column, norms_[j]);
    }
  }

  void MakeGroups() {
    const int num_blocks = static_cast<int>(report_.blocks.size());
    const Eigen::SparseMatrix<double, Eigen::RowMajor> rows = J_;
    UnionFind sets(num_blocks);
    std::vector<int> block_of_row(static_cast<std::size_t>(rows.rows()), -1);
    for (Index i = 0; i < rows.rows(); ++i) {
      const int begin = rows.outerIndexPtr()[i];
      const int end = rows.outerIndexPtr()[i + 1];
      if (begin == end) continue;
      block_of_row[i] = block_of_column_[rows.innerIndexPtr()[begin]];
      for (int e = begin; e < end; ++e) {
        sets.Join(block_of_row[i], block_of_column_[rows.innerIndexPtr()[e]]);
      }
    }
    std::vector<int> group_of_set(num_blocks, -1);
    std::vector<int> local(static_cast<std::size_t>(J_.cols()), -1);
    for (int b = 0; b < num_blocks; ++b) {
      RankReport::Block& block = report_.blocks[b];
      std::vector<int> used;
      for (int j = block.column; j < block.column + block.tangent_size; ++j) {
        if (norms_[j] > 0.0) used.push_back(j);
      }
      if (used.empty()) continue;
      int& group = group_of_set[sets.Find(b)];
      if (group < 0) {
        group = static_cast<int>(groups_.size());
        groups_.emplace_back();
      }
      block.group = group;
      groups_[group].blocks.push_back(b);
      groups_[group].offsets.push_back(
          static_cast<int>(groups_[group].columns.size()));
      for (const int j : used) {
        local[j] = static_cast<int>(groups_[group].columns.size());
        groups_[group].columns.push_back(j);
      }
    }
    report_.num_groups = static_cast<int>(groups_.size());
    std::vector<std::vector<Eigen::Triplet<double>>> entries(groups_.size());
    std::vector<int> num_rows(groups_.size(), 0);
    for (Index i = 0; i < rows.rows(); ++i) {
      if (block_of_row[i] < 0) continue;
      const int group = report_.blocks[block_of_row[i]].group;
      for (int e = rows.outerIndexPtr()[i]; e < rows.outerIndexPtr()[i + 1];
           ++e) {
        entries[group].emplace_back(num_rows[group],
                                    local[rows.innerIndexPtr()[e]],
                                    rows.valuePtr()[e]);
      }
      ++num_rows[group];
    }
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      Group& group = groups_[g];
      group.offsets.push_back(static_cast<int>(group.columns.size()));
      group.J.resize(num_rows[g], static_cast<Index>(group.columns.size()));
      group.J.setFromTriplets(entries[g].begin(), entries[g].end());
      entries[g].clear();
      entries[g].shrink_to_fit();
      group.A = group.J;
      for (Index j = 0; j < group.A.outerSize(); ++j) {
        for (SparseMatrix::InnerIterator it(group.A, j); it; ++it) {
          it.valueRef() /= norms_[group.columns[j]];
        }
      }
    }
    for (std::size_t r = 0; r < arguments_.size(); ++r) {
      std::unordered_set<int> touched;
      for (const double* values : arguments_[r]) {
        const auto it = block_of_.find(values);
        if (it == block_of_.end()) continue;
        const int group = report_.blocks[it->second].group;
        if (group >= 0 && touched.insert(group).second) {
          groups_[group].residual_blocks.push_back(static_cast<int>(r));
        }
      }
    }
  }

  // The small end of every group's spectrum, and the large end of all.
  bool Decompose(std::string* error) {
    constexpr double kNormTolerance = 1e-3;
    double estimate = 0.0;
    std::vector<double> estimates;
    for (const Group& group : groups_) {
      estimates.push_back(LargestSingularValue(
          SparseJacobian(SparseJacobian::Matrix(group.A)), kNormTolerance));
      estimate = std::max(estimate, estimates.back());
    }
    report_.s_max = estimate;
    // The estimate is from below, so that nothing is missed that the exact
    // largest value of small groups makes weak.
    constexpr double kMargin = 1.5;
    const double limit = kMargin * options_.weak_threshold * estimate;
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      Group& group = groups_[g];
      const double entries = static_cast<double>(group.A.rows()) *
                             static_cast<double>(group.A.cols());
      group.is_dense =
          group.A.cols() <= options_.max_dense_size && entries <= kLargestDense;
      const bool ok =
          group.is_dense
              ? DenseSmallestSingular(group.A, limit, &group.small, error)
              : SparseSmallestSingular(group.A,
                                       estimates[g],
                                       limit,
                                       options_.max_directions,
                                       &group.small,
                                       error);
      if (!ok) {
        *error = "the group of " + report_.blocks[group.blocks.front()].name +
                 ": " + *error;
        return false;
      }
      if (group.is_dense && group.small.s.size() > 0) {
        report_.s_max =
            std::max(report_.s_max, group.small.s[group.small.s.size() - 1]);
      }
    }
    return true;
  }

  void SummarizeSpectrum() {
    std::vector<double> all;
    int num_undetermined = 0;
    for (const RankReport::Unused& unused : report_.unused) {
      all.insert(all.end(), unused.tangent.size(), 0.0);
      num_undetermined += static_cast<int>(unused.tangent.size());
    }
    report_.has_all_singular_values = true;
    for (const Group& group : groups_) {
      report_.has_all_singular_values &= group.is_dense;
      report_.is_complete &= group.small.complete;
      num_undetermined += NumUndetermined(group);
      for (const double s : group.small.s) all.push_back(s / report_.s_max);
    }
    std::sort(all.begin(), all.end());
    report_.singular_values =
        Eigen::Map<const VectorXd>(all.data(), static_cast<Index>(all.size()));
    report_.rank = report_.num_parameters - num_undetermined;
  }

  bool UnscaledSpectrum(std::string* error) {
    if (!report_.has_all_singular_values) return true;
    std::vector<double> all(static_cast<std::size_t>(report_.num_parameters),
                            0.0);
    std::size_t next = 0;
    for (const Group& group : groups_) {
      VectorXd s;
      if (!DenseSingularValues(group.J, &s, error)) return false;
      for (const double value : s) all[next++] = value;
    }
    std::sort(all.begin(), all.end());
    if (!all.empty() && all.back() > 0.0) {
      report_.unscaled_singular_values =
          Eigen::Map<const VectorXd>(all.data(),
                                     static_cast<Index>(all.size())) /
          all.back();
    }
    return true;
  }

  int NumUndetermined(const Group& group) const {
    return static_cast<int>(
        (group.small.s.array() <= options_.threshold * report_.s_max).count());
  }

  // The group's part of the gauges' picture.
  GaugeComponent Component(const Group& group,
                           VectorXd* scale,
                           std::vector<int>* column_of) const {
    GaugeComponent component;
    std::unordered_map<const double*, int> index;
    const auto add = [&](const double* values, int size, bool is_constant) {
      index[values] = static_cast<int>(component.blocks.size());
      GaugeBlock block;
      block.values = values;
      block.size = size;
      block.offset = component.ambient_size;
      block.is_constant = is_constant;
      block.manifold = problem_.GetManifold(values);
      component.ambient_size += size;
      component.blocks.push_back(block);
    };
    std::vector<double> scales;
    int num_used = 0;
    for (const int b : group.blocks) {
      const RankReport::Block& block = report_.blocks[b];
      add(block.values, block.size, false);
      for (int i = 0; i < block.tangent_size; ++i) {
        const double norm = norms_[block.column + i];
        column_of->push_back(norm > 0.0 ? num_used++ : -1);
        scales.push_back(norm);
      }
    }
    *scale = Eigen::Map<const VectorXd>(scales.data(),
                                        static_cast<Index>(scales.size()));
    for (const int r : group.residual_blocks) {
      std::vector<int> arguments;
      for (const double* values : arguments_[r]) {
        if (index.count(values) == 0) {
          add(values, problem_.ParameterBlockSize(values), true);
        }
        arguments.push_back(index[values]);
      }
      component.arguments.push_back(std::move(arguments));
    }
    return component;
  }

  void Describe(int g) {
    const Group& group = groups_[g];
    const int num_null = NumUndetermined(group);
    const auto num_weak = static_cast<int>(
        (group.small.s.array() <= options_.weak_threshold * report_.s_max)
            .count() -
        num_null);
    if (num_null + num_weak == 0) return;
    if (num_null > 0) DescribeNullSpace(g, group.small.V.leftCols(num_null));
    if (num_weak == 0) return;
    // A gauge that a weak prior holds is named if it explains all of them, or
    // this one.
    const GaugeMatcher matcher = MakeMatcher(group);
    const MatrixXd weak = group.small.V.middleCols(num_null, num_weak);
    const std::string name = matcher.NameOf(weak);
    for (int i = 0; i < num_weak; ++i) {
      RankReport::Direction direction = MakeDirection(g, weak.col(i));
      direction.gauge = name.empty() ? matcher.NameOf(weak.col(i)) : name;
      report_.weak.push_back(std::move(direction));
    }
  }

  GaugeMatcher MakeMatcher(const Group& group) const {
    VectorXd scale;
    std::vector<int> column_of;
    const GaugeComponent component = Component(group, &scale, &column_of);
    std::vector<Gauge> gauges = options_.gauges;
    if (options_.look_for_built_in_gauges) {
      std::vector<Gauge> built_in = BuiltInGauges();
      gauges.insert(gauges.end(), built_in.begin(), built_in.end());
    }
    return GaugeMatcher(component, group.A, scale, column_of, gauges);
  }

  void DescribeNullSpace(int g, const Eigen::Ref<const MatrixXd>& V) {
    const Group& group = groups_[g];
    const LocalizedBasis basis = Localize(V, group.offsets);
    // Directions are told as long as each says something new: those within a
    // block, those that touch few, gauge freedoms, and what else there is.
    MatrixXd told(V.rows(), V.cols());  // orthonormal, of the same span
    Index num_told = 0;
    const auto tell = [&](const VectorXd& v) {
      if (num_told == V.cols()) return false;
      VectorXd new_part = v;
      for (int pass = 0; pass < 2; ++pass) {
        new_part -= told.leftCols(num_told) *
                    (told.leftCols(num_told).transpose() * new_part);
      }
      constexpr double kNew = 1e-4;
      if (!(new_part.norm() > kNew)) return false;
      told.col(num_told++) = new_part.normalized();
      report_.undetermined.push_back(MakeDirection(g, v));
      return true;
    };
    for (Index j = 0; j < basis.single.cols(); ++j) {
      tell(basis.single.col(j));
      const int b = basis.single_blocks[j];
      if (j == 0 || basis.single_blocks[j - 1] != b) {
        Suggest(g, b, basis.single, basis.single_blocks);
      }
    }
    const auto num_rest = static_cast<int>(basis.rest.cols());
    if (num_rest == 0) return;
    const GaugeMatch gauge =
        MakeMatcher(group).Best(options_.threshold * report_.s_max, num_rest);
    const int num_blocks = static_cast<int>(group.blocks.size());
    std::vector<Index> others;
    for (Index j = 0; j < basis.localized_rest.cols(); ++j) {
      const VectorXd v = basis.localized_rest.col(j);
      if (2 * NumParts(v, group.offsets) < num_blocks) {
        tell(v);
      } else {
        others.push_back(j);
      }
    }
    RankReport::GaugeFreedom freedom;
    freedom.group = g;
    freedom.name = gauge.name;
    freedom.num_generators = gauge.num_generators;
    for (Index j = 0; j < gauge.directions.cols(); ++j) {
      if (!tell(gauge.directions.col(j))) continue;
      report_.undetermined.back().gauge = gauge.name;
      report_.undetermined.back().generator = gauge.generators[j];
      freedom.directions.push_back(
          static_cast<int>(report_.undetermined.size()) - 1);
    }
    if (!freedom.directions.empty()) {
      report_.gauges.push_back(std::move(freedom));
    }
    for (const Index j : others) tell(basis.localized_rest.col(j));

    constexpr int kMaxAnchors = 20;
    std::vector<bool> can_hold;
    for (const int b : group.blocks) {
      const std::vector<int>& components = report_.blocks[b].components;
      can_hold.push_back(std::count(components.begin(), components.end(), -1) ==
                         0);
    }
    for (const Anchor& anchor :
         ChooseAnchors(basis.rest, group.offsets, can_hold, kMaxAnchors)) {
      AddSuggestion(g, anchor.block, anchor.rows, anchor.num_removed);
    }
  }

  // For the directions within block b of the group.
  void Suggest(int g,
               int b,
               const MatrixXd& single,
               const std::vector<int>& single_blocks) {
    const Group& group = groups_[g];
    const auto first =
        std::find(single_blocks.begin(), single_blocks.end(), b) -
        single_blocks.begin();
    const auto count =
        std::count(single_blocks.begin(), single_blocks.end(), b);
    const int begin = group.offsets[b];
    const int size = group.offsets[b + 1] - begin;
    const std::vector<int>& components =
        report_.blocks[group.blocks[b]].components;
    const bool can_hold =
        std::count(components.begin(), components.end(), -1) == 0;
    const std::vector<Anchor> anchors = ChooseAnchors(
        single.block(begin, first, size, count), {0, size}, {can_hold}, 1);
    for (const Anchor& anchor : anchors) {
      AddSuggestion(g, b, anchor.rows, anchor.num_removed);
    }
  }

  void AddSuggestion(int g,
                     int b,
                     const std::vector<int>& rows,
                     int num_removed) {
    const Group& group = groups_[g];
    const RankReport::Block& block = report_.blocks[group.blocks[b]];
    RankReport::Suggestion suggestion;
    suggestion.group = g;
    suggestion.block = group.blocks[b];
    for (const int row : rows) {
      suggestion.tangent.push_back(group.columns[group.offsets[b] + row] -
                                   block.column);
    }
    suggestion.whole_block =
        static_cast<int>(rows.size()) == block.tangent_size;
    suggestion.num_removed = num_removed;
    report_.suggestions.push_back(std::move(suggestion));
  }

  // From v, scaled, of length one, of the group's columns.
  RankReport::Direction MakeDirection(int g, const VectorXd& v) const {
    const Group& group = groups_[g];
    RankReport::Direction direction;
    direction.group = g;
    direction.singular_value = (group.A * v).norm() / report_.s_max;
    VectorXd motion(v.size());
    for (Index i = 0; i < v.size(); ++i) {
      motion[i] = v[i] / norms_[group.columns[i]];
    }
    Index largest = 0;
    motion.cwiseAbs().maxCoeff(&largest);
    motion /= static_cast<double>(motion[largest]);
    for (std::size_t b = 0; b < group.blocks.size(); ++b) {
      const double length =
          v.segment(group.offsets[b], group.offsets[b + 1] - group.offsets[b])
              .norm();
      if (length <= kNoPart) continue;
      const RankReport::Block& block = report_.blocks[group.blocks[b]];
      RankReport::Part part;
      part.block = group.blocks[b];
      part.share = length * length;
      part.motion = VectorXd::Zero(block.tangent_size);
      for (int i = group.offsets[b]; i < group.offsets[b + 1]; ++i) {
        part.motion[group.columns[i] - block.column] = motion[i];
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
  const ceres::Problem& problem_;
  RankReport& report_;
  SparseMatrix J_;
  VectorXd norms_;                    // of J's columns: D
  std::vector<int> block_of_column_;  // of J
  std::unordered_map<const double*, int> block_of_;
  std::vector<std::vector<double*>> arguments_;  // one a residual block
  std::vector<Group> groups_;
};

}  // namespace

bool RankReport::Options::IsValid(std::string* error) const {
  CHECK(error != nullptr);
  // Below, rounding decides.
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
  if (!Analysis(options, problem, &result).Run(error)) return false;
  *report = std::move(result);
  return true;
}

}  // namespace invgrad
