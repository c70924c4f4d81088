#include "invgrad/spectral/routes/tall_svd.h"

#include <lapacke.h>

#include "glog/logging.h"
#include "invgrad/core/blas.h"

namespace invgrad {

using Eigen::MatrixXd;
using Eigen::VectorXd;

bool TallSvd::Compute(MatrixXd* A) {
  const int p = static_cast<int>(A->rows());
  const int q = static_cast<int>(A->cols());
  CHECK_GE(p, q);
  CHECK_GT(q, 0);
  A_ = A;
  // From this ratio on, dgesdd does the same but also forms Q.
  is_reduced_ = 6 * p >= 11 * q;
  if (is_reduced_) {
    tau_.resize(q);
    if (LAPACKE_dgeqrf(LAPACK_COL_MAJOR, p, q, A->data(), p, tau_.data()) !=
        0) {
      return false;
    }
    R_.setZero(q, q);
    R_.triangularView<Eigen::Upper>() = A->topRows(q);
  }
  MatrixXd& B = is_reduced_ ? R_ : *A;
  const int rows = static_cast<int>(B.rows());
  s_.resize(q);
  left_.resize(rows, q);
  right_t_.resize(q, q);
  copy_ = B;
  if (LAPACKE_dgesdd(LAPACK_COL_MAJOR,
                     'S',
                     rows,
                     q,
                     B.data(),
                     rows,
                     s_.data(),
                     left_.data(),
                     rows,
                     right_t_.data(),
                     q) == 0) {
    return true;
  }
  // Divide and conquer can fail for a finite matrix: OpenBLAS' Prescott kernels
  // round so that one of 433 x 256, on which the others converge, makes it give
  // up. QR iterations are slower and do not.
  VectorXd superdiagonal(q);
  return LAPACKE_dgesvd(LAPACK_COL_MAJOR,
                        'S',
                        'S',
                        rows,
                        q,
                        copy_.data(),
                        rows,
                        s_.data(),
                        left_.data(),
                        rows,
                        right_t_.data(),
                        q,
                        superdiagonal.data()) == 0;
}

void TallSvd::ApplyQ(char transpose, VectorXd* x) const {
  const int p = static_cast<int>(A_->rows());
  CHECK_EQ(LAPACKE_dormqr(LAPACK_COL_MAJOR,
                          'L',
                          transpose,
                          p,
                          1,
                          static_cast<int>(A_->cols()),
                          A_->data(),
                          p,
                          tau_.data(),
                          x->data(),
                          p),
           0);
}

void TallSvd::LeftTransposeTimes(const VectorXd& x, VectorXd* y) const {
  VectorXd rotated = x;
  if (is_reduced_) ApplyQ('T', &rotated);
  y->resize(left_.cols());
  Gemv(Op::kTranspose, 1.0, left_, rotated.head(left_.rows()), 0.0, *y);
}

void TallSvd::LeftTimes(const VectorXd& x, VectorXd* y) const {
  y->setZero(A_->rows());
  Gemv(Op::kNone, 1.0, left_, x, 0.0, y->head(left_.rows()));
  if (is_reduced_) ApplyQ('N', y);
}

void TallSvd::RightTransposeTimes(const VectorXd& x, VectorXd* y) const {
  y->resize(right_t_.rows());
  Gemv(Op::kNone, 1.0, right_t_, x, 0.0, *y);
}

void TallSvd::RightTimes(const VectorXd& x, VectorXd* y) const {
  y->resize(right_t_.cols());
  Gemv(Op::kTranspose, 1.0, right_t_, x, 0.0, *y);
}

}  // namespace invgrad
