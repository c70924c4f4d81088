// A simulator with two pre-images for every target: supervised training
// averages them, an inverse returns one.
//
//   y = x^2,   L = 1/2 (y - y*)^2,   y* = (x*)^2,   x* uniform in (-1, 1]
//
// Shapes:  network 1-32-32-1, tanh, its input is y*;  x, y: 1.
// Units:   none.
// Data:    np.random.seed(data_seed); x* = 1 - 2 np.random.rand(2 N), the first
//          N for training; x* is the data's solution.
// Inverse: sign(x_0) sqrt(y), local; y < 0 has no pre-image.
// Metric:  mean distance of x to the nearer of the two pre-images of y*.
// Facts:   the best supervised map is the mean of the solutions, x = 0, whose
//          metric is the mean of |x*|, 1/2.
// Source:  PBDL, chapters intro-teaser and physgrad-nn.
#ifndef PROBLEMS_MULTIMODAL_H_
#define PROBLEMS_MULTIMODAL_H_

#include <string>

#include "Eigen/Core"
#include "problems/problem.h"
#include "problems/sample_data.h"

namespace invgrad {

struct Multimodal {
  struct Options {
    int num_samples = 2000;
    int data_seed = 0;
    bool wrong_inverse = false;
    void Describe(OptionSet* set) {
      DescribeSamples(1, 1e7, &num_samples, &data_seed, set);
      set->Add("wrong_inverse",
               &wrong_inverse,
               "an inverse that is wrong for y in (0.25, 0.5), NaN in (0.5, "
               "0.75) and throws above: it is to be caught");
    }
  };

  static bool Create(const Options& options,
                     const Eigen::MatrixXd* data,
                     LearningProblem* problem,
                     std::string* error);
};

}  // namespace invgrad

#endif  // PROBLEMS_MULTIMODAL_H_
