// Applies a spectral filter of the Jacobian to a covector.
//
//   d = V phi(S) U^T g,   J = U S V^T
//
// Routes, all of which compute the same d:
//   kSvd            LAPACK dgesdd of the dense J. The oracle.
//   kGram           m <= n: J J^T = U S^2 U^T by LAPACK dsyevd,
//                   d = J^T U [phi(S) / S] U^T g
//   kParameterGram  n < m:  J^T J = V S^2 V^T,
//                   d = V [phi(S) / S] V^T J^T g
//   kGradient       phi(s) = s: d = J^T g, no factorization
//
// Shapes:  g: m;  J: m x n;  d: n.
// Cost:    kSvd O(m n min(m, n)) with J formed; kGram one Gram matrix and
//          O(m^3), with J never formed.
// Accuracy (the rule by which kAuto chooses, see spectral_step.cc): ...
// Fails:   returns false, with a message, if g or J is not finite or a
//          factorization does not converge. J = 0 or g = 0 gives d = 0.
#ifndef INVGRAD_LINALG_SPECTRAL_STEP_H_
#define INVGRAD_LINALG_SPECTRAL_STEP_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/linalg/jacobian_operator.h"
#include "invgrad/linalg/spectral_filter.h"

namespace invgrad {

enum class SpectralRoute { kAuto, kSvd, kGram, kParameterGram, kGradient };
const char* SpectralRouteName(SpectralRoute route);

struct SpectralStepOptions {
  SpectralRoute route = SpectralRoute::kAuto;
  // kAuto keeps a Gram route's answer if its estimated relative error is at
  // most this, and falls back to kSvd otherwise.
  double tolerance = 1e-6;
};

struct SpectralStepSummary {
  SpectralRoute route = SpectralRoute::kAuto;  // the one that gave the answer
  int rank = 0;               // singular values that the filter keeps
  double s_max = 0.0;         // largest singular value
  double s_min_kept = 0.0;    // smallest one that is kept
  double estimated_error = 0.0;  // relative error of d, see the accuracy rule
  int num_undecided = 0;  // values nearer to the threshold than the route's
                          // resolution: they may be on either side
  std::string message;
};

bool SpectralStep(const JacobianOperator& J,
                  const Eigen::VectorXd& g,
                  const SpectralFilter& filter,
                  const SpectralStepOptions& options,
                  Eigen::VectorXd* d,
                  SpectralStepSummary* summary);

}  // namespace invgrad

#endif  // INVGRAD_LINALG_SPECTRAL_STEP_H_
