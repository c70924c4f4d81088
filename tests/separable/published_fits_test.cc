// Answers of other implementations.

#include <cmath>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/separable.h"
#include "tests/separable/exponentials.h"

namespace invgrad {
namespace published_fits_test {

// Minimizes, by both Jacobians.
double Solve(bool is_golub_pereyra, double* c, ceres::Problem* problem) {
  SeparableProblem::Options options;
  options.is_golub_pereyra = is_golub_pereyra;
  std::string error;
  const auto separable =
      SeparableProblem::Create(options, {{c, {}}}, problem, &error);
  EXPECT_NE(separable, nullptr) << error;
  ceres::Solver::Summary summary;
  ceres::Solve(Exact(), separable->reduced(), &summary);
  EXPECT_TRUE(separable->SolveLinear(&error)) << error;
  return summary.final_cost;
}

// c0 exp(-a1 t) cos(a2 t) + c1 exp(-a0 t) cos(a1 t): the features share a1.
struct Oscillations {
  double t, y, w;

  template <typename T>
  bool operator()(const T* c, const T* a, T* r) const {
    using std::cos;
    using std::exp;
    r[0] = w * (c[0] * exp(-a[1] * t) * cos(a[2] * t) +
                c[1] * exp(-a[0] * t) * cos(a[1] * t) - y);
    return true;
  }
};

// varpro_example.m of O'Leary, Rust. Variable projection for nonlinear least
// squares problems. Comput. Optim. Appl. 54 (2013): data, start, and the answer
// in 8 digits, of which the termination of varpro.m leaves about 6.
TEST(PublishedFits, OfOLearyAndRust) {
  const std::vector<double> t = {
      0.0, 0.1, 0.22, 0.31, 0.46, 0.50, 0.63, 0.78, 0.85, 0.97};
  const std::vector<double> y = {6.9842,
                                 5.1851,
                                 2.8907,
                                 1.4199,
                                 -0.2473,
                                 -0.5243,
                                 -1.0156,
                                 -1.0260,
                                 -0.9165,
                                 -0.6805};
  const std::vector<double> w = {
      1.0, 1.0, 1.0, 0.5, 0.5, 1.0, 0.5, 1.0, 0.5, 0.5};
  for (const bool is_golub_pereyra : {false, true}) {
    Eigen::Vector2d c(0.0, 0.0);
    Eigen::Vector3d a(0.5, 2.0, 3.0);
    ceres::Problem problem;
    for (int i = 0; i < 10; ++i) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Oscillations, 1, 2, 3>(
              new Oscillations{t[i], y[i], w[i]}),
          nullptr,
          c.data(),
          a.data());
    }
    Solve(is_golub_pereyra, c.data(), &problem);
    EXPECT_LE((c - Eigen::Vector2d(5.8416357, 1.1436854)).norm(), 2e-5);
    EXPECT_LE((a - Eigen::Vector3d(1.0132255, 2.4968675, 4.0625148)).norm(),
              2e-5);
  }
}

// c0 exp(-t / a0) + c1 exp(-t / a1) + c2
struct TwoDecaysAndOffset {
  double t, y;

  template <typename T>
  bool operator()(const T* c, const T* a, T* r) const {
    using std::exp;
    r[0] = c[0] * exp(-t / a[0]) + c[1] * exp(-t / a[1]) + c[2] - y;
    return true;
  }
};

// The example of the crate varpro (geo-ant/varpro, tests/integration_tests):
// 1024 samples without noise, the same start. It asserts 1e-8.
TEST(PublishedFits, OfTheCrateVarpro) {
  for (const bool is_golub_pereyra : {false, true}) {
    Eigen::Vector3d c(0.0, 0.0, 0.0);
    Eigen::Vector2d a(2.0, 6.5);
    ceres::Problem problem;
    for (int i = 0; i < 1024; ++i) {
      const double t = 12.5 * i / 1023.0;
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<TwoDecaysAndOffset, 1, 3, 2>(
              new TwoDecaysAndOffset{
                  t, 4.0 * std::exp(-t) + 2.5 * std::exp(-t / 3.0) + 1.0}),
          nullptr,
          c.data(),
          a.data());
    }
    Solve(is_golub_pereyra, c.data(), &problem);
    EXPECT_LE((c - Eigen::Vector3d(4.0, 2.5, 1.0)).norm(), 1e-8);
    EXPECT_LE((a - Eigen::Vector2d(1.0, 3.0)).norm(), 1e-8);
  }
}

// scipy 1.17.1, least_squares(f, x0, loss, f_scale=0.1, xtol=ftol=gtol=1e-15,
// jac="3-point") over all parameters, from three starts, which agree in 10
// digits of the cost and 7 of the parameters.
TEST(PublishedFits, OfScipy) {
  struct Expected {
    double cost;
    Eigen::Vector2d c;
    Eigen::Vector2d a;
  };
  const Expected linear = {
      0.4446278033214, {1.5055150, 1.5969907}, {3.3367668, 0.5183498}};
  const Expected soft_l1 = {
      0.1749175604718, {1.7575252, 1.3293057}, {2.6312624, 0.4798612}};
  for (const bool is_robust : {false, true}) {
    Eigen::Vector2d c(0.0, 0.0);
    Eigen::Vector2d a(2.0, 0.2);
    ceres::Problem problem;
    for (int i = 0; i < 40; ++i) {
      const double t = 0.1 * i;
      const double y = 2.0 * std::exp(-1.5 * t) + 0.7 * std::exp(-0.3 * t) +
                       0.05 * std::sin(7.0 * i) + (i % 10 == 0 ? 0.5 : 0.0);
      problem.AddResidualBlock(
          Exponentials::Cost(t, y),
          is_robust ? new ceres::SoftLOneLoss(0.1) : nullptr,
          c.data(),
          a.data());
    }
    const double cost = Solve(/*is_golub_pereyra=*/false, c.data(), &problem);
    const Expected& expected = is_robust ? soft_l1 : linear;
    EXPECT_NEAR(cost, expected.cost, 1e-12);
    EXPECT_LE((c - expected.c).norm(), 1e-6);
    EXPECT_LE((a - expected.a).norm(), 1e-6);
  }
}

}  // namespace published_fits_test
}  // namespace invgrad
