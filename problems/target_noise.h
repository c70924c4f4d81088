// Noise in the targets that a network learns from; those it is tested on stay
// as they are.
//
//   y*_i += noise rms(y*) z_i,   z_i standard normal
//
// rms(y*) is the root mean square of all entries of the training targets. With
// L = c |y - y*|^2 the train loss of a perfect network is then
// c |y*| noise^2 rms^2, its test loss is zero as before.
//
// Stream:  np.random.seed(data_seed ^ 0x9e3779b9), normal numbers sample by
//          sample: independent of the data's own, which noise does not change.
#ifndef PROBLEMS_TARGET_NOISE_H_
#define PROBLEMS_TARGET_NOISE_H_

#include "invgrad/core/option_set.h"
#include "problems/problem.h"

namespace invgrad {

// The option `noise`.
void DescribeTargetNoise(double* noise, OptionSet* set);

// Does nothing if `noise` is zero.
void AddTargetNoise(double noise, int data_seed, LearningProblem* problem);

}  // namespace invgrad

#endif  // PROBLEMS_TARGET_NOISE_H_
