// Computes a spectral step: it applies a filter of the singular values of the
// Jacobian to a covector. The half-inverse step is one. Use it to compute a
// single step, or in a rule of your own. The rules that use it have names
// (rules.h).
//
//   d = V phi(S) U^T g,   J = U S V^T
//
// All routes compute the same d; k = min(m, n):
//   gram      the Gram matrix of the smaller side, reduced to a tridiagonal T:
//             m <= n: J J^T = Q T Q^T,  d = J^T Q f(T) Q^T g
//             n < m:  J^T J = Q T Q^T,  d = Q f(T) Q^T J^T g
//             f(lambda) = phi(s) / s, lambda = s^2. A contour integral applies
//             f(T) by 70 to 130 solutions of shifted tridiagonal systems,
//             without eigenvectors; the truncation stays sharp
//             (contour_quadrature.h). For k < 64, and for clamped filters,
//             whose f is not analytic, gram computes all eigenvectors.
//   svd       LAPACK's SVD of the dense J, after a QR factorization
//   gradient  phi(s) = s: d = J^T g, no factorization
//             Ranks that share J also share a large J J^T, which none of them
//             holds (column_strips.h).
//   auto      gradient if phi(s) = s; otherwise gram, and where gram is not
//             accurate enough, svd for this step and the next 20 of the same
//             shape; summary.message gives the reason
//
// Shapes:  g: m;  J: m x n;  d: n.
// Cost:    gram: one Gram matrix (m^2 sum of the layer widths for a network,
//          whose J is never formed; k^2 max(m, n) for a dense J), 4/3 k^3, and
//          O(100 k).  svd: O(max(m, n) k^2), with J formed.
// Memory:  SpectralStepBytes, kept in the workspace: a second gram step of the
//          same shape allocates nothing.
//
// Accuracy. A factorization is exact for a matrix that differs from J (svd) or
// from its Gram matrix (gram) by E, whose entries are about
// 10 epsilon / sqrt(k) times the largest singular value (eigenvalue).
// summary.estimated_error is the first-order change of d by such an E, relative
// to |d|: the root mean square over all E (step_error.h) or, with a contour
// integral, three times the root mean square over four random E. It includes
// small kept values, components of g that leak across the threshold from
// dropped directions, and values that the route does not resolve from zero.
// With tau_eff = s_min_kept / s_max it grows as epsilon / tau_eff for svd and
// as epsilon / tau_eff^2 for gram.
//
// A value is undecided if its distance from the jump of phi (at tau s_max; at
// zero for tau = 0 or a clamped filter, unless phi vanishes there) is below the
// resolution of the route: 2 epsilon sqrt(m + n) s_max in s for svd, 2 epsilon
// (k + sqrt(max(m, n))) s_max^2 in s^2 for gram.
//
// Contract: if no value is undecided, the relative error of d is at most
// estimated_error. (An empirical law, tested against long double arithmetic,
// not a theorem.) Otherwise d is the step for a threshold within the resolution
// of tau s_max.
//
// A gram step is accurate if estimated_error <= tolerance, and no value is
// undecided or the threshold is resolved to threshold_tolerance. A step by svd
// is returned with its estimate in any case.
//
// Fails:   returns false, with a message, if g or J is not finite (the message
//          names the first such row), if a factorization does not converge, if
//          d overflows, or if the route needs more memory than the limit; gram
//          also if its step is not accurate, or if the squares of J's entries
//          over- or underflow. J = 0 or g = 0 gives d = 0.
#ifndef INVGRAD_SPECTRAL_H_
#define INVGRAD_SPECTRAL_H_

#include <cmath>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/jacobian_operator.h"

namespace invgrad {

// The function phi of the singular values, which defines a joint rule.
//
//   step = -eta V phi(S) U^T g,   J = U S V^T
//
//   phi(s) = s (s^2 + lambda)^(-(1 + kappa) / 2)   for s > tau s_max, else 0
//   lambda = damping + relative_damping s_max^2
//
//   rule                         phi(s)
//   gradient descent             s               kappa = -1, tau = 0
//   half-inverse                 s^(-1/2)        kappa = 1/2, lambda = 0
//   truncated Gauss-Newton       s^-1            kappa = 1, lambda = 0
//   power, kappa in [-1, 1]      s^-kappa        lambda = 0
//   Levenberg-Marquardt          s / (s^2 + lambda)       kappa = 1, tau = 0
//   clamped                      phi(max(s, tau s_max))
//
// With damping, phi acts as gradient descent on values well below sqrt(lambda),
// and as a power on values well above. Truncation is relative and strict: a
// singular value equal to tau s_max is dropped. A zero singular value never
// contributes, not even clamped, because its singular vectors are not unique.
//
// [1] Schnell, Holl, Thuerey. Half-Inverse Gradients for Physical Deep
//     Learning. ICLR 2022, section 2. arXiv 2203.10131.
struct SpectralFilter {
  double kappa = 0.5;             // in [-1, 1]
  double tau = 1e-6;              // in [0, 1)
  bool clamp = false;             // raise small values to tau s_max instead
  double damping = 0.0;           // >= 0, in units of s^2
  double relative_damping = 0.0;  // >= 0, in units of s_max^2

