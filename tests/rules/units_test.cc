// How the first step of a rule scales with the loss and with units: the closed
// forms of problems/linear_scale.h.

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "fmt/core.h"
#include "gtest/gtest.h"
#include "invgrad/core/hessian_times.h"
#include "invgrad/minimize/chain_objective.h"
#include "invgrad/rules/rules.h"
#include "problems/problems.h"

namespace invgrad {
namespace units_test {

// Along x_0, with step size one.
double FirstStep(const std::string& rule_text, double c, double u0, double u1) {
  PhysicsProblem problem;
  std::string error;
  EXPECT_TRUE(CreateProblem(
      fmt::format("linear_scale:c={}:unit_0={}:unit_1={}", c, u0, u1),
      nullptr,
      &problem,
      &error))
      << error;
  const std::unique_ptr<UpdateRule> rule = MakeRule(rule_text, &error);
  EXPECT_NE(rule, nullptr) << error;
  ChainObjective objective = problem.point->MakeObjective();
  Linearization at_start;
  Eigen::VectorXd step;
  EXPECT_TRUE(objective.Linearize(rule->Needs(), &at_start, &error)) << error;
  AddProductsAndTrials(
      rule->Needs(), objective.State(), AfterOf(&objective), &at_start);
  EXPECT_TRUE(rule->ComputeStep(at_start, &step, &error)) << error;
  return step[0];
}

struct Exponents {
  std::string rule;
  double of_loss;      // the step is proportional to c^p
  double of_its_unit;  // and to u_0^p
};

class Units : public testing::TestWithParam<Exponents> {};

TEST_P(Units, ScaleTheStepByThePowersOfTheConventions) {
  const Exponents& expected = GetParam();
  const auto exponent = [&](double c, double u0, double u1) {
    return std::log2(FirstStep(expected.rule, c, u0, u1) /
                     FirstStep(expected.rule, 1.0, 1.0, 1.0));
  };
  constexpr double kRounding = 1e-6;  // of Adam's epsilon
  EXPECT_NEAR(exponent(2.0, 1.0, 1.0), expected.of_loss, kRounding);
  EXPECT_NEAR(exponent(1.0, 2.0, 1.0), expected.of_its_unit, kRounding);
  // The other unknown's unit does not matter.
  EXPECT_NEAR(exponent(1.0, 1.0, 2.0), 0.0, kRounding);
}

INSTANTIATE_TEST_SUITE_P(
    Rules,
    Units,
    testing::Values(Exponents{"gradient_descent", 1.0, 1.0},
                    Exponents{"newton", 1.0, 1.0},
                    Exponents{"half_inverse", 1.0, -0.5},
                    Exponents{"layer_half_inverse", 1.0, -0.5},
                    Exponents{"power:kappa=0.75", 1.0, -0.75},
                    Exponents{"gauss_newton", 1.0, -1.0},
                    Exponents{"adam", 0.0, 0.0},
                    Exponents{"rmsprop", 0.0, 0.0},
                    Exponents{"adagrad", 0.0, 0.0}));

}  // namespace units_test
}  // namespace invgrad
