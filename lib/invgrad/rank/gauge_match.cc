#include "invgrad/rank/gauge_match.h"

#include <algorithm>
#include <unordered_map>
#include <utility>

#include "invgrad/internal/logging.h"
#include "invgrad/internal/qr.h"
#include "invgrad/rank/decompositions.h"
#include "invgrad/rank/localized_basis.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// The group's blocks, and then the other blocks of its residuals.
GaugeComponent MakeComponent(const RankReport::Options& options,
                             const ceres::Problem& problem,
                             const RankReport& report,
                             const BlockGroup& group) {
  GaugeComponent component;
  std::unordered_map<const double*, int> index;
  const auto add = [&](const BlockArgument& argument) {
    const auto [values, b] = argument;
    const auto [it, is_new] =
        index.insert({values, static_cast<int>(component.blocks.size())});
    if (is_new) {
      GaugeBlock block;
      block.values = values;
      block.size = problem.ParameterBlockSize(values);
      block.offset = component.ambient_size;
      if (b >= 0) {
        block.name = report.blocks[b].name;
      } else if (options.block_name) {
        block.name = options.block_name(values);
      }
      block.manifold = problem.GetManifold(values);
      component.ambient_size += block.size;
      component.blocks.push_back(std::move(block));
    }
    return it->second;
  };
  for (const int b : group.blocks) add({report.blocks[b].values, b});
  for (const std::vector<BlockArgument>& residual_block : group.arguments) {
    std::vector<int> arguments;
    arguments.reserve(residual_block.size());
    for (const BlockArgument& argument : residual_block) {
      arguments.push_back(add(argument));
    }
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
    : A_(group.A), component_(MakeComponent(options, problem, report, group)) {
  std::vector<MatrixXd> to_tangent;  // of each block; empty: the identity
  for (std::size_t b = 0; b < group.blocks.size(); ++b) {
    const GaugeBlock& block = component_.blocks[b];
    to_tangent.push_back(block.manifold == nullptr
                             ? MatrixXd()
                             : PseudoInversePlusJacobian(block));
  }
  std::vector<Gauge> gauges = options.gauges;
  if (options.look_for_built_in_gauges) {
    for (Gauge& gauge : BuiltInGauges()) gauges.push_back(std::move(gauge));
  }
  MatrixXd ambient;  // reuses its memory: most gauges do not fit
  for (Gauge& gauge : gauges) {
    ambient.setZero(component_.ambient_size,
                    static_cast<Index>(gauge.generators.size()));
    if (!gauge.motions(component_, &ambient) || !ambient.allFinite()) continue;
    Candidate candidate;
    candidate.motions.resize(A_.cols(), ambient.cols());
    for (std::size_t b = 0; b < group.blocks.size(); ++b) {
      const GaugeBlock& block = component_.blocks[b];
      const auto motion = ambient.middleRows(block.offset, block.size);
      const int first = report.blocks[group.blocks[b]].column;
      for (int i = group.offsets[b]; i < group.offsets[b + 1]; ++i) {
        const int tangent = group.columns[i] - first;
        if (block.manifold == nullptr) {
          candidate.motions.row(i) = group.lengths[i] * motion.row(tangent);
        } else {
          candidate.motions.row(i) =
              group.lengths[i] * (to_tangent[b].row(tangent) * motion);
        }
      }
    }
    candidate.lengths = candidate.motions.colwise().norm();
    if (candidate.lengths.isZero(0.0)) continue;
    for (auto motion : candidate.motions.colwise()) motion.normalize();
    // A gauge that spans all motions of the group, such as rigid motion in the
    // plane for three scalars, explains none of them.
    if (candidate.motions.cols() >= A_.cols() &&
        Basis(candidate).cols() == A_.cols()) {
      continue;
    }
    candidate.gauge = std::move(gauge);
    candidates_.push_back(std::move(candidate));
  }
}

const MatrixXd& GaugeMatcher::Basis(const Candidate& candidate) {
  if (candidate.basis.size() == 0) candidate.basis = Span(candidate.motions);
  return candidate.basis;
}

GaugeMatch GaugeMatcher::Best(double limit,
                              Index num_null,
                              Index num_wanted) const {
  GaugeMatch best;
  for (const Candidate& candidate : candidates_) {
    const MatrixXd& basis = Basis(candidate);
    const RightSvd svd = ComputeRightSvd(A_ * basis);
    const Index g = basis.cols();
    const Index unseen = (svd.s.array() <= limit).count();
    const Index by_chance = g + num_null - A_.cols();
    if (unseen < best.directions.cols() ||
        unseen <= std::max<Index>(by_chance, 0)) {
      continue;
    }
    GaugeMatch match = Match(candidate,
                             basis * svd.V.rightCols(unseen),
                             basis * svd.V.leftCols(g - unseen),
                             limit);
    if (unseen == best.directions.cols() && match.num_named <= best.num_named) {
      continue;
    }
    best = std::move(match);
    if (best.num_named >= num_wanted) break;
  }
  return best;
}

MatrixXd GaugeMatcher::LargestUnseenSpan(double limit) const {
  std::vector<const Candidate*> by_size;
  for (const Candidate& candidate : candidates_) by_size.push_back(&candidate);
  std::stable_sort(by_size.begin(),
                   by_size.end(),
                   [](const Candidate* a, const Candidate* b) {
                     return a->motions.cols() > b->motions.cols();
                   });
  MatrixXd span(A_.cols(), 0);
  for (const Candidate* candidate : by_size) {
    if (candidate->motions.cols() <= span.cols()) break;
    const MatrixXd& basis = Basis(*candidate);
    const RightSvd svd = ComputeRightSvd(A_ * basis);
    const Index unseen = (svd.s.array() <= limit).count();
    if (unseen > span.cols()) span = basis * svd.V.rightCols(unseen);
  }
  return span;
}

GaugeMatch GaugeMatcher::Match(const Candidate& candidate,
                               const MatrixXd& unseen,
                               const MatrixXd& seen,
                               double limit) const {
  GaugeMatch match;
  match.name = candidate.gauge.name;
  match.num_generators =
      static_cast<int>((candidate.lengths.array() > 0.0).count());
  // Coefficients of the generators whose motions are unseen.
  const MatrixXd C = ComputeRightSvd(seen.transpose() * candidate.motions)
                         .V.rightCols(candidate.motions.cols() - seen.cols());
  match.directions.resize(A_.cols(), unseen.cols());
  MatrixXd basis(A_.cols(), 0);  // of the directions
  for (const auto& [name, motion] : Named(candidate, C, limit)) {
    if (basis.cols() == unseen.cols() || !Extend(motion, &basis)) continue;
    match.directions.col(match.num_named++) = motion;
    match.generators.push_back(name);
  }
  const MatrixXd rest = OrthogonalRest(unseen, basis);
  match.directions.rightCols(rest.cols()) = rest;
  match.generators.resize(static_cast<std::size_t>(unseen.cols()));
  return match;
}

std::vector<GaugeMatcher::NamedMotion> GaugeMatcher::Named(
    const Candidate& candidate, const MatrixXd& C, double limit) const {
  // Coefficients of motions of length one, and of the generators.
  const VectorXd lengths =
      (candidate.lengths.array() > 0.0).select(candidate.lengths, 1.0);
  std::vector<Gauge::Combination> combinations;
  if (candidate.gauge.name_combinations) {
    combinations = candidate.gauge.name_combinations(
        component_, lengths.cwiseInverse().asDiagonal() * C);
  } else {
    for (Index g = 0; g < lengths.size(); ++g) {
      combinations.push_back(
          {candidate.gauge.generators[g], VectorXd::Unit(lengths.size(), g)});
    }
  }
  std::vector<NamedMotion> named;
  for (const auto& [name, coefficients] : combinations) {
    CHECK_EQ(coefficients.size(), lengths.size()) << candidate.gauge.name;
    const VectorXd c = lengths.cwiseProduct(coefficients).normalized();
    VectorXd motion = candidate.motions * c;
    if (!(motion.norm() > kIndependent)) continue;
    motion.normalize();
    if (!((A_ * motion).norm() <= limit)) continue;
    named.push_back({name, std::move(motion)});
  }
  return named;
}

std::string GaugeMatcher::NameOf(const MatrixXd& V) const {
  constexpr double kOutside = 0.05;
  for (const Candidate& candidate : candidates_) {
    const MatrixXd& basis = Basis(candidate);
    const MatrixXd inside = basis * (basis.transpose() * V);
    if (((V - inside).colwise().norm().array() <= kOutside).all()) {
      return candidate.gauge.name;
    }
  }
  return "";
}

}  // namespace invgrad
