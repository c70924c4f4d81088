#include "invgrad/spectral/routes/tall_svd.h"

#include <lapacke.h>

#include <algorithm>

#include "glog/logging.h"
#include "invgrad/core/blas.h"

namespace invgrad {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// LAPACK's answer to a workspace query.
int QueriedSize(double answer) { return static_cast<int>(answer); }

void GrowTo(size_t size, std::vector<double>* buffer) {
  if (buffer->size() < size) buffer->resize(size);
}

}  // namespace

bool TallSvd::Compute(std::string* error) {
  MatrixXd& A = workspace_.dense;
  const int p = static_cast<int>(A.rows());
  const int q = static_cast<int>(A.cols());
  CHECK_GE(p, q);
  CHECK_GT(q, 0);
  // Where LAPACK's own SVD would do the same, but form Q.
  is_reduced_ = 6 * p >= 11 * q;
  double query = 0.0;
  if (is_reduced_) {
    workspace_.reflector_scales.resize(q);
    LAPACKE_dgeqrf_work(
        LAPACK_COL_MAJOR, p, q, A.data(), p, nullptr, &query, -1);
    GrowTo(QueriedSize(query), &workspace_.lapack_numbers);
    LAPACKE_dgeqrf_work(LAPACK_COL_MAJOR,
                        p,
                        q,
                        A.data(),
                        p,
                        workspace_.reflector_scales.data(),
                        workspace_.lapack_numbers.data(),
                        static_cast<int>(workspace_.lapack_numbers.size()));
    workspace_.triangle.setZero(q, q);
    workspace_.triangle.triangularView<Eigen::Upper>() = A.topRows(q);
  }
  MatrixXd& B = is_reduced_ ? workspace_.triangle : A;
  const int rows = static_cast<int>(B.rows());
  workspace_.values.resize(q);
  workspace_.left.resize(rows, q);
  workspace_.right.resize(q, q);
  const size_t num_integers = 8 * workspace_.right.rows();
  if (workspace_.lapack_integers.size() < num_integers) {
    workspace_.lapack_integers.resize(num_integers);
  }
  const auto dgesdd = [&](double* work, int size) {
    return LAPACKE_dgesdd_work(LAPACK_COL_MAJOR,
                               'S',
                               rows,
                               q,
                               B.data(),
                               rows,
                               workspace_.values.data(),
                               workspace_.left.data(),
                               rows,
                               workspace_.right.data(),
                               q,
                               work,
                               size,
                               workspace_.lapack_integers.data());
  };
  dgesdd(&query, -1);
  GrowTo(QueriedSize(query), &workspace_.lapack_numbers);
  if (dgesdd(workspace_.lapack_numbers.data(),
             static_cast<int>(workspace_.lapack_numbers.size())) == 0) {
    return true;
  }
  *error = "the SVD of J (dgesdd) did not converge";
  return false;
}

void TallSvd::ApplyReflectors(char transpose, VectorXd* x) const {
  const MatrixXd& A = workspace_.dense;
  const int p = static_cast<int>(A.rows());
  const int q = static_cast<int>(A.cols());
  GrowTo(1, &workspace_.lapack_numbers);
  LAPACKE_dormqr_work(LAPACK_COL_MAJOR,
                      'L',
                      transpose,
                      p,
                      1,
                      q,
                      A.data(),
                      p,
                      workspace_.reflector_scales.data(),
                      x->data(),
                      p,
                      workspace_.lapack_numbers.data(),
                      static_cast<int>(workspace_.lapack_numbers.size()));
}

void TallSvd::LeftTransposeTimes(const VectorXd& x, VectorXd* y) const {
  y->resize(workspace_.left.cols());
  if (!is_reduced_) {
    Gemv(Op::kTranspose, 1.0, workspace_.left, x, 0.0, *y);
    return;
  }
  VectorXd& rotated = workspace_.product;
  rotated = x;
  ApplyReflectors('T', &rotated);
  Gemv(Op::kTranspose,
       1.0,
       workspace_.left,
       rotated.head(workspace_.left.rows()),
       0.0,
       *y);
}

void TallSvd::LeftTimes(const VectorXd& x, VectorXd* y) const {
  y->setZero(workspace_.dense.rows());
  Gemv(
      Op::kNone, 1.0, workspace_.left, x, 0.0, y->head(workspace_.left.rows()));
  if (is_reduced_) ApplyReflectors('N', y);
}

// LAPACK returns Z^T.
void TallSvd::RightTransposeTimes(const VectorXd& x, VectorXd* y) const {
  y->resize(workspace_.right.rows());
  Gemv(Op::kNone, 1.0, workspace_.right, x, 0.0, *y);
}

void TallSvd::RightTimes(const VectorXd& x, VectorXd* y) const {
  y->resize(workspace_.right.cols());
  Gemv(Op::kTranspose, 1.0, workspace_.right, x, 0.0, *y);
}

}  // namespace invgrad
