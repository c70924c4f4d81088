#include "invgrad/rank/gauge_match.h"

#include <unordered_map>
#include <utility>

#include "invgrad/rank/decompositions.h"
#include "invgrad/rank/gauge.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// The group's blocks, and the other blocks of its residuals as constant ones.
GaugeComponent MakeComponent(const ceres::Problem& problem,
                             const RankReport& report,
                             const BlockGroup& group) {
  GaugeComponent component;
  std::unordered_map<const double*, int> index;
  const auto add = [&](const double* values, bool is_constant) {
    const auto [it, is_new] =
        index.insert({values, static_cast<int>(component.blocks.size())});
    if (is_new) {
      GaugeBlock block;
      block.values = values;
      block.size = problem.ParameterBlockSize(values);
      block.offset = component.ambient_size;
      block.is_constant = is_constant;
      block.manifold = problem.GetManifold(values);
      component.ambient_size += block.size;
      component.blocks.push_back(block);
    }
    return it->second;
  };
  for (const int b : group.blocks) add(report.blocks[b].values, false);
  for (const std::vector<double*>& blocks : group.arguments) {
    std::vector<int> arguments;
    arguments.reserve(blocks.size());
    for (const double* values : blocks) arguments.push_back(add(values, true));
    component.arguments.push_back(std::move(arguments));
  }
  return component;
}

// Singular values below this share of the largest count as zero.
constexpr double kIndependent = 1e-9;

// An orthonormal basis of the span of the columns, which have length one.
MatrixXd Span(const MatrixXd& X) {
  const RightSvd svd = ComputeRightSvd(X);
  const Index rank = (svd.s.array() > kIndependent * svd.s[0]).count();
  // Once more for directions in which X is nearly dependent.
  return Orthonormalized(X * svd.V.leftCols(rank));
}

// Maps an ambient motion of a block to the closest tangent motion.
MatrixXd PseudoInversePlusJacobian(const GaugeBlock& block) {
  RowMajorMatrix P(block.size, block.manifold->TangentSize());
  if (P.cols() == 0 || !block.manifold->PlusJacobian(block.values, P.data())) {
    return MatrixXd::Zero(P.cols(), P.rows());
  }
  const RightSvd svd = ComputeRightSvd(P);
  const VectorXd inverse_squares =
      (svd.s.array() > kIndependent * svd.s[0])
          .select(svd.s.array().square().inverse(), 0.0);
  return svd.V *
         (inverse_squares.asDiagonal() * (svd.V.transpose() * P.transpose()));
}

}  // namespace

GaugeMatcher::GaugeMatcher(const RankReport::Options& options,
                           const ceres::Problem& problem,
                           const RankReport& report,
                           const BlockGroup& group)
    : A_(group.A) {
  const GaugeComponent component = MakeComponent(problem, report, group);
  std::vector<MatrixXd> to_tangent;  // of each block; empty: the identity
  for (std::size_t b = 0; b < group.blocks.size(); ++b) {
    const GaugeBlock& block = component.blocks[b];
    to_tangent.push_back(block.manifold == nullptr
                             ? MatrixXd()
                             : PseudoInversePlusJacobian(block));
  }
  std::vector<Gauge> gauges = options.gauges;
  if (options.look_for_built_in_gauges) {
    for (Gauge& gauge : BuiltInGauges()) gauges.push_back(std::move(gauge));
  }
  for (const Gauge& gauge : gauges) {
    MatrixXd ambient = MatrixXd::Zero(
        component.ambient_size, static_cast<Index>(gauge.generators.size()));
    if (!gauge.motions(component, &ambient) || !ambient.allFinite()) continue;
    MatrixXd motions(A_.cols(), ambient.cols());
    for (std::size_t b = 0; b < group.blocks.size(); ++b) {
      const GaugeBlock& block = component.blocks[b];
      MatrixXd tangent = ambient.middleRows(block.offset, block.size);
      if (block.manifold != nullptr) tangent = (to_tangent[b] * tangent).eval();
      const int first = report.blocks[group.blocks[b]].column;
      for (int i = group.offsets[b]; i < group.offsets[b + 1]; ++i) {
        motions.row(i) =
            group.lengths[i] * tangent.row(group.columns[i] - first);
      }
    }
    Candidate candidate;
    candidate.name = gauge.name;
    std::vector<Index> moving;
    for (Index g = 0; g < motions.cols(); ++g) {
      if (motions.col(g).isZero(0.0)) continue;
      moving.push_back(g);
      candidate.generators.push_back(gauge.generators[g]);
    }
    if (moving.empty()) continue;
    candidate.motions = motions(Eigen::all, moving);
    candidate.motions.colwise().normalize();
    candidate.basis = Span(candidate.motions);
    // A gauge that spans all motions of the group, such as rigid motion in the
    // plane for three scalars, explains none of them.
    if (candidate.basis.cols() == A_.cols()) continue;
    candidates_.push_back(std::move(candidate));
  }
}

GaugeMatch GaugeMatcher::Best(double limit, int num_directions) const {
  GaugeMatch best;
  for (const Candidate& candidate : candidates_) {
    const RightSvd svd = ComputeRightSvd(A_ * candidate.basis);
    const Index unseen = (svd.s.array() <= limit).count();
    if (unseen <= best.directions.cols()) continue;
    best.name = candidate.name;
    best.num_generators = static_cast<int>(candidate.generators.size());
    best.directions = candidate.basis * svd.V.rightCols(unseen);
    best.generators.assign(static_cast<std::size_t>(unseen), "");
    // Named generators, if as many independent ones leave the residuals
    // unchanged.
    std::vector<Index> named;
    std::vector<std::string> names;
    for (Index g = 0; g < candidate.motions.cols(); ++g) {
      if ((A_ * candidate.motions.col(g)).norm() > limit) continue;
      named.push_back(g);
      names.push_back(candidate.generators[g]);
    }
    const MatrixXd motions = candidate.motions(Eigen::all, named);
    if (motions.cols() == unseen && Span(motions).cols() == unseen) {
      best.directions = motions;
      best.generators = names;
    }
    if (unseen >= num_directions) break;
  }
  return best;
}

std::string GaugeMatcher::NameOf(const MatrixXd& V) const {
  constexpr double kOutside = 0.05;
  for (const Candidate& candidate : candidates_) {
    const MatrixXd inside = candidate.basis * (candidate.basis.transpose() * V);
    if (((V - inside).colwise().norm().array() <= kOutside).all()) {
      return candidate.name;
    }
  }
  return "";
}

}  // namespace invgrad
