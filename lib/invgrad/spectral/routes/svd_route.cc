// Computes the step from LAPACK's SVD of the dense J; the singular vectors are
// only applied to g.
#include <algorithm>
#include <cmath>
#include <limits>

#include "invgrad/core/finite.h"
#include "invgrad/spectral/routes/spectral_buffers.h"
#include "invgrad/spectral/routes/spectral_routes.h"
#include "invgrad/spectral/step_error.h"

namespace invgrad {

using Eigen::Index;
using Eigen::VectorXd;

bool SvdRoute(const SpectralProblem& problem,
              SpectralBuffers* buffers,
              VectorXd* d,
              SpectralStepSummary* summary) {
  const Index m = problem.m();
  const Index n = problem.n();
  // 3 k^2 + 7 k numbers of workspace, counted by LAPACK in 32 bits.
  constexpr Index kLargest = 26750;
  if (std::min(m, n) > kLargest) {
    summary->message =
        "J has more than 26750 rows and columns: too many for LAPACK's SVD";
    return false;
  }
  if (!CheckJacobianFinite(problem.J, &summary->message)) return false;
  // A = J^T or J, with at least as many rows as columns.
  const bool wide = n > m;
  if (wide) {
    problem.J.ToDense(&buffers->J);
    buffers->tall = buffers->J.transpose();
  } else {
    problem.J.ToDense(&buffers->tall);
  }
  TallSvd& svd = buffers->svd;
  if (!svd.Compute(&buffers->tall)) {
    summary->message =
        "the SVD of J did not converge: dgesdd and dgesvd failed";
    return false;
  }
  const VectorXd& s = svd.s();
  const double s_max = s[0];
  if (s_max == 0.0) {
    d->setZero(n);
    return true;
  }
  // With A = W S Z^T: J = Z S W^T if wide, else W S Z^T.
  VectorXd c;
  if (wide) {
    svd.RightTransposeTimes(problem.g, &c);
  } else {
    svd.LeftTransposeTimes(problem.g, &c);
  }
  VectorXd filtered(c.size());
  for (Index i = 0; i < c.size(); ++i) {
    filtered[i] = problem.filter(s[i], s_max) * c[i];
  }
  if (wide) {
    svd.LeftTimes(filtered, d);
  } else {
    svd.RightTimes(filtered, d);
  }
  const double resolution = 2.0 * std::numeric_limits<double>::epsilon() *
                            std::sqrt(static_cast<double>(m + n));
  SummarizeSpectrum(problem.filter, s, s_max, 1, resolution, summary);
  // The component of g outside the span of U.
  const double outside =
      m > n
          ? std::sqrt(std::max(0.0, problem.g.squaredNorm() - c.squaredNorm()))
          : 0.0;
  summary->estimated_error =
      SvdStepError(problem.filter, s, s_max, c, outside, wide);
  return CheckFinite("the step", *d, &summary->message);
}

}  // namespace invgrad
