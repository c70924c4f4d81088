// Applies a spectral filter of the Jacobian to a covector.
//
//   d = V phi(S) U^T g,   J = U S V^T
//
// Routes, all of which compute the same d (kGolubKahan with the largest s that
// g has a part of as s_max):
//   kGram           m <= n: J J^T = Q T Q^T with T tridiagonal,
//                   d = J^T Q f(T) Q^T g,  f(lambda) = phi(s) / s, lambda = s^2
//   kParameterGram  n < m:  J^T J = Q T Q^T,
//                   d = Q f(T) Q^T J^T g
//   kCascade        the Gram matrix for the large values; for the others, from
//                   1e-3 s_max or less down, the SVD of J^T X (or J X), X their
//                   singular vectors
//   kGolubKahan     bidiagonalization from products with J alone, for tau that
//                   keeps few values (golub_kahan.h)
//   kCholesky       sparse J, damping and no truncation: Cholesky factors of
//                   J^T J + (lambda + t) I for a few t (fractional_power.h),
//                   where n may be far too large for a Gram matrix
//   kSvd            the SVD of the dense J, by QR and LAPACK dgesdd: the oracle
//   kGradient       phi(s) = s: d = J^T g, no factorization
//
// f(T) is applied to one vector by a contour integral: some 70 to 130 solutions
// of shifted tridiagonal systems in place of T's eigenvectors, the truncation
// sharp (contour_quadrature.h, tridiagonal.h). Below size 64, and for clamped
// filters, whose f is not analytic, by all eigenvectors.
//
// Shapes:  g: m;  J: m x n;  d: n.
// Cost:    with k = min(m, n): the Gram routes one Gram matrix (m^2 sum of the
//          layer widths for a network, never formed; k^2 max(m, n) for a dense
//          J), 4/3 k^3, and O(100 k); kCascade 2 k^2 r + 2 max(m, n) r^2 more
//          for r small values; kCholesky 8 to 30 sparse factorizations
//          (tolerance 1e-2 to 1e-6); kGolubKahan 1.5 rank products with J and
//          J^T; kSvd O(max(m, n) k^2) with J formed.
// Memory:  SpectralStepBytes; of the workspace, so that a step of the same
//          shape by kGram allocates nothing.
//
// Accuracy. A factorization is exact for a matrix that differs from J (or from
// its Gram matrix) by E, whose entries are about 10 epsilon / sqrt(k) times
// the largest singular value (eigenvalue). summary.estimated_error is the
// first-order change of d by such an E, relative to |d|: for an SVD or
// eigenvectors the root mean square over all E (step_error.h), for a contour
// integral three times that over four random E, for which the same systems are
// solved again. It holds all that is known to hurt: small values that are kept,
// a part of g in dropped directions that leaks across the threshold, and values
// below what the route can tell from zero. With tau_eff = s_min_kept / s_max it
// grows as epsilon / tau_eff for kSvd and kCascade (there not below a quarter
// of options.tolerance, or 2e-8) and as epsilon / tau_eff^2 for the Gram
// routes.
//
// A value is undecided if it is nearer to where phi jumps (tau s_max; zero for
// tau = 0 or a clamped filter, unless phi vanishes there) than the route can
// resolve: in s by 2 epsilon sqrt(m + n) s_max for kSvd and kCascade, in s^2 by
// 2 epsilon (k + sqrt(max(m, n))) s_max^2 for the Gram routes.
//
// Contract: with no value undecided, the relative error of d is at most
// estimated_error. (An empirical law that the tests hold against long double
// arithmetic, not a theorem.) With values undecided, d is the step for a
// threshold within that resolution of tau s_max; by kGolubKahan they are part
// of estimated_error.
//
// kAuto takes kGradient if phi(s) = s, and kCholesky where that is possible and
// min(m, n) is 500 or more. Otherwise it climbs from the Gram route
// of the smaller side by kCascade to kSvd, until estimated_error is at most
// options.tolerance, and no value is undecided or the threshold is resolved to
// options.threshold_tolerance; summary.message says what was not enough. The
// cascade goes on from the Gram route's reduction. A workspace remembers the
// last step: where the Gram matrix was not accurate enough, the next step
// starts with what was, and tries it again after 20 steps; where the filter
// kept at most a twelfth of 1,000 values or more, with kGolubKahan.
//
// Fails:   returns false, with a message, if g or J is not finite (naming the
//          first such row), if a factorization does not converge, if d
//          overflows, or if the route needs more memory than options allow; the
//          Gram routes also if the squares of J's entries over- or underflow;
//          kCascade below size 64, for clamped filters, and if more than 70 %
//          of the values are small.
//          kCholesky for other J and filters, and if lambda is below about
//          2e-15 / tolerance s_max^2, which normal equations do not resolve;
//          kGolubKahan if it has not converged after 2 min(m, n) / 3 + 50
//          iterations. Every route ends after a number of operations known
//          beforehand, or with LAPACK's word that it did not converge. J = 0 or
//          g = 0 gives d = 0.
#ifndef INVGRAD_SPECTRAL_SPECTRAL_STEP_H_
#define INVGRAD_SPECTRAL_SPECTRAL_STEP_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/core/jacobian_operator.h"
#include "invgrad/spectral/spectral_filter.h"
#include "invgrad/spectral/spectral_workspace.h"

