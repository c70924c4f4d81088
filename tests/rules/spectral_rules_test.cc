// The rules that decompose J.

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/linearization.h"
#include "invgrad/rules.h"
#include "tests/rules/quadratic.h"
#include "tests/rules/step_of.h"
#include "tests/support/least_squares.h"

namespace invgrad {
namespace spectral_rules_test {

using Eigen::VectorXd;

// (g, J) -> c (g, J) multiplies the step by c^(1 - kappa).
TEST(SpectralRules, ScalingLaw) {
  const Quadratic problem(5, 7);
  const Linearization at_x = problem.At(VectorXd::Ones(7));
  const double c = 7.0;
  Linearization scaled = at_x;
  scaled.loss_gradient = c * at_x.loss_gradient;
  scaled.jacobian = OneUnit(c * problem.A());
  const std::vector<std::pair<std::string, double>> cases = {
      {"half_inverse", 0.5},
      {"gauss_newton", 1.0},
      {"power:kappa=-1", -1.0},
      {"power:kappa=0.75", 0.75},
      {"levenberg_marquardt", 1.0},
      {"layer_half_inverse", 0.5},
      {"kfac_half_inverse", 0.5},
      {"kfac_half_inverse:kappa=1", 1.0}};
  for (const auto& [text, kappa] : cases) {
    const VectorXd step = std::pow(c, 1.0 - kappa) * StepOf(text, at_x);
    EXPECT_LE((StepOf(text, scaled) - step).norm(), 1e-12 * step.norm())
        << text;
  }
}

// The automatic step size undoes the factor: no step depends on it.
TEST(SpectralRules, AutomaticStepsDoNotDependOnTheScaleOfTheLoss) {
  const Quadratic problem(5, 7);
  const Linearization at_x = problem.At(VectorXd::Ones(7));
  Linearization scaled = at_x;
  scaled.loss_gradient = 7.0 * at_x.loss_gradient;
  scaled.jacobian = OneUnit(7.0 * problem.A());
  for (const std::string name : kSpectralRules) {
    const VectorXd step = StepOf(name + ":step_size=auto", at_x);
    EXPECT_LE((StepOf(name + ":step_size=auto", scaled) - step).norm(),
              1e-12 * step.norm())
        << name;
  }
  // Gauss-Newton's linear model is solved by a full step, so auto is rho.
  const VectorXd full = StepOf("gauss_newton", at_x);
  EXPECT_LE(
      (StepOf("gauss_newton:step_size=auto:rho=0.5", at_x) - 0.5 * full).norm(),
      1e-12 * full.norm());
}

TEST(SpectralRules, GaussNewtonIsLeastSquares) {
  for (const auto& [m, n] : {std::pair(7, 5), std::pair(5, 7)}) {
    const Quadratic problem(m, n);
    const Linearization at_x = problem.At(VectorXd::Ones(n));
    const VectorXd least_squares =
        -LeastSquares(problem.A(), at_x.loss_gradient);
    EXPECT_LE((StepOf("gauss_newton:route=svd", at_x) - least_squares).norm(),
              1e-13 * least_squares.norm());
    EXPECT_LE((StepOf("power:kappa=1", at_x) - least_squares).norm(),
              1e-12 * least_squares.norm());
    EXPECT_LE(
        (StepOf("levenberg_marquardt:relative_damping=0", at_x) - least_squares)
            .norm(),
        1e-12 * least_squares.norm());
  }
}

TEST(SpectralRules, KappaMinusOneIsGradientDescent) {
  const Quadratic problem(5, 7);
  const Linearization at_x = problem.At(VectorXd::Ones(7));
  const VectorXd step = StepOf("gradient_descent:step_size=0.1", at_x);
  for (const std::string route : {"auto:truncation=0", "svd", "gram"}) {
    EXPECT_LE(
        (StepOf("power:kappa=-1:step_size=0.1:route=" + route, at_x) - step)
            .norm(),
        1e-14 * step.norm())
        << route;
  }
}

TEST(SpectralRules, LevenbergMarquardtLimits) {
  const Quadratic problem(5, 7);
  const Linearization at_x = problem.At(VectorXd::Ones(7));
  const auto damped = [&](const std::string& damping) {
    return StepOf("levenberg_marquardt:relative_damping=0:damping=" + damping,
                  at_x);
  };
  const VectorXd gauss_newton = StepOf("gauss_newton", at_x);
  EXPECT_LE((damped("1e-10") - gauss_newton).norm(),
            1e-8 * gauss_newton.norm());
  const VectorXd gradient = at_x.gradient;
  EXPECT_LE((1e10 * damped("1e10") + gradient).norm(), 1e-8 * gradient.norm());
  EXPECT_GE((damped("1.0") - gauss_newton).norm(), 1e-2 * gauss_newton.norm());
}

TEST(SpectralRules, ReportsSayWhatWasDone) {
  const Quadratic problem(5, 7);
  const Linearization at_x = problem.At(VectorXd::Ones(7));
  const auto report = [&](const std::string& text) {
    const std::unique_ptr<UpdateRule> rule = MakeRule(text);
    EXPECT_EQ(rule->LastStepReport(), "");
    StepOf(rule.get(), at_x);
    return rule->LastStepReport();
  };
  EXPECT_EQ(report("half_inverse"), "route gram, rank 5 of 5");
  EXPECT_EQ(report("half_inverse:route=svd"), "route svd, rank 5 of 5");
  EXPECT_EQ(report("power:kappa=-1:truncation=0"), "route gradient");
  EXPECT_EQ(report("gauss_newton:step_size=auto"),
            "route gram, rank 5 of 5, step size 0.3");
  const std::string fallback = report("half_inverse:tolerance=1e-16");
  EXPECT_EQ(fallback.rfind("route svd, rank 5 of 5 (gram: estimated error ", 0),
            0u)
      << fallback;
}

}  // namespace spectral_rules_test
}  // namespace invgrad
