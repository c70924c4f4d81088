// Applies a spectral filter of the Jacobian to a covector from products with J
// alone: Golub-Kahan bidiagonalization started at g.
//
//   d = V phi(S) U^T g,   J = U S V^T
//
//   J V_k = P_k R_k,   J^T P_k = V_k R_k^T + theta v_{k+1} e_k^T,
//   v_1 = J^T g / |J^T g|,   P_k, V_k orthonormal, R_k upper bidiagonal  [1]
//   R_k = X Sigma Y^T:   d_k = V_k Y phi(Sigma) X^T P_k^T g              [2]
//
// Shapes:  g: m;  J: m x n;  d: n;  k: summary.num_iterations.
// Cost:    k products with J and k with J^T; 2 N k^2 for reorthogonalization
//          against N stored numbers an iteration, and as much again where it
//          cancels; O(k^2) for a test of convergence, of which there are about
//          16 log k; O(k^3) once or twice for the SVD of R_k.
// Memory:  N k doubles, up to twice that while they grow. N = min(m, n) where
//          the accuracy of the Gram matrix suffices (the smaller basis alone is
//          kept orthonormal, the other one follows up to roundings of epsilon /
//          tau^2 [3]), and m + n for small tau.
//
// Convergence. With a sharp truncation it is a cliff: the error stays above
// 1e-3 until every mode near tau s_max is resolved, and then drops to 1e-6 in a
// few iterations. k / rank is 1.2 to 1.6, and 2 or more for a rank of about
// ten; so this pays if tau keeps at most about a tenth of the modes. Filters
// without a jump (Levenberg-Marquardt) converge steadily.
//
// Accuracy. A Ritz pair sigma_j, y_j has the residual r_j = theta |X_kj|; the
// error of d_k is E(J^T J) v_{k+1} exactly, with divided differences of
// f(lambda) = phi(s) / s between the Ritz values and those of J [4].
// summary.estimated_error bounds it by what can leak across the jump of phi:
//
//   |d - d_k|^2 <~ sum_kept  leak_j^2 ((phi_j c_j)^2 + E(lambda_j)^2)
//                + sum_open  (phi_max c_j)^2,      leak_j = sigma_j r_j / gap_j
//
// c_j = (X^T P_k^T g)_j; gap_j is the distance of sigma_j^2 from the jump;
// lambda_j = sigma_j^2 - sigma_j r_j is where a mode may still hide; `open` are
// the dropped values whose residual reaches across the jump. While no value is
// below the jump, E(jump) is added. So are the difference from an earlier
// iterate, and roundings. Without a jump the estimate is the largest E on
// [0, inf). With a jump at zero (tau = 0, or a clamped filter) every mode
// counts, and the iteration has to exhaust the rank of J; it may then end with
// an estimate that is far above the error.
//
// Contract: d is within estimated_error of the step whose s_max is the largest
// singular value of which g has a part. (Held by the tests on synthetic
// spectra, not a theorem.)
//
// Fails:   returns false, with a message, if g, a product with J or d is not
//          finite, or if the SVD of R_k does not converge. An iteration that
//          ends at max_iterations is no failure: d is its last iterate,
//          converged is false, and the message says so. J = 0 or g = 0 gives
//          d = 0.
//
// [1] Golub, Kahan. Calculating the Singular Values and Pseudo-Inverse of a
//     Matrix. SIAM J. Numer. Anal. B 2 (1965).
// [2] Arrigo, Benzi, Fenu. Computation of Generalized Matrix Functions. SIAM J.
//     Matrix Anal. Appl. 37 (2016).
// [3] Simon, Zha. Low-Rank Matrix Approximation Using the Lanczos
//     Bidiagonalization Process. SIAM J. Sci. Comput. 21 (2000).
// [4] Higham. Functions of Matrices. SIAM 2008, section 13.2.
#ifndef INVGRAD_SPECTRAL_ROUTES_GOLUB_KAHAN_H_
#define INVGRAD_SPECTRAL_ROUTES_GOLUB_KAHAN_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/core/jacobian_operator.h"
#include "invgrad/spectral/spectral_filter.h"

namespace invgrad {

struct GolubKahanOptions {
  // Stops when estimated_error <= tolerance.
  double tolerance = 1e-3;
  // The cap on time and memory. min(m, n) is always enough.
  int max_iterations = 1000;
  // Stores one basis whatever the threshold is: for iterates that are not meant
  // to converge.
  bool always_one_basis = false;
};

// The bases, kept between calls: their pages cost more than they look.
struct GolubKahanWorkspace {
  Eigen::MatrixXd P;  // m x capacity
  Eigen::MatrixXd V;  // n x capacity
};

struct GolubKahanSummary {
  int num_iterations = 0;        // k
  int rank = 0;                  // Ritz values that the filter keeps
  double s_max = 0.0;            // the largest Ritz value
  double s_min_kept = 0.0;       // the smallest that is kept
  double estimated_error = 0.0;  // of d, relative: see Accuracy
  int num_undecided = 0;         // values whose residual reaches the jump
  bool converged = false;        // estimated_error <= tolerance
  std::string message;           // what failed, or why it stopped short
};

// CHECKs the sizes, the options and that the filter is valid.
bool GolubKahanStep(const JacobianOperator& J,
                    const Eigen::VectorXd& g,
                    const SpectralFilter& filter,
                    const GolubKahanOptions& options,
                    GolubKahanWorkspace* workspace,
                    Eigen::VectorXd* d,
                    GolubKahanSummary* summary);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_GOLUB_KAHAN_H_
