#include "invgrad/rank/decompositions.h"

#include <lapacke.h>

#include <algorithm>
#include <limits>

#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

lapack_int Int(Index size) { return static_cast<lapack_int>(size); }
lapack_int LeadingDimension(const MatrixXd& A) {
  return Int(std::max<Index>(A.rows(), 1));
}

VectorXd QrInPlace(MatrixXd* A) {
  VectorXd tau(std::min(A->rows(), A->cols()));
  CHECK_EQ(LAPACKE_dgeqrf(LAPACK_COL_MAJOR,
                          Int(A->rows()),
                          Int(A->cols()),
                          A->data(),
                          LeadingDimension(*A),
                          tau.data()),
           0);
  return tau;
}

// Replaces A by its R if A is much taller than wide: s and V are the same.
void ReduceTall(MatrixXd* A) {
  const Index n = A->cols();
  if (A->rows() < n + n / 4) return;
  QrInPlace(A);
  A->conservativeResize(n, n);
  A->triangularView<Eigen::StrictlyLower>().setZero();
}

// Overwrites A. VT is null or n x n, and then m >= n.
VectorXd Svd(MatrixXd* A, MatrixXd* VT) {
  VectorXd s(std::min(A->rows(), A->cols()));
  double unused = 0.0;
  const lapack_int info =
      LAPACKE_dgesdd(LAPACK_COL_MAJOR,
                     VT != nullptr ? 'O' : 'N',  // U overwrites A
                     Int(A->rows()),
                     Int(A->cols()),
                     A->data(),
                     LeadingDimension(*A),
                     s.data(),
                     &unused,
                     VT != nullptr ? LeadingDimension(*A) : 1,
                     VT != nullptr ? VT->data() : &unused,
                     VT != nullptr ? LeadingDimension(*VT) : 1);
  if (info != 0) {
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    s.setConstant(kNan);
    if (VT != nullptr) VT->setConstant(kNan);
  }
  return s;
}

}  // namespace

RightSvd ComputeRightSvd(MatrixXd A) {
  const Index m = A.rows();
  const Index n = A.cols();
  if (m < n) {
    A.conservativeResize(n, n);
    A.bottomRows(n - m).setZero();
  }
  ReduceTall(&A);
  RightSvd result;
  MatrixXd VT(n, n);
  result.s = Svd(&A, &VT);
  result.V = VT.transpose();
  return result;
}

VectorXd SingularValues(MatrixXd A) {
  ReduceTall(&A);
  return Svd(&A, nullptr);
}

MatrixXd Orthonormalized(MatrixXd X) {
  CHECK_GE(X.rows(), X.cols());
  const VectorXd tau = QrInPlace(&X);
  CHECK_EQ(LAPACKE_dorgqr(LAPACK_COL_MAJOR,
                          Int(X.rows()),
                          Int(X.cols()),
                          Int(X.cols()),
                          X.data(),
                          LeadingDimension(X),
                          tau.data()),
           0);
  return X;
}

bool Extend(const VectorXd& v, MatrixXd* Q) {
  VectorXd new_part = v;
  for (int pass = 0; pass < 2; ++pass) {
    new_part -= *Q * (Q->transpose() * new_part);
  }
  constexpr double kNew = 1e-4;
  if (!(new_part.norm() > kNew)) return false;
  Q->conservativeResize(Eigen::NoChange, Q->cols() + 1);
  Q->rightCols<1>() = new_part.normalized();
  return true;
}

std::vector<int> PivotOrder(MatrixXd A) {
  std::vector<lapack_int> order(static_cast<std::size_t>(A.cols()), 0);
  VectorXd tau(std::min(A.rows(), A.cols()));
  CHECK_EQ(LAPACKE_dgeqp3(LAPACK_COL_MAJOR,
                          Int(A.rows()),
                          Int(A.cols()),
                          A.data(),
                          LeadingDimension(A),
                          order.data(),
                          tau.data()),
           0);
  for (lapack_int& column : order) --column;  // LAPACK counts from 1
  return {order.begin(), order.end()};
}

}  // namespace invgrad
