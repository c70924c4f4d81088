// Parabolas and the simplest rules, for tests of Minimize.
#ifndef INVGRAD_TESTS_MINIMIZE_PARABOLA_H_
#define INVGRAD_TESTS_MINIMIZE_PARABOLA_H_

#include <string>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "invgrad/minimize.h"
#include "tests/support/function_rule.h"
#include "tests/support/least_squares.h"

namespace invgrad {

// r = factor (x - target), the minimum is at `target`.
struct Offset {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = factor * (x[0] - target);
    return true;
  }
  double factor;
  double target;
};

struct Line {
  double x = 3.0;
  ceres::Problem problem;
  ceres::ResidualBlockId Add(double factor, double target) {
    return problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Offset, 1, 1>(
            new Offset{factor, target}),
        nullptr,
        &x);
  }
};

inline MinimizerOptions NoTolerances(int max_num_iterations) {
  MinimizerOptions options;
  options.max_num_iterations = max_num_iterations;
  options.gradient_tolerance = 0.0;
  options.function_tolerance = 0.0;
  options.parameter_tolerance = 0.0;
  return options;
}

inline FunctionRule GradientDescent(double step_size) {
  return FunctionRule([step_size](const auto& at_x, auto* step, std::string*) {
    *step = -step_size * at_x.gradient;
    return true;
  });
}

inline FunctionRule GaussNewton() {
  return {LinearizationParts::Jacobian(),
          [](const auto& at_x, auto* step, std::string*) {
            Eigen::MatrixXd J;
            at_x.jacobian->ToDense(&J);
            *step = -LeastSquares(J, at_x.loss_gradient);
            return true;
          }};
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_MINIMIZE_PARABOLA_H_
