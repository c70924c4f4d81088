#include "invgrad/rank/gauge_match.h"

#include <algorithm>
#include <utility>

#include "Eigen/QR"
#include "invgrad/core/small_svd.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// An SVD of a tall matrix by its R: s descending and V, of as many columns.
SmallSvd TallSvd(const MatrixXd& X) {
  SmallSvd svd;
  if (X.rows() > X.cols()) {
    const Eigen::HouseholderQR<MatrixXd> qr(X);
    svd.Compute(qr.matrixQR()
                    .topRows(X.cols())
                    .triangularView<Eigen::Upper>()
                    .toDenseMatrix());
  } else {
    MatrixXd padded = MatrixXd::Zero(X.cols(), X.cols());
    padded.topRows(X.rows()) = X;
    svd.Compute(padded);
  }
  return svd;
}

// Columns are taken for dependent below this share of the largest.
constexpr double kIndependent = 1e-9;

// An orthonormal basis of the span of the columns, which have length one.
MatrixXd Span(const MatrixXd& X) {
  const SmallSvd svd = TallSvd(X);
  const Index rank = (svd.s.array() > kIndependent * svd.s[0]).count();
  MatrixXd basis = X * svd.V.leftCols(rank);
  // Once more for directions in which X is nearly dependent.
  const Eigen::HouseholderQR<MatrixXd> qr(basis);
  return qr.householderQ() * MatrixXd::Identity(X.rows(), rank);
}

// From an ambient motion to the closest tangent one: P^+.
std::vector<MatrixXd> PseudoInverses(const GaugeComponent& component) {
  std::vector<MatrixXd> result;
  for (const GaugeBlock& block : component.blocks) {
    if (block.is_constant) {
      result.push_back(MatrixXd(0, block.size));
    } else if (block.manifold == nullptr) {
      result.push_back(MatrixXd());  // the identity
    } else {
      RowMajorMatrix P(block.size, block.manifold->TangentSize());
      if (P.cols() == 0 ||
          !block.manifold->PlusJacobian(block.values, P.data())) {
        result.push_back(MatrixXd::Zero(P.cols(), P.rows()));
        continue;
      }
      const Eigen::CompleteOrthogonalDecomposition<MatrixXd> decomposition(P);
      result.push_back(decomposition.pseudoInverse());
    }
  }
  return result;
}

}  // namespace

GaugeMatcher::GaugeMatcher(const GaugeComponent& component,
                           const Eigen::SparseMatrix<double>& A,
                           const VectorXd& scale,
                           const std::vector<int>& column_of,
                           const std::vector<Gauge>& gauges)
    : A_(A) {
  const std::vector<MatrixXd> inverses = PseudoInverses(component);
  for (const Gauge& gauge : gauges) {
    MatrixXd ambient = MatrixXd::Zero(
        component.ambient_size, static_cast<Index>(gauge.generators.size()));
    if (!gauge.motions(component, &ambient) || !ambient.allFinite()) continue;
    MatrixXd motions = MatrixXd::Zero(A.cols(), ambient.cols());
    Index row = 0;
    for (std::size_t b = 0; b < component.blocks.size(); ++b) {
      const GaugeBlock& block = component.blocks[b];
      if (block.is_constant) continue;
      MatrixXd tangent = ambient.middleRows(block.offset, block.size);
      if (block.manifold != nullptr) tangent = (inverses[b] * tangent).eval();
      for (Index i = 0; i < tangent.rows(); ++i, ++row) {
        if (column_of[row] < 0) continue;
        motions.row(column_of[row]) = scale[row] * tangent.row(i);
      }
    }
    Candidate candidate;
    candidate.name = gauge.name;
    for (Index g = 0; g < motions.cols(); ++g) {
      const double norm = motions.col(g).norm();
      if (norm == 0.0) continue;
      const auto next = static_cast<Index>(candidate.generators.size());
      motions.col(next) = motions.col(g) / norm;
      candidate.generators.push_back(gauge.generators[g]);
    }
    if (candidate.generators.empty()) continue;
    candidate.motions =
        motions.leftCols(static_cast<Index>(candidate.generators.size()));
    candidate.basis = Span(candidate.motions);
    candidates_.push_back(std::move(candidate));
  }
}

GaugeMatch GaugeMatcher::Best(double limit, int num_directions) const {
  GaugeMatch best;
  for (const Candidate& candidate : candidates_) {
    const SmallSvd svd = TallSvd(A_ * candidate.basis);
    const Index unseen = (svd.s.array() <= limit).count();
    if (unseen <= best.directions.cols()) continue;
    best.name = candidate.name;
    best.num_generators = static_cast<int>(candidate.generators.size());
    best.directions = candidate.basis * svd.V.rightCols(unseen);
    best.generators.assign(static_cast<std::size_t>(unseen), "");
    // By name if enough independent generators are unseen as they are.
    std::vector<Index> alone;
    for (Index g = 0; g < candidate.motions.cols(); ++g) {
      if ((A_ * candidate.motions.col(g)).norm() <= limit) alone.push_back(g);
    }
    if (static_cast<Index>(alone.size()) == unseen) {
      MatrixXd motions(A_.cols(), unseen);
      for (Index i = 0; i < unseen; ++i) {
        motions.col(i) = candidate.motions.col(alone[i]);
      }
      if (Span(motions).cols() == unseen) {
        best.directions = motions;
        for (Index i = 0; i < unseen; ++i) {
          best.generators[i] = candidate.generators[alone[i]];
        }
      }
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
