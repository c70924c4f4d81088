#include "invgrad/output_layer/normal_equations.h"

#include <lapacke.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "invgrad/internal/blas.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The ridge with the lowest GCV. l: eigenvalues; explained: the parts of |D|^2
// that they explain without a ridge; rest: the other part.
double BestRidge(const ArrayXd& l,
                 const ArrayXd& explained,
                 double rest,
                 double num_equations,
                 double smallest) {
  double best = smallest;
  double lowest = std::numeric_limits<double>::infinity();
  const double largest = 4.0 * l.maxCoeff();
  for (double ridge = largest; ridge >= smallest; ridge /= 2.0) {
    const ArrayXd left = ridge / (l + ridge);
    const double freedom =
        num_equations - static_cast<double>(l.size()) + left.sum();
    const double residual = rest + (left.square() * explained).sum();
    const double gcv = residual / (freedom * freedom);
    if (!(freedom > 0.0) || !(gcv < lowest)) continue;
    lowest = gcv;
    best = ridge;
  }
  return best;
}

}  // namespace

NormalEquations::NormalEquations(int num_features, int num_targets)
    : G_(MatrixXd::Zero(num_features, num_features)),
      R_(MatrixXd::Zero(num_features, num_targets)) {
  CHECK_GT(num_features, 0);
  CHECK_GT(num_targets, 0);
}

void NormalEquations::Add(const MatrixXd& H, const MatrixXd& D) {
  CHECK_EQ(H.rows(), G_.cols());
  CHECK_EQ(D.rows(), R_.cols());
  CHECK_EQ(H.cols(), D.cols());
  Syrk(Op::kNone, 1.0, H, 1.0, G_);
  Gemm(Op::kNone, Op::kTranspose, 1.0, H, D, 1.0, R_);
  squared_norm_ += D.squaredNorm();
  num_equations_ += static_cast<double>(H.cols());
}

void NormalEquations::MoveOrigin(const MatrixXd& C) {
  CHECK_EQ(C.rows(), R_.rows());
  CHECK_EQ(C.cols(), R_.cols());
  const MatrixXd GC = G_.selfadjointView<Eigen::Lower>() * C;
  // |D + C^T H|^2.
  squared_norm_ += 2.0 * C.cwiseProduct(R_).sum() + C.cwiseProduct(GC).sum();
  R_ += GC;
}

bool NormalEquations::Solve(double least_ridge, Solution* solution) const {
  const Index p = G_.rows();
  solution->Z.setZero(p, R_.cols());
  solution->ridge = 0.0;
  solution->num_equations = num_equations_;
  solution->squared_norm = solution->squared_residual = squared_norm_;
  if (!std::isfinite(squared_norm_ + G_.trace()) || !R_.allFinite()) {
    return false;
  }
  MatrixXd V = G_;
  VectorXd l(p);
  const auto n = static_cast<lapack_int>(p);
  if (LAPACKE_dsyevd(LAPACK_COL_MAJOR, 'V', 'L', n, V.data(), n, l.data()) !=
      0) {
    return false;
  }
  const double zero = static_cast<double>(p) *
                      std::numeric_limits<double>::epsilon() * l[p - 1];
  const Index rank = (l.array() > zero).count();
  if (rank == 0) return true;
  MatrixXd projected(rank, R_.cols());
  Gemm(Op::kTranspose, Op::kNone, 1.0, V.rightCols(rank), R_, 0.0, projected);
  const ArrayXd resolved = l.tail(rank);
  const ArrayXd explained =
      projected.rowwise().squaredNorm().array() / resolved;
  const double rest = std::max(0.0, squared_norm_ - explained.sum());
  solution->ridge = BestRidge(resolved,
                              explained,
                              rest,
                              num_equations_,
                              std::max(zero, least_ridge * l[p - 1]));
  const ArrayXd shifted = resolved + solution->ridge;
  projected = shifted.inverse().matrix().asDiagonal() * projected;
  Gemm(Op::kNone,
       Op::kNone,
       1.0,
       V.rightCols(rank),
       projected,
       0.0,
       solution->Z);
  const ArrayXd left = solution->ridge / shifted;
  solution->squared_residual = rest + (left.square() * explained).sum();
  return true;
}

}  // namespace invgrad