  static SpectralFilter Power(double kappa, double tau);
  static SpectralFilter HalfInverse(double tau) { return Power(0.5, tau); }
  static SpectralFilter GaussNewton(double tau) { return Power(1.0, tau); }
  static SpectralFilter GradientDescent() { return Power(-1.0, 0.0); }
  static SpectralFilter LevenbergMarquardt(double damping,
                                           double relative_damping);

  // Returns false, with *error, if a field is out of its range.
  bool IsValid(std::string* error) const;

  // lambda > 0: phi goes to zero with s, and is smooth there.
  bool IsDamped() const { return damping > 0.0 || relative_damping > 0.0; }

  // (1 + kappa) / 2: phi(s) = s f(s^2) with f(x) = (x + lambda)^-Exponent().
  double Exponent() const { return 0.5 * (1.0 + kappa); }

  // The argument of the maximum of phi on (0, highest]; `highest` if phi is
  // singular at zero.
  double PeakBelow(double highest, double s_max) const;

  // True if phi(s) = s, which needs no factorization of J.
  bool IsGradientDescent() const;

  // True if s is neither truncated nor clamped.
  bool Keeps(double s, double s_max) const;

  // phi(s), 0 <= s <= s_max.
  double operator()(double s, double s_max) const;

 private:
  // sqrt(lambda), without squares that over- or underflow.
  double RootOfDamping(double s_max) const;
};

enum class SpectralRoute { kAuto, kGram, kSvd, kGradient };

const char* SpectralRouteName(SpectralRoute route);

// The routes for any filter: all but gradient.
constexpr SpectralRoute kGeneralSpectralRoutes[] = {
    SpectralRoute::kAuto, SpectralRoute::kGram, SpectralRoute::kSvd};

struct SpectralStepOptions {
  SpectralRoute route = SpectralRoute::kAuto;
  // estimated_error <= tolerance; > 0.
  double tolerance = 1e-6;
  // threshold_resolution <= threshold_tolerance, or no value is undecided: 0
  // requires the sharp threshold.
  double threshold_tolerance = 0.0;
  // In bytes; 0: the limit of memory_limit.h.
  double memory_limit = 0.0;

  // The tolerances of the rules: 1e-2 and 0.25. The error estimate is at least
  // the error (tests/spectral), and training does not depend on it
  // (docs/results/speed.md). A value within a quarter of the threshold may be
  // kept or dropped; tau is rarely known more precisely.
  static SpectralStepOptions ForTraining();
};

struct SpectralStepSummary {
  SpectralRoute route = SpectralRoute::kAuto;  // the one that gave d
  // The singular values; zero for gradient, which does not compute them.
  int rank = 0;                  // number of kept values
  double s_max = 0.0;            // the largest
  double s_min_kept = 0.0;       // the smallest kept value
  double estimated_error = 0.0;  // of d, relative: see Accuracy
  int num_undecided = 0;         // undecided values
  // Values at a larger relative distance from tau s_max are decided. Infinity
  // if phi jumps at zero, 0 if phi has no jump.
  double threshold_resolution = 0.0;
  std::string message;  // the failure, or why auto used svd
};

struct SpectralBuffers;

// Memory that spectral steps reuse. Use one workspace for one run, and in one
// thread at a time.
class SpectralWorkspace {
 public:
  SpectralWorkspace();
  ~SpectralWorkspace();
  SpectralWorkspace(SpectralWorkspace&&) noexcept;
  SpectralWorkspace& operator=(SpectralWorkspace&&) noexcept;

  // The state of auto: rows, columns, and the number of further steps that use
  // svd. Empty or zero before the first step. A checkpoint must contain it to
  // resume bit for bit.
  static constexpr int kHistorySize = 3;
  Eigen::VectorXd history;

  SpectralBuffers& buffers() { return *buffers_; }

 private:
  std::unique_ptr<SpectralBuffers> buffers_;
};

// The workspace of a route in bytes, for the m x n Jacobian of a network or in
// compressed rows; not for auto (CHECKed). Of the first of `num_ranks` ranks
// that share J, which needs the most.
double SpectralStepBytes(SpectralRoute route,
                         Eigen::Index m,
                         Eigen::Index n,
                         int num_ranks = 1);

// CHECKs the sizes, that the filter is valid, and phi(s) = s for gradient.
bool SpectralStep(const JacobianOperator& J,
                  const Eigen::VectorXd& g,
                  const SpectralFilter& filter,
                  const SpectralStepOptions& options,
                  SpectralWorkspace* workspace,
                  Eigen::VectorXd* d,
                  SpectralStepSummary* summary);

// The same with a temporary workspace, for a single step.
bool SpectralStep(const JacobianOperator& J,
                  const Eigen::VectorXd& g,
                  const SpectralFilter& filter,
                  const SpectralStepOptions& options,
                  Eigen::VectorXd* d,
                  SpectralStepSummary* summary);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_H_
