// A smooth function of one variable, to compare the accuracy of rules on an
// easy problem.
//
//   t(a) = exp(-10 a^2) sin 2a,   a uniform in [-1, 1)
//
// Network, loss, its scaling and the standardized target: regression.h.
//
// Shapes:  network 1-16-16-16-1, GELU, 593 weights;  x, y: 1.
// Data:    np.random.seed(data_seed); a = 2 np.random.rand(2 N) - 1, the first
//          N for training; t is standardized with 1 / (N - 1). The benchmark
//          draws a from the same distribution by PyTorch's generator, in single
//          precision.
// Facts:   t is odd. The samples are points of a line, so J of a batch of 32 is
//          singular: at the start its singular values fall from 7 to 2e-6 at
//          the ninth, and on to rounding error. The minimizer of the batch's
//          linear model is far outside of the model's range of validity, so the
//          half-inverse needs a small, fixed step size. Published losses on
//          10,000 other samples: half-inverse,
//          half_inverse:step_size=0.005:truncation=1e-6, 1.8e-9 +- 1.0e-9 (15
//          seeds), Sven 5.1e-7, Adam 3.3e-5, SGD 1.1e-3. Here, by this
//          half-inverse with shuffled batches: 0.9e-9 to 10e-9, median 3.1e-9
//          (seeds 1 to 15).
// Source:  the Sven benchmark, toy_1d; arXiv 2604.01279.
#ifndef PROBLEMS_REGRESSION_1D_H_
#define PROBLEMS_REGRESSION_1D_H_

#include <string>

#include "Eigen/Core"
#include "problems/problem.h"
#include "problems/sample_data.h"

namespace invgrad {

struct Regression1d {
  struct Options {
    int num_samples = 10000;
    int data_seed = 0;
    double noise = 0.0;
    void Describe(OptionSet* set) {
      DescribeSamples(2, 1e7, &num_samples, &data_seed, set);
      DescribeTargetNoise(&noise, set);
    }
  };

  // `data`: a and t, one sample a row.
  static bool Create(const Options& options,
                     const Eigen::MatrixXd* data,
                     LearningProblem* problem,
                     std::string* error);

  // t(a), not standardized.
  static double Target(double a);
};

}  // namespace invgrad

#endif  // PROBLEMS_REGRESSION_1D_H_
