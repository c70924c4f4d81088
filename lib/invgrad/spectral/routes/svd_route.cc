#include <algorithm>
#include <cmath>

#include "invgrad/core/finite.h"
#include "invgrad/spectral/routes/spectral_routes.h"
#include "invgrad/spectral/routes/tall_svd.h"
#include "invgrad/spectral/step_error.h"

namespace invgrad {

using Eigen::Index;
using Eigen::VectorXd;

// J = U S V^T by LAPACK. A J much longer in one direction is first reduced to a
// triangle, Q R = J or J^T, whose SVD is that of J but for Q; Q is applied to
// one vector and never formed.
bool SvdRoute(const SpectralProblem& problem,
              SpectralWorkspace* workspace,
              VectorXd* d,
              SpectralStepSummary* summary) {
  summary->route = SpectralRoute::kSvd;
  const Index m = problem.m();
  const Index n = problem.n();
  // 3 k^2 + 7 k numbers of workspace, counted by LAPACK in 32 bits.
  constexpr Index kLargest = 26750;
  if (std::min(m, n) > kLargest) {
    summary->message =
        "J has more than 26750 rows and columns: too many for "
        "LAPACK's SVD";
    return false;
  }
  if (!CheckJacobianFinite(problem.J, &summary->message)) return false;
  const SpectralFilter& filter = problem.filter;
  const bool wide = n > m;
  // A = J^T or J, with at least as many rows as columns.
  if (wide) {
    problem.J.ToDense(&workspace->basis);
    workspace->dense = workspace->basis.transpose();
  } else {
    problem.J.ToDense(&workspace->dense);
  }
  TallSvd svd(workspace);
  if (!svd.Compute(&summary->message)) return false;
  const VectorXd& s = svd.s();
  const double s_max = s[0];
  if (s_max == 0.0) {
    d->setZero(n);
    return true;
  }
  // With A = W S Z^T: J = Z S W^T if wide, else W S Z^T.
  VectorXd& c = workspace->b;
  if (wide) {
    svd.RightTransposeTimes(problem.g, &c);
  } else {
    svd.LeftTransposeTimes(problem.g, &c);
  }
  VectorXd& filtered = workspace->y;
  filtered.resize(c.size());
  for (Index i = 0; i < c.size(); ++i) filtered[i] = filter(s[i], s_max) * c[i];
  if (wide) {
    svd.LeftTimes(filtered, d);
  } else {
    svd.RightTimes(filtered, d);
  }
  SummarizeSpectrum(filter, s, s_max, 1, SvdResolution(m, n), summary);
  const double outside =
      m > n
          ? std::sqrt(std::max(0.0, problem.g.squaredNorm() - c.squaredNorm()))
          : 0.0;
  summary->estimated_error = SvdStepError(filter, s, s_max, c, outside, wide);
  return CheckFinite("the step", *d, &summary->message);
}

}  // namespace invgrad
