// The 2-jet of a function of d variables: value, gradient and Laplacian.
//
//   j = (v, d_1 v, .., d_d v, Lap v)          T = d + 2 channels
//   phi(z):  phi,  phi' d_i z,         phi' Lap z + phi'' sum_i (d_i z)^2
//   s z:     s z,  s d_i z + z d_i s,  s Lap z + 2 sum_i d_i s d_i z + z Lap s
//
// A network propagates them in its forward pass [1]. The tangent of the jet of
// a = phi(z) is its product with the jet of phi'(z), since da = phi'(z) dz. The
// product is symmetric, so the same holds for curvatures and all second
// derivatives.
//
// Shapes:  matrices have one row per function and T adjacent columns, one per
//          channel, for each sample. T = 1: plain values, multiplied entry by
//          entry.
// Cost:    some 5 operations an entry.
//
// [1] Li et al. A computational framework for neural network-based variational
//     Monte Carlo with Forward Laplacian. Nature Machine Intelligence 6 (2024).
//     arXiv 2307.08214.
#ifndef INVGRAD_CHAIN_TWO_JET_H_
#define INVGRAD_CHAIN_TWO_JET_H_

#include "Eigen/Core"
#include "invgrad/chain/activation.h"

namespace invgrad {

constexpr int NumTwoJetChannels(int num_variables) { return num_variables + 2; }

// The jets of num_variables coordinates, |a| x B -> |a| x B T: d_i a_k is 1 for
// i = k and 0 for the others, Lap a_k = 0.
Eigen::MatrixXd JetsOfInputs(const Eigen::MatrixXd& inputs);

// Replaces the jets of z by the jets of phi(z), and writes the jets of phi'(z)
// and, unless null, of phi''(z). `slopes` and `curvatures`: as z (CHECKed).
// T > 1 needs derivatives of phi up to the third, with curvatures the fourth.
void ActivateJets(Activation activation,
                  int num_channels,
                  Eigen::Ref<Eigen::MatrixXd> z,
                  Eigen::MatrixXd* slopes,
                  Eigen::MatrixXd* curvatures);

// values = factors values, a product of jets, linear in values for fixed
// factors. Sizes are the same (CHECKed).
void MultiplyJets(int num_channels,
                  const Eigen::Ref<const Eigen::MatrixXd>& factors,
                  Eigen::Ref<Eigen::MatrixXd> values);

// The transposed map, for covectors.
void MultiplyJetsTransposed(int num_channels,
                            const Eigen::Ref<const Eigen::MatrixXd>& factors,
                            Eigen::Ref<Eigen::MatrixXd> covectors);

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_TWO_JET_H_
