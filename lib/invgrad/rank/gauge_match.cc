#include "invgrad/rank/gauge_match.h"

#include <utility>

#include "invgrad/rank/decompositions.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

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

GaugeMatcher::GaugeMatcher(const GaugeComponent& component,
                           const Eigen::SparseMatrix<double>& A,
                           const VectorXd& scale,
                           const std::vector<Gauge>& gauges)
    : A_(A) {
  std::vector<MatrixXd> to_tangent;  // of each block; empty: the identity
  for (const GaugeBlock& block : component.blocks) {
    to_tangent.push_back(block.is_constant || block.manifold == nullptr
                             ? MatrixXd()
                             : PseudoInversePlusJacobian(block));
  }
  for (const Gauge& gauge : gauges) {
    MatrixXd ambient = MatrixXd::Zero(
        component.ambient_size, static_cast<Index>(gauge.generators.size()));
    if (!gauge.motions(component, &ambient) || !ambient.allFinite()) continue;
    MatrixXd motions(A.cols(), ambient.cols());
    Index next_scale = 0;
    Index next_column = 0;
    for (std::size_t b = 0; b < component.blocks.size(); ++b) {
      const GaugeBlock& block = component.blocks[b];
      if (block.is_constant) continue;
      MatrixXd tangent = ambient.middleRows(block.offset, block.size);
      if (block.manifold != nullptr) tangent = (to_tangent[b] * tangent).eval();
      for (Index i = 0; i < tangent.rows(); ++i, ++next_scale) {
        if (scale[next_scale] == 0.0) continue;
        motions.row(next_column++) = scale[next_scale] * tangent.row(i);
      }
    }
    Candidate candidate;
    candidate.name = gauge.name;
    candidate.motions.resize(A.cols(), 0);
    for (Index g = 0; g < motions.cols(); ++g) {
      const double norm = motions.col(g).norm();
      if (norm == 0.0) continue;
      candidate.motions.conservativeResize(Eigen::NoChange,
                                           candidate.motions.cols() + 1);
      candidate.motions.rightCols(1) = motions.col(g) / norm;
      candidate.generators.push_back(gauge.generators[g]);
    }
    if (candidate.generators.empty()) continue;
    candidate.basis = Span(candidate.motions);
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
    MatrixXd motions(A_.cols(), 0);
    std::vector<std::string> names;
    for (Index g = 0; g < candidate.motions.cols(); ++g) {
      if ((A_ * candidate.motions.col(g)).norm() > limit) continue;
      motions.conservativeResize(Eigen::NoChange, motions.cols() + 1);
      motions.rightCols(1) = candidate.motions.col(g);
      names.push_back(candidate.generators[g]);
    }
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
