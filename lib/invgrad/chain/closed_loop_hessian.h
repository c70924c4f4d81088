// The exact Hessian in the weights of a network in a loop over time.
//
// The loop, x_t = f(s_t(x); theta), is a constraint between x and theta. With
// covectors lambda of x with the loop closed (feedback.h), the Hessian of the
// samples' losses F_s(x) is that of the Lagrangian
//
//   F(x) + sum_t lambda_t . (f(s_t(x); theta) - x_t)
//
// along the solutions, in which X = dx/dtheta = (I - K S)^-1 df/dtheta [1]:
//
//   H = sum lambda . f_theta_theta + X^T C + C^T X + X^T Lambda X
//   C = sum_t S_t^T (lambda_t . f_s_theta)
//   Lambda = F_xx + sum_t [S_t^T (lambda_t . f_ss) S_t
//                          + (K_t^T lambda_t) . d2s_t/dx2],   S_t = ds_t/dx
//
// summed over the samples.
//
// Shapes:  lambda: |x| x B;  F_xx: |x| x |x| for each sample;  H: n x n;
//          X, C: |x| x n for each sample.
// Cost:    DenseNetwork::Hessian over all B T calls, ns of its passes more, and
//          2 n^2 B |x|. Memory: 8 (3 |x| + T) B n bytes beside H.
// Fails:   returns false, with the sample in *failed, where the physics has no
//          finite derivative.
//
// [1] Nocedal, Wright. Numerical Optimization. 2nd edition, Springer 2006,
//     section 12.5, for the Lagrangian's Hessian.
#ifndef INVGRAD_CHAIN_CLOSED_LOOP_HESSIAN_H_
#define INVGRAD_CHAIN_CLOSED_LOOP_HESSIAN_H_

#include <vector>

#include "Eigen/Core"
#include "invgrad/chain/dense_network.h"
#include "invgrad/chain/feedback.h"

namespace invgrad {

// `activations` with curvatures, a sample's calls side by side. starts: ns x B.
// Sizes that do not fit are CHECKed.
bool ClosedLoopHessian(const DenseNetwork& network,
                       const Feedback& feedback,
                       const Eigen::VectorXd& weights,
                       const DenseNetwork::Activations& activations,
                       const Eigen::MatrixXd& starts,
                       const Eigen::MatrixXd& lambda,
                       std::vector<Eigen::MatrixXd> F_xx,
                       Eigen::MatrixXd* hessian,
                       int* failed);

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_CLOSED_LOOP_HESSIAN_H_
