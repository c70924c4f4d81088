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
// Cost:    kSvd O(m n min(m, n)) with J formed; the Gram routes one Gram matrix
//          and O(min(m, n)^3), with J never formed; each an estimate of
//          O(min(m, n)^2).
//
// Accuracy. A factorization is exact for a matrix that differs from J (or from
// its Gram matrix) by E, whose entries are about 10 epsilon / sqrt(min(m, n))
// times the largest singular value (eigenvalue). To first order that changes
// the component of d along v_i by
//
//   sum_j phi[s_i, s_j] E_ij c_j           kSvd, phi continued oddly to -s
//   s_i sum_j f[lambda_i, lambda_j] E_ij c_j                 kGram
//   sum_j f[lambda_i, lambda_j] E_ij s_j c_j                 kParameterGram
//
// with c = U^T g, lambda = s^2, f = phi(s) / s and divided differences
// h[x, y] = (h(x) - h(y)) / (x - y). summary.estimated_error is the norm of
// this change, with the signs of E random, and of the last roundings, relative
// to |d|. It holds all that is known to hurt: small values that are kept, a
// part of g in dropped directions that leaks across the threshold, and values
// below what the route can tell from zero. With tau_eff = s_min_kept / s_max it
// grows as epsilon / tau_eff for kSvd and as epsilon / tau_eff^2 for the Gram
// routes.
//
// A value is undecided if it is nearer to where phi jumps (tau s_max; zero for
// tau = 0 or a clamped filter, unless phi vanishes there) than the route can
// resolve: in s by 2 epsilon sqrt(m + n) s_max for kSvd, in s^2 by
// 2 epsilon (min(m, n) + sqrt(n)) s_max^2 for the Gram routes.
//
// Contract: with no value undecided, the relative error of d is at most
// estimated_error. (An empirical law that the tests hold against long double
// arithmetic, not a theorem.) With values undecided, d is the step for a
// threshold within that resolution of tau s_max.
//
// kAuto takes kGradient if phi(s) = s, and the Gram route of the smaller side
// otherwise. It keeps the answer if estimated_error is at most
// options.tolerance, and no value is undecided or the threshold is resolved to
// options.threshold_tolerance; else it takes kSvd, and summary.message says
// why.
//
// Fails:   returns false, with a message, if g or J is not finite, if a
//          factorization does not converge, or if d overflows; the Gram routes
//          also if the squares of J's entries over- or underflow. J = 0 or
//          g = 0 gives d = 0.
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
  // kAuto keeps a Gram route's answer with undecided values only if it is the
  // step for a threshold within this relative distance of tau s_max: 0 insists
  // on the sharp threshold.
  double threshold_tolerance = 0.0;
};

struct SpectralStepSummary {
  SpectralRoute route = SpectralRoute::kAuto;  // the one that gave the answer
  // Of the singular values; zero by kGradient, which does not compute them.
  int rank = 0;                  // how many the filter keeps
  double s_max = 0.0;            // the largest
  double s_min_kept = 0.0;       // the smallest that is kept
  double estimated_error = 0.0;  // of d, relative: see Accuracy
  int num_undecided = 0;         // values that may be on either side
  // How far from tau s_max a value must be to be decided, relative to it:
  // infinity if phi jumps at zero, 0 if it does not jump.
  double threshold_resolution = 0.0;
  std::string message;  // what failed, or why kAuto took kSvd
};

// CHECKs the sizes, that the filter is valid, and that kGradient is only asked
// for phi(s) = s.
bool SpectralStep(const JacobianOperator& J,
                  const Eigen::VectorXd& g,
                  const SpectralFilter& filter,
                  const SpectralStepOptions& options,
                  Eigen::VectorXd* d,
                  SpectralStepSummary* summary);

}  // namespace invgrad

#endif  // INVGRAD_LINALG_SPECTRAL_STEP_H_
