#include "invgrad/internal/qr.h"

#include <lapacke.h>

#include <algorithm>
#include <utility>

#include "invgrad/core/lapack_sizes.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Calls routine(work, size), without LAPACKE's refusal of what is not finite.
template <typename Routine>
void WithWork(const Routine& routine) {
  double best_size = 0.0;
  CHECK_EQ(routine(&best_size, -1), 0);
  VectorXd work(static_cast<Index>(best_size));
  CHECK_EQ(routine(work.data(), LapackSize(work.size())), 0);
}

// Leaves R in the upper triangle, below it what Q is a product of.
VectorXd Decompose(MatrixXd* A) {
  VectorXd tau(std::min(A->rows(), A->cols()));
  WithWork([&](double* work, lapack_int size) {
    return LAPACKE_dgeqrf_work(LAPACK_COL_MAJOR,
                               LapackSize(A->rows()),
                               LapackSize(A->cols()),
                               A->data(),
                               LeadingDimension(*A),
                               tau.data(),
                               work,
                               size);
  });
  return tau;
}

// From what Decompose leaves.
void FormQ(const VectorXd& tau, MatrixXd* A) {
  A->conservativeResize(Eigen::NoChange, tau.size());
  WithWork([&](double* work, lapack_int size) {
    return LAPACKE_dorgqr_work(LAPACK_COL_MAJOR,
                               LapackSize(A->rows()),
                               LapackSize(A->cols()),
                               LapackSize(A->cols()),
                               A->data(),
                               LeadingDimension(*A),
                               tau.data(),
                               work,
                               size);
  });
}

}  // namespace

ThinQr::ThinQr(MatrixXd A) {
  const VectorXd tau = Decompose(&A);
  R = A.topRows(tau.size()).triangularView<Eigen::Upper>();
  FormQ(tau, &A);
  Q = std::move(A);
}

MatrixXd Orthonormalized(MatrixXd A) {
  const VectorXd tau = Decompose(&A);
  FormQ(tau, &A);
  return A;
}

}  // namespace invgrad
