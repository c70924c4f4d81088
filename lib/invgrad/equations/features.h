// Features of a point, as inputs of a network in place of the coordinates.
//
//   scaled     a_i from its interval in the box to [-1, 1]
//   periodic   cos(2 pi k (a_i - lower) / period), sin(..), k = 1 .. K: the
//              network is periodic in a_i, with all derivatives
//   Fourier    cos(b_j . a), sin(b_j . a): functions of many scales [1]
//
// Any other function on InputJets serves as well.
// Cost:    once a point, in the samples.
//
// [1] Tancik et al. Fourier features let networks learn high frequency
//     functions in low dimensional domains. NeurIPS 2020. arXiv 2006.10739,
//     equation 2.
#ifndef INVGRAD_EQUATIONS_FEATURES_H_
#define INVGRAD_EQUATIONS_FEATURES_H_

#include "Eigen/Core"
#include "invgrad/equation_points.h"
#include "invgrad/equations/input_jet.h"

namespace invgrad {

struct Features {
  int size = 0;
  InputFunction function;  // null: the coordinates
};

Features ScaledFeatures(const Box& box);

// The other coordinates are scaled. Of coordinate i: cosines and sines in turn.
// A period that is not the width of the box is allowed.
Features PeriodicFeatures(const Box& box,
                          int coordinate,
                          double period,
                          int num_waves = 1);

// frequencies: a row b_j each, often normal random numbers; 2 features a row,
// first all cosines.
Features FourierFeatures(const Eigen::MatrixXd& frequencies);

}  // namespace invgrad

#endif  // INVGRAD_EQUATIONS_FEATURES_H_
