// Rosenbrock's function, L = 1/2 |r|^2 with r = (1 - x, 10 (y - x^2)), for
// tests: from (-1.2, 1) to its minimum 0 at (1, 1).
#ifndef INVGRAD_TESTS_SUPPORT_ROSENBROCK_H_
#define INVGRAD_TESTS_SUPPORT_ROSENBROCK_H_

#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"

namespace invgrad {

// Of one block of two numbers or of two blocks of one.
struct Rosenbrock {
  template <typename T>
  bool operator()(const T* x, const T* y, T* r) const {
    r[0] = 1.0 - x[0];
    r[1] = 10.0 * (y[0] - x[0] * x[0]);
    return true;
  }
  template <typename T>
  bool operator()(const T* x, T* r) const {
    return (*this)(x, x + 1, r);
  }
};

struct RosenbrockProblem {
  double x[2] = {-1.2, 1.0};
  ceres::Problem problem;
  explicit RosenbrockProblem(
      ceres::CostFunction* cost =
          new ceres::AutoDiffCostFunction<Rosenbrock, 2, 2>(new Rosenbrock)) {
    problem.AddResidualBlock(cost, nullptr, x);
  }
};

struct TwoBlockRosenbrock {
  double x = -1.2;
  double y = 1.0;
  ceres::Problem problem;
  explicit TwoBlockRosenbrock(
      ceres::CostFunction* cost =
          new ceres::AutoDiffCostFunction<Rosenbrock, 2, 1, 1>(
              new Rosenbrock)) {
    problem.AddResidualBlock(cost, nullptr, &x, &y);
  }
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SUPPORT_ROSENBROCK_H_
