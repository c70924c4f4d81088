// The first-order rules against steps computed by hand. The large epsilons show
// where it is added.

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "tests/rules/step_of.h"

namespace invgrad {
namespace first_order_rules_test {

using Eigen::Vector2d;
using Eigen::VectorXd;

VectorXd StepFor(UpdateRule* rule,
                 const VectorXd& gradient,
                 double progress = 0.0) {
  Linearization at_x;
  at_x.gradient = gradient;
  at_x.progress = progress;
  return StepOf(rule, at_x);
}

double ScalarStep(const std::unique_ptr<UpdateRule>& rule, double gradient) {
  return StepFor(rule.get(), VectorXd::Constant(1, gradient))[0];
}

TEST(GradientDescent, PlainStep) {
  const auto rule = MakeRule("gradient_descent");
  EXPECT_EQ(ScalarStep(rule, 3.0), -0.03);
  EXPECT_EQ(ScalarStep(rule, -1.0), 0.01);
}

TEST(GradientDescent, MomentumAddsUp) {
  const auto rule = MakeRule("gradient_descent:step_size=0.1:momentum=0.5");
  EXPECT_DOUBLE_EQ(ScalarStep(rule, 2.0), -0.2);
  EXPECT_DOUBLE_EQ(ScalarStep(rule, 4.0), -0.5);   // v = 5
  EXPECT_DOUBLE_EQ(ScalarStep(rule, 0.0), -0.25);  // v = 2.5
}

TEST(GradientDescent, NesterovLooksAhead) {
  const auto rule =
      MakeRule("gradient_descent:step_size=0.1:momentum=0.5:nesterov=true");
  EXPECT_DOUBLE_EQ(ScalarStep(rule, 2.0), -0.3);   // 2 + 0.5 * 2
  EXPECT_DOUBLE_EQ(ScalarStep(rule, 4.0), -0.65);  // 4 + 0.5 * 5
}

TEST(GradientDescent, TheVelocityDoesNotRememberTheStepSize) {
  const auto rule = MakeRule(
      "gradient_descent:step_size=1:schedule=linear:final_fraction=0.5:"
      "momentum=0.5");
  StepFor(rule.get(), VectorXd::Constant(1, 2.0), 0.0);
  EXPECT_DOUBLE_EQ(StepFor(rule.get(), VectorXd::Constant(1, 0.0), 1.0)[0],
                   -0.5);
}

// x = (3, 3), L = x1^2 + x2^4, eta = 0.01: the iterates that the book
// "Physics-based Deep Learning" (arXiv 2109.05237, chapter on comparing
// physical gradients) prints, in single precision; the last in double.
TEST(GradientDescent, PublishedIterates) {
  const Vector2d printed[] = {{2.94, 1.9200001},
                              {2.8812, 1.6368846},
                              {2.823576, 1.4614503},
                              {2.7671044, 1.3365935},
                              {2.7117622, 1.2410815},
                              {2.657527, 1.1646168},
                              {2.6043763, 1.1014326},
                              {2.5522888, 1.0479842},
                              {2.501243, 1.0019454},
                              {2.4512184, 0.96171147}};
  const auto rule = MakeRule("gradient_descent");
  Vector2d x(3.0, 3.0);
  for (const Vector2d& expected : printed) {
    x += StepFor(rule.get(), Vector2d(2.0 * x[0], 4.0 * std::pow(x[1], 3)));
    EXPECT_LE((x - expected).norm(), 1e-6);
  }
  EXPECT_NEAR(x[0], 2.45121842066264, 1e-13);
  EXPECT_NEAR(x[1], 0.961711524440409, 1e-13);
}

TEST(Adam, BiasCorrectedSteps) {
  const auto rule = MakeRule("adam:step_size=0.5:epsilon=0.1");
  // m / 0.1 = 2, v / 0.001 = 4.
  EXPECT_NEAR(ScalarStep(rule, 2.0), -0.5 * 2.0 / (2.0 + 0.1), 1e-14);
  // m = 0.9 * 0.2 - 0.1, v = 0.999 * 0.004 + 0.001.
  EXPECT_NEAR(ScalarStep(rule, -1.0),
              -0.5 * (0.08 / 0.19) / (std::sqrt(0.004996 / 0.001999) + 0.1),
              1e-13);
}

TEST(Adam, AConstantGradientOfAnySizeGivesStepsOfEta) {
  const auto rule = MakeRule("adam");
  for (int k = 0; k < 100; ++k) {
    const VectorXd step = StepFor(rule.get(), Vector2d(1e6, -1e3));
    // epsilon / 1e3 is below 1e-11.
    EXPECT_NEAR(step[0], -1e-3, 1e-13);
    EXPECT_NEAR(step[1], 1e-3, 1e-13);
  }
}

TEST(RmsProp, Steps) {
  const std::string text = "rmsprop:step_size=0.5:decay=0.75:epsilon=0.1";
  const auto rule = MakeRule(text);
  EXPECT_DOUBLE_EQ(ScalarStep(rule, 2.0), -0.5 * 2.0 / (1.0 + 0.1));  // v = 1
  EXPECT_DOUBLE_EQ(ScalarStep(rule, 1.0), -0.5 / (1.0 + 0.1));        // v = 1
  const auto with_momentum = MakeRule(text + ":momentum=0.5");
  EXPECT_DOUBLE_EQ(ScalarStep(with_momentum, 2.0), -0.5 * 2.0 / 1.1);
  EXPECT_DOUBLE_EQ(ScalarStep(with_momentum, 1.0),
                   -0.5 * (0.5 * 2.0 / 1.1 + 1.0 / 1.1));
}

TEST(Adagrad, Steps) {
  const std::string text = "adagrad:step_size=0.5:epsilon=0.1";
  const auto rule = MakeRule(text);
  EXPECT_DOUBLE_EQ(ScalarStep(rule, 3.0), -0.5 * 3.0 / 3.1);
  EXPECT_DOUBLE_EQ(ScalarStep(rule, -4.0), 0.5 * 4.0 / 5.1);
  const auto with_sum = MakeRule(text + ":initial_sum=7");
  EXPECT_DOUBLE_EQ(ScalarStep(with_sum, 3.0), -0.5 * 3.0 / 4.1);
}

TEST(Adadelta, Steps) {
  const auto rule = MakeRule("adadelta:step_size=0.5:decay=0.75:epsilon=0.25");
  // v = 1, u = 0: delta = sqrt(0.25 / 1.25) 2.
  const double first = 2.0 * std::sqrt(0.25 / 1.25);
  EXPECT_DOUBLE_EQ(ScalarStep(rule, 2.0), -0.5 * first);
  // v = 1, u = 0.25 * 0.8.
  EXPECT_DOUBLE_EQ(ScalarStep(rule, 1.0), -0.5 * std::sqrt(0.45 / 1.25));
}

TEST(FirstOrderRules, DefaultsArePyTorchs) {
  using Values = std::vector<std::pair<std::string, std::string>>;
  const auto defaults = [](const std::string& name) {
    Values values;
    for (const OptionSet::Row& option : FindRule(name)->options()) {
      if (option.name == "schedule" || option.name == "final_fraction")
        continue;
      values.emplace_back(option.name, option.default_value);
    }
    return values;
  };
  EXPECT_EQ(
      defaults("gradient_descent"),
      (Values{
          {"step_size", "0.01"}, {"momentum", "0"}, {"nesterov", "false"}}));
  EXPECT_EQ(defaults("adam"),
            (Values{{"step_size", "0.001"},
                    {"beta1", "0.9"},
                    {"beta2", "0.999"},
                    {"epsilon", "1e-08"}}));
  EXPECT_EQ(defaults("rmsprop"),
            (Values{{"step_size", "0.01"},
                    {"decay", "0.99"},
                    {"momentum", "0"},
                    {"epsilon", "1e-08"}}));
  EXPECT_EQ(
      defaults("adagrad"),
      (Values{
          {"step_size", "0.01"}, {"initial_sum", "0"}, {"epsilon", "1e-10"}}));
  EXPECT_EQ(
      defaults("adadelta"),
      (Values{{"step_size", "1"}, {"decay", "0.9"}, {"epsilon", "1e-06"}}));
}

// Without a check, 1e200 squared would make every later step zero.
TEST(FirstOrderRules, RefuseAGradientWhoseSquareOverflows) {
  for (const char* name : {"adam", "rmsprop", "adagrad", "adadelta"}) {
    const auto rule = MakeRule(name);
    Linearization at_x;
    at_x.gradient = Vector2d(1.0, 1e200);
    VectorXd step;
    std::string error;
    EXPECT_FALSE(rule->ComputeStep(at_x, &step, &error));
    EXPECT_EQ(error, "the squared gradient is not finite: entry 1 is inf");
  }
}

TEST(FirstOrderRules, RefuseOptionsOutOfRange) {
  std::string error;
  EXPECT_EQ(MakeRule("adam:beta1=1", &error), nullptr);
  EXPECT_EQ(error, "adam: beta1=1 is out of range; allowed: [0, 1)");
  EXPECT_EQ(MakeRule("adam:step_size=nan", &error), nullptr);
  EXPECT_EQ(error,
            "adam: step_size=nan is not a finite number; allowed: (0, inf)");
}

TEST(FirstOrderRulesDeathTest, ChangedSizesAreChecked) {
  const auto rule = MakeRule("adam");
  StepFor(rule.get(), VectorXd::Ones(2));
  EXPECT_DEATH(StepFor(rule.get(), VectorXd::Ones(3)), "number of unknowns");
}

}  // namespace first_order_rules_test
}  // namespace invgrad
