// Inverting the exponential function: the sensitivity decreases by five orders
// of magnitude.
//
//   y = exp(x),   L = 1/2 (y - y*)^2,   y* = exp(x*),   x* uniform in (-12, 0]
//
// Shapes:  network 1-16-64-16-1, sigmoid, 2,177 weights, its input is y*;
//          x, y: 1.
// Data:    np.random.seed(data_seed); x* = -12 np.random.rand(2 N), the first N
//          for training; x* is the data's solution.
// Inverse: log y, global; y <= 0 has no pre-image.
// Metric:  mean |x - x*|.
// Methods: the five methods of the paper are gradient_descent;
//          newton/newton/gradient_descent with max_loss_change=1e300, with
//          max_change=0.1, with newton_damping; and
//          newton/inverse/gradient_descent with proxy=l1, whose gradient is
//          sign(x - x*).
// Source:  Holl, Koltun, Thuerey, NeurIPS 2022, section 3, arXiv 2109.15048,
//          and its code, exp/.
#ifndef PROBLEMS_EXPONENTIAL_H_
#define PROBLEMS_EXPONENTIAL_H_

#include <cmath>
#include <memory>
#include <optional>
#include <string>

#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/sample_data.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/loss.h"

namespace invgrad {

struct Exponential {
  double range = 12.0;
  int num_samples = 10000;
  int data_seed = 0;
  void Describe(OptionSet* set) {
    set->Add("range", &range, {0.0, 700.0, true}, "x* is in (-range, 0]");
    DescribeSamples(1, 1e7, &num_samples, &data_seed, set);
  }

  struct Physics {
    template <typename T>
    bool operator()(const T* x, T* y) const {
      using std::exp;
      y[0] = exp(x[0]);
      return true;
    }
  };

  bool Create(LearningProblem* problem, std::string* error) const {
    if (!MakeUniformData(
            {num_samples, 1, 3.0}, 0.0, -range, data_seed, problem, error)) {
      return false;
    }
    DataSet all;
    all.solutions = problem->data.transpose();
    all.targets = all.solutions.array().exp();
    all.inputs = all.targets;
    SplitSamples(all, 100, problem);
    problem->model = std::make_shared<Model>(
        DenseNetwork({1, 16, 64, 16, 1}, Activation::kSigmoid),
        std::make_shared<AutoDiffSimulator<Physics, 1, 1>>(),
        std::make_shared<SquaredNormLoss>(1, 0.5),
        Reduction::kMean);
    problem->inverse =
        Inverse([](const auto& y,
                   const auto& /*x_now*/) -> std::optional<Eigen::VectorXd> {
          if (!(y[0] > 0.0)) return std::nullopt;
          return Eigen::VectorXd::Constant(1, std::log(y[0]));
        });
    problem->metric = SolutionDistance("distance");
    return true;
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_EXPONENTIAL_H_
