// Applies a spectral filter of the Jacobian to a covector g, using only
// products with J and J^T, by Golub-Kahan bidiagonalization started at g.
//
//   d = V phi(S) U^T g,   J = U S V^T
//
//   J V_k = P_k R_k,   J^T P_k = V_k R_k^T + theta v_{k+1} e_k^T,
//   v_1 = J^T g / |J^T g|,   P_k, V_k orthonormal, R_k upper bidiagonal  [1]
//   R_k = X Sigma Y^T:   d_k = V_k Y phi(Sigma) X^T P_k^T g              [2]
//
// Shapes:  g: m;  J: m x n;  d: n;  k: summary.num_iterations.
// Cost:    k products with J and k with J^T; 2 min(m, n) k^2 for
//          reorthogonalization, and as much again after cancellation; O(k^2)
//          for each of about 16 log k convergence tests; O(k^3) once or twice.
// Memory:  min(m, n) k doubles, up to twice that while the basis grows. Only
//          the basis with the shorter vectors is reorthogonalized; the other
//          one is orthonormal to epsilon / tau^2 [3].
//
// Convergence is sudden with a sharp truncation: the error stays above 1e-3
// until every mode near tau s_max is resolved, and then drops to 1e-6 in a few
// iterations. k / rank is 1.2 to 1.6, and 2 or more for a rank of about ten.
// Filters without a jump (Levenberg-Marquardt) converge steadily. With a jump at
// zero (tau = 0, or a clamped filter) the iteration must exhaust the rank of J,
// and the final estimate may be far above the error.
//
// Contract: d is within estimated_error (ritz_error.h, and the difference from
// an earlier iterate) of the step whose s_max is the largest singular value with
// a component in g. (Tested on synthetic spectra, not proved.)
//
// Fails:   returns false, with a message, if g, a product with J or d is not
//          finite, or if the SVD of R_k does not converge. Reaching
//          max_iterations is no failure: d is then the last iterate, converged
//          is false, and the message gives the reason. J = 0 or g = 0 gives
//          d = 0.
//
// [1] Golub, Kahan. Calculating the Singular Values and Pseudo-Inverse of a
//     Matrix. SIAM J. Numer. Anal. B 2 (1965).
// [2] Arrigo, Benzi, Fenu. Computation of Generalized Matrix Functions. SIAM J.
//     Matrix Anal. Appl. 37 (2016).
// [3] Simon, Zha. Low-Rank Matrix Approximation Using the Lanczos
//     Bidiagonalization Process. SIAM J. Sci. Comput. 21 (2000).
#ifndef INVGRAD_SPECTRAL_GOLUB_KAHAN_H_
#define INVGRAD_SPECTRAL_GOLUB_KAHAN_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/jacobian_operator.h"
#include "invgrad/spectral.h"

namespace invgrad {

struct GolubKahanOptions {
  // Stops when estimated_error <= tolerance.
  double tolerance = 1e-3;
  // Limits time and memory. min(m, n) is always enough.
  int max_iterations = 1000;
};

struct GolubKahanSummary {
  int num_iterations = 0;        // k
  int rank = 0;                  // Ritz values that the filter keeps
  double s_max = 0.0;            // the largest Ritz value
  double s_min_kept = 0.0;       // the smallest kept Ritz value
  double estimated_error = 0.0;  // of d, relative: see Accuracy
  bool converged = false;        // estimated_error <= tolerance
  std::string message;           // the failure, or why it stopped early
};

// *basis: memory for P_k or V_k; reuse it between calls to save allocations.
// CHECKs the sizes, the options and that the filter is valid.
bool GolubKahanStep(const JacobianOperator& J,
                    const Eigen::VectorXd& g,
                    const SpectralFilter& filter,
                    const GolubKahanOptions& options,
                    Eigen::MatrixXd* basis,
                    Eigen::VectorXd* d,
                    GolubKahanSummary* summary);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_GOLUB_KAHAN_H_