namespace invgrad {

enum class SpectralRoute {
  kAuto,
  kSvd,
  kGram,
  kParameterGram,
  kCascade,
  kGolubKahan,
  kCholesky,
  kGradient
};
const char* SpectralRouteName(SpectralRoute route);

struct SpectralStepOptions {
  SpectralRoute route = SpectralRoute::kAuto;
  // kAuto keeps a route's answer if its estimated relative error is at most
  // this, and goes on to a more accurate one otherwise. kCascade, kGolubKahan
  // and kCholesky work as hard as it asks. > 0.
  double tolerance = 1e-6;
  // kAuto keeps an answer with undecided values only if it is the step for a
  // threshold within this relative distance of tau s_max: 0 insists on the
  // sharp threshold.
  double threshold_tolerance = 0.0;
  // In bytes; 0: that of memory_limit.h.
  double memory_limit = 0.0;
};

struct SpectralStepSummary {
  SpectralRoute route = SpectralRoute::kAuto;  // the one that gave the answer
  // Of the singular values; zero by kGradient, which does not compute them, as
  // s_min_kept by kCholesky, whose rank is min(m, n).
  int rank = 0;                  // how many the filter keeps
  double s_max = 0.0;            // the largest
  double s_min_kept = 0.0;       // the smallest that is kept
  double estimated_error = 0.0;  // of d, relative: see Accuracy
  int num_undecided = 0;         // values that may be on either side
  // How far from tau s_max a value must be to be decided, relative to it:
  // infinity if phi jumps at zero, 0 if it does not jump.
  double threshold_resolution = 0.0;
  std::string message;  // what failed, or why kAuto went on
};

// What a route keeps in the workspace, in bytes, for J m x n that is a
// network's or compressed rows; kCascade keeps 8 max(m, n) r more for r small
// values, kCholesky the factor, whose size is known when it is analyzed.
double SpectralStepBytes(SpectralRoute route, Eigen::Index m, Eigen::Index n);

// CHECKs the sizes, that the filter is valid, and that kGradient is only asked
// for phi(s) = s.
bool SpectralStep(const JacobianOperator& J,
                  const Eigen::VectorXd& g,
                  const SpectralFilter& filter,
                  const SpectralStepOptions& options,
                  SpectralWorkspace* workspace,
                  Eigen::VectorXd* d,
                  SpectralStepSummary* summary);

// The same with a workspace of its own, for a single step.
bool SpectralStep(const JacobianOperator& J,
                  const Eigen::VectorXd& g,
                  const SpectralFilter& filter,
                  const SpectralStepOptions& options,
                  Eigen::VectorXd* d,
                  SpectralStepSummary* summary);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_SPECTRAL_STEP_H_
