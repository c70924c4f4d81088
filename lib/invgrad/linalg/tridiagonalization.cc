#include "invgrad/linalg/tridiagonalization.h"

#include <lapacke.h>

#include <algorithm>

#include "glog/logging.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// The block size of LAPACK's blocked algorithms.
constexpr int kBlock = 64;

}  // namespace

void Tridiagonalization::Compute(MatrixXd* K, Method /*method*/) {
  CHECK_EQ(K->rows(), K->cols());
  const int m = static_cast<int>(K->rows());
  K_ = K;
  diagonal_.resize(m);
  off_diagonal_.resize(std::max(0, m - 1));
  tau_.resize(std::max(0, m - 1));
  if (work_.size() < kBlock * m) work_.resize(kBlock * m);
  if (m == 0) return;
  const int info = LAPACKE_dsytrd_work(LAPACK_COL_MAJOR,
                                       'L',
                                       m,
                                       K->data(),
                                       m,
                                       diagonal_.data(),
                                       off_diagonal_.data(),
                                       tau_.data(),
                                       work_.data(),
                                       static_cast<int>(work_.size()));
  CHECK_EQ(info, 0);
}

namespace {

void ApplyReflectors(char transpose,
                     const MatrixXd& K,
                     const VectorXd& tau,
                     double* X,
                     int rows,
                     int cols,
                     VectorXd* work) {
  CHECK_EQ(rows, K.rows());
  // LAPACK keeps the triangular factors of the blocks in the workspace too.
  const int size = kBlock * std::max(1, cols) + (kBlock + 1) * kBlock;
  if (work->size() < size) work->resize(size);
  if (rows < 2) return;
  const int info = LAPACKE_dormtr_work(LAPACK_COL_MAJOR,
                                       'L',
                                       'L',
                                       transpose,
                                       rows,
                                       cols,
                                       K.data(),
                                       rows,
                                       tau.data(),
                                       X,
                                       rows,
                                       work->data(),
                                       static_cast<int>(work->size()));
  CHECK_EQ(info, 0);
}

}  // namespace

void Tridiagonalization::ApplyQTranspose(VectorXd* x) const {
  ApplyReflectors(
      'T', *K_, tau_, x->data(), static_cast<int>(x->size()), 1, &work_);
}

void Tridiagonalization::ApplyQ(VectorXd* x) const {
  ApplyReflectors(
      'N', *K_, tau_, x->data(), static_cast<int>(x->size()), 1, &work_);
}

void Tridiagonalization::ApplyQ(MatrixXd* X) const {
  ApplyReflectors('N',
                  *K_,
                  tau_,
                  X->data(),
                  static_cast<int>(X->rows()),
                  static_cast<int>(X->cols()),
                  &work_);
}

int64_t Tridiagonalization::Bytes(int m, Method /*method*/) {
  return static_cast<int64_t>(sizeof(double)) * (3 + kBlock) * m;
}

}  // namespace invgrad
