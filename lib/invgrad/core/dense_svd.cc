#include "invgrad/core/dense_svd.h"

#include <lapacke.h>

#include <algorithm>
#include <limits>

#include "invgrad/core/lapack_sizes.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// From 11 / 6 on, dgesdd does the same but also forms Q.
bool IsTall(const MatrixXd& A) { return 6 * A.rows() >= 11 * A.cols(); }

// Replaces A by its reflectors and sets R. False if A or R is not finite.
bool Factorize(MatrixXd* A, VectorXd* tau, MatrixXd* R) {
  const Index n = A->cols();
  tau->resize(n);
  if (LAPACKE_dgeqrf(LAPACK_COL_MAJOR,
                     LapackSize(A->rows()),
                     LapackSize(n),
                     A->data(),
                     LeadingDimension(*A),
                     tau->data()) != 0) {
    return false;
  }
  R->setZero(n, n);
  R->triangularView<Eigen::Upper>() = A->topRows(n);
  return R->allFinite();
}

}  // namespace

bool DenseSvd::Compute() {
  if (!A_.allFinite()) return false;
  if (!IsTall(A_) || A_.cols() == 0) {
    tau_.resize(0);
  } else if (!Factorize(&A_, &tau_, &R_)) {
    return false;
  }
  MatrixXd& B = is_reduced() ? R_ : A_;
  const Index k = std::min(B.rows(), B.cols());
  s_.resize(k);
  W_.resize(B.rows(), k);
  Vt_.resize(k, B.cols());
  copy_ = B;
  const lapack_int rows = LapackSize(B.rows());
  const lapack_int cols = LapackSize(B.cols());
  if (LAPACKE_dgesdd(LAPACK_COL_MAJOR,
                     'S',
                     rows,
                     cols,
                     B.data(),
                     LeadingDimension(B),
                     s_.data(),
                     W_.data(),
                     LeadingDimension(W_),
                     Vt_.data(),
                     LeadingDimension(Vt_)) == 0) {
    return s_.allFinite();
  }
  // Divide and conquer can fail for a finite matrix: OpenBLAS' Prescott kernels
  // round so that one of 433 x 256, on which the others converge, makes it give
  // up. QR iterations are slower and do not.
  VectorXd superdiagonal(k);
  return LAPACKE_dgesvd(LAPACK_COL_MAJOR,
                        'S',
                        'S',
                        rows,
                        cols,
                        copy_.data(),
                        LeadingDimension(copy_),
                        s_.data(),
                        W_.data(),
                        LeadingDimension(W_),
                        Vt_.data(),
                        LeadingDimension(Vt_),
                        superdiagonal.data()) == 0 &&
         s_.allFinite();
}

MatrixXd DenseSvd::U() const {
  if (!is_reduced()) return W_;
  MatrixXd U = MatrixXd::Zero(A_.rows(), s_.size());
  U.topRows(s_.size()) = W_;
  ApplyQ(false, U);
  return U;
}

MatrixXd DenseSvd::UTransposeTimes(MatrixXd D) const {
  ApplyQ(true, D);
  return W_.transpose() * D.topRows(W_.rows());
}

void DenseSvd::ApplyQ(bool transpose, Eigen::Ref<MatrixXd> X) const {
  CHECK_EQ(X.rows(), A_.rows());
  if (!is_reduced() || X.cols() == 0) return;
  CHECK_EQ(LAPACKE_dormqr(LAPACK_COL_MAJOR,
                          'L',
                          transpose ? 'T' : 'N',
                          LapackSize(X.rows()),
                          LapackSize(X.cols()),
                          LapackSize(tau_.size()),
                          A_.data(),
                          LapackSize(A_.rows()),
                          tau_.data(),
                          X.data(),
                          LapackSize(X.outerStride())),
           0);
}

VectorXd SingularValues(MatrixXd A) {
  VectorXd s(std::min(A.rows(), A.cols()));
  VectorXd tau;
  MatrixXd R;
  const bool is_tall = IsTall(A);
  MatrixXd& B = is_tall ? R : A;
  double unused = 0.0;
  if (!A.allFinite() || (is_tall && !Factorize(&A, &tau, &R)) ||
      LAPACKE_dgesdd(LAPACK_COL_MAJOR,
                     'N',
                     LapackSize(B.rows()),
                     LapackSize(B.cols()),
                     B.data(),
                     LeadingDimension(B),
                     s.data(),
                     &unused,
                     1,
                     &unused,
                     1) != 0 ||
      !s.allFinite()) {
    s.setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  return s;
}

}  // namespace invgrad
