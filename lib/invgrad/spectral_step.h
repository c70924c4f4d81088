// Applies a spectral filter of the Jacobian to a covector.
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
// small kept values, components of g that leak across the threshold from dropped
// directions, and values that the route does not resolve from zero. With
// tau_eff = s_min_kept / s_max it grows as epsilon / tau_eff for svd and as
// epsilon / tau_eff^2 for gram.
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
#ifndef INVGRAD_SPECTRAL_STEP_H_
#define INVGRAD_SPECTRAL_STEP_H_

#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/jacobian_operator.h"
#include "invgrad/spectral/spectrum.h"
#include "invgrad/spectral_filter.h"

namespace invgrad {

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
  // Whether to fill summary.spectrum: k^2 rotations for route gram.
  bool measures_spectrum = false;
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
  // Of J and g, if measured: empty for gradient, for J = 0, and if its iteration
  // does not converge.
  Spectrum spectrum;
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
// compressed rows; not for auto (CHECKed). Of the first of `num_ranks` ranks that
// share J, which needs the most.
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

#endif  // INVGRAD_SPECTRAL_STEP_H_
