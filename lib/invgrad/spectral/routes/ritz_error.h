// Estimates the error of a step from Golub-Kahan bidiagonalization.
//
// A Ritz pair sigma_j, y_j has the residual r_j = theta |X_kj|; the error of
// d_k is E(J^T J) v_{k+1} exactly, with divided differences f[., .] of
// f(lambda) = phi(s) / s, lambda = s^2 [1, section 13.2]:
//
//   E(lambda) = sum_i sigma_i r_i c_i sigma_i f[sigma_i^2, lambda]
//
// Without a jump of phi the estimate is the largest E on [0, inf). With a jump,
// it bounds the leakage across the jump:
//
//   |d - d_k|^2 <~ sum_kept  leak_j^2 ((phi_j c_j)^2 + E(lambda_j)^2)
//                + sum_open  (phi_max c_j)^2,      leak_j = sigma_j r_j / gap_j
//
// gap_j: the distance of sigma_j^2 from the jump;
// lambda_j = sigma_j^2 - sigma_j r_j: an unresolved mode may lie there; `open`:
// the dropped values whose residual extends across the jump. While no value is
// below the jump, E(jump) is added. O(k^2).
//
// [1] Higham. Functions of Matrices. SIAM 2008.
#ifndef INVGRAD_SPECTRAL_ROUTES_RITZ_ERROR_H_
#define INVGRAD_SPECTRAL_ROUTES_RITZ_ERROR_H_

#include "Eigen/Core"
#include "invgrad/spectral.h"

namespace invgrad {

// R_k = X Sigma Y^T.
struct RitzValues {
  Eigen::VectorXd s;         // largest first
  Eigen::VectorXd c;         // X^T P_k^T g
  Eigen::VectorXd residual;  // theta X_kj, with its sign
};

// Relative to |d_k|; infinity if there is no estimate. `exhausted`: the Krylov
// space is invariant.
double RitzStepError(const RitzValues& ritz,
                     const SpectralFilter& filter,
                     bool exhausted);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_RITZ_ERROR_H_
