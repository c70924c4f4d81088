// Computes the step from LAPACK's SVD of the dense J (core/dense_svd.h); the
// singular vectors are only applied to g. A = J^T or J has at least as many rows
// as columns:
//
//   A = U diag(s) Z^T,   U = Q W
#include <algorithm>
#include <cmath>
#include <limits>

#include "invgrad/core/finite.h"
#include "invgrad/internal/blas.h"
#include "invgrad/internal/logging.h"
#include "invgrad/spectral/routes/spectral_routes.h"
#include "invgrad/spectral/step_error.h"

namespace invgrad {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

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
  DenseSvd& svd = problem.buffers->svd;
  const bool wide = n > m;
  if (wide) {
    problem.J.ToDense(&problem.buffers->dense);
    *svd.mutable_matrix() = problem.buffers->dense.transpose();
  } else {
    problem.J.ToDense(svd.mutable_matrix());
  }
  if (!svd.Compute()) {
    *message =
        "the SVD of J overflows, or did not converge (dgesdd and dgesvd)";
    return false;
  }
  const VectorXd& s = svd.s();
  const double s_max = s[0];
  if (s_max == 0.0) {
    d->setZero(n);
    return true;
  }
  // g in J's left singular vectors: if wide, J = Z diag(s) U^T.
  const MatrixXd& W = svd.W();
  VectorXd c(s.size());
  if (wide) {
    Gemv(Op::kNone, 1.0, svd.Vt(), problem.g, 0.0, c);
  } else {
    VectorXd rotated = problem.g;
    svd.ApplyQ(true, rotated);
    Gemv(Op::kTranspose, 1.0, W, rotated.head(W.rows()), 0.0, c);
  }
  VectorXd filtered(c.size());
  for (Index i = 0; i < c.size(); ++i) {
    filtered[i] = problem.filter(s[i], s_max) * c[i];
  }
  d->setZero(n);
  if (wide) {
    Gemv(Op::kNone, 1.0, W, filtered, 0.0, d->head(W.rows()));
    // ApplyQ needs finite numbers.
    if (!CheckFinite("the step", *d, message)) return false;
    svd.ApplyQ(false, *d);
  } else {
    Gemv(Op::kTranspose, 1.0, svd.Vt(), filtered, 0.0, *d);
  }
  const double resolution = 2.0 * std::numeric_limits<double>::epsilon() *
                            std::sqrt(static_cast<double>(m + n));
  SummarizeSpectrum(problem, s, s_max, 1, resolution);
  // The component of g outside the span of U.
  const double outside =
      m > n
          ? std::sqrt(std::max(0.0, problem.g.squaredNorm() - c.squaredNorm()))
          : 0.0;
  problem.summary->estimated_error =
      SvdStepError(problem.filter, s, s_max, c, outside, wide);
  return CheckFinite("the step", *d, message);
}

}  // namespace invgrad
