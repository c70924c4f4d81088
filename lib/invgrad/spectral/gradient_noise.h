// The noise scale of a batch: how many samples have gradients whose mean is as
// long as its own random error.
//
//   tr(Sigma) / |mu|^2,   mu and Sigma the mean and the covariance of h_i,
//   h_i = J_i^T g_i the gradient of sample i
//
// of [1], equation 2.9. From the score of gradient descent (kappa = -1), with
// |sum h_i|^2 = g_fitted and sum_i h_i . sum_{j != i} h_j = g_c, and without
// further products:
//
//   |mu|^2 ~ g_c / (B (B - 1)),   tr(Sigma) ~ g_fitted / B - g_c / (B - 1)
//   tr(Sigma) / |mu|^2 ~ (B - 1) g_fitted / g_c - B
//
// Both estimates are unbiased for independent samples, and equal [1], appendix
// A.1, with batches of 1 and B (docs/leave_one_out.md, section 6). Their ratio is
// not: add the scores of several batches of B samples before. Scores of some of
// the samples (max_num_samples) have the same ratio of means.
//
// Units:   samples. The factor in front of the loss, and B in it, do not matter.
// Accuracy: the error is some epsilon g_fitted / g_c (B + the result).
// Fails:   never. Infinity if the estimate of |mu|^2 is not positive, so that
//          nothing tells the mean from noise, and for one sample. Otherwise at
//          least 0, which equal gradients have, zeros included.
//          CHECKs that num_samples > 0.
//
// [1] McCandlish, Kaplan, Amodei. An Empirical Model of Large-Batch Training.
//     2018. arXiv 1812.06162.
#ifndef INVGRAD_SPECTRAL_GRADIENT_NOISE_H_
#define INVGRAD_SPECTRAL_GRADIENT_NOISE_H_

#include "invgrad/spectral/leave_one_out.h"

namespace invgrad {

// gradient_score: of a filter with kappa = -1. num_samples: B, those of each
// batch, also if fewer were chosen.
double GradientNoiseScale(const LeaveOneOutScore& gradient_score,
                          int num_samples);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_GRADIENT_NOISE_H_
