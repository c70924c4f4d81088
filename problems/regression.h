// The common part of the regression problems: a network without a simulator,
// and standardized targets.
//
//   y = x = f(a),   L = |y - y*|^2,   y* = (t - mean t) / std t
//
// over the training targets t.
//
// Shapes:  network |a|-16-16-16-1, GELU, PyTorch's initialization;  x, y: 1.
// Units:   the loss of a batch is the sum of the samples' losses, not their
//          mean, so g = 2 (y - y*), as in the Sven benchmark: its half-inverse
//          with learning rate lr and truncation tau is here
//          half_inverse:step_size=lr:truncation=tau. Gradients are B times
//          those of the mean. Losses are still reported as means.
// Settings: B 32, 20 epochs, of which the last, incomplete batch is left out.
//          The benchmark shuffles its batches.
// Source:  the Sven benchmark, sambt/sven-experiments,
//          experiments/datasets/all_datasets.py and optimizers/hig.py;
//          arXiv 2604.01279.
#ifndef PROBLEMS_REGRESSION_H_
#define PROBLEMS_REGRESSION_H_

#include <string>

#include "problems/problem.h"

namespace invgrad {

// The variance of N numbers: with 1 / (N - 1), as PyTorch does, or with 1 / N,
// as numpy does.
enum class Variance { kUnbiased, kBiased };

// Makes the samples from problem->data, 2 N x (|a| + 1), a and t; the first N
// are for training. Returns false, with *error set, if the deviation of the
// training targets is not positive and finite.
bool MakeRegression(Variance variance,
                    LearningProblem* problem,
                    std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_REGRESSION_H_
