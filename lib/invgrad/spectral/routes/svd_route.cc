// Computes the step from LAPACK's SVD of the dense J; the singular vectors are
// only applied to g. A = J^T or J has at least as many rows as columns:
//
//   A = W S Z^T
//
// If A is much taller than wide, a QR factorization precedes the SVD (A = Q R,
// R = W' S Z^T, W = Q W'), and Q is only applied to vectors [1].
//
// [1] Chan. An improved algorithm for computing the singular value
//     decomposition. ACM TOMS 8 (1982).
#include <lapacke.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "invgrad/core/blas.h"
#include "invgrad/core/finite.h"
#include "invgrad/internal/logging.h"
#include "invgrad/spectral/routes/spectral_routes.h"
#include "invgrad/spectral/step_error.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Whether a QR factorization comes first. From this ratio on, dgesdd does the
// same but also forms Q.
bool IsReduced(const MatrixXd& A) { return 6 * A.rows() >= 11 * A.cols(); }

// Replaces svd->A by the reflectors of Q, if it is reduced. False if LAPACK does
// not converge.
bool Factorize(SvdBuffers* svd) {
  MatrixXd& A = svd->A;
  const int p = static_cast<int>(A.rows());
  const int q = static_cast<int>(A.cols());
  MatrixXd& B = IsReduced(A) ? svd->R : A;
  if (IsReduced(A)) {
    svd->tau.resize(q);
    if (LAPACKE_dgeqrf(LAPACK_COL_MAJOR, p, q, A.data(), p, svd->tau.data()) !=
        0) {
      return false;
    }
    B.setZero(q, q);
    B.triangularView<Eigen::Upper>() = A.topRows(q);
  }
  const int rows = static_cast<int>(B.rows());
  svd->s.resize(q);
  svd->left.resize(rows, q);
  svd->right_t.resize(q, q);
  svd->copy = B;
  double* s = svd->s.data();
  double* left = svd->left.data();
  double* right_t = svd->right_t.data();
  if (LAPACKE_dgesdd(LAPACK_COL_MAJOR,
                     'S',
                     rows,
                     q,
                     B.data(),
                     rows,
                     s,
                     left,
                     rows,
                     right_t,
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
                        svd->copy.data(),
                        rows,
                        s,
                        left,
                        rows,
                        right_t,
                        q,
                        superdiagonal.data()) == 0;
}

// *x = Q x or Q^T x, if A is reduced.
void ApplyQ(const SvdBuffers& svd, char transpose, VectorXd* x) {
  if (!IsReduced(svd.A)) return;
  const int p = static_cast<int>(svd.A.rows());
  CHECK_EQ(LAPACKE_dormqr(LAPACK_COL_MAJOR,
                          'L',
                          transpose,
                          p,
                          1,
                          static_cast<int>(svd.A.cols()),
                          svd.A.data(),
                          p,
                          svd.tau.data(),
                          x->data(),
                          p),
           0);
}

}  // namespace

bool SvdRoute(const SpectralProblem& problem) {
  VectorXd* d = problem.d;
  std::string* message = &problem.summary->message;
  const Index m = problem.m();
  const Index n = problem.n();
  // 3 k^2 + 7 k numbers of workspace, counted by LAPACK in 32 bits.
  constexpr Index kLargest = 26750;
  if (std::min(m, n) > kLargest) {
    *message =
        "J has more than 26750 rows and columns: too many for LAPACK's SVD";
    return false;
  }
  if (!CheckJacobianFinite(problem.J, message)) return false;
  SvdBuffers& svd = problem.buffers->svd;
  const bool wide = n > m;
  if (wide) {
    problem.J.ToDense(&svd.J);
    svd.A = svd.J.transpose();
  } else {
    problem.J.ToDense(&svd.A);
  }
  if (!Factorize(&svd)) {
    *message = "the SVD of J did not converge: dgesdd and dgesvd failed";
    return false;
  }
  const double s_max = svd.s[0];
  if (s_max == 0.0) {
    d->setZero(n);
    return true;
  }
  // c = U^T g. If wide: J = Z S W^T, else W S Z^T.
  VectorXd c(svd.s.size());
  if (wide) {
    Gemv(Op::kNone, 1.0, svd.right_t, problem.g, 0.0, c);
  } else {
    VectorXd rotated = problem.g;
    ApplyQ(svd, 'T', &rotated);
    Gemv(Op::kTranspose, 1.0, svd.left, rotated.head(svd.left.rows()), 0.0, c);
  }
  if (problem.measures_spectrum) {
    SetSpectrum(problem, svd.s.cwiseAbs2(), c.cwiseAbs2());
  }
  VectorXd filtered(c.size());
  for (Index i = 0; i < c.size(); ++i) {
    filtered[i] = problem.filter(svd.s[i], s_max) * c[i];
  }
  d->setZero(n);
  if (wide) {
    Gemv(Op::kNone, 1.0, svd.left, filtered, 0.0, d->head(svd.left.rows()));
    ApplyQ(svd, 'N', d);
  } else {
    Gemv(Op::kTranspose, 1.0, svd.right_t, filtered, 0.0, *d);
  }
  const double resolution = 2.0 * std::numeric_limits<double>::epsilon() *
                            std::sqrt(static_cast<double>(m + n));
  SummarizeSpectrum(problem, svd.s, s_max, 1, resolution);
  // The component of g outside the span of U.
  const double outside =
      m > n
          ? std::sqrt(std::max(0.0, problem.g.squaredNorm() - c.squaredNorm()))
          : 0.0;
  problem.summary->estimated_error =
      SvdStepError(problem.filter, svd.s, s_max, c, outside, wide);
  return CheckFinite("the step", *d, message);
}

}  // namespace invgrad
