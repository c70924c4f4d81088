// The first-order rules against steps computed by hand. The large epsilons show
// where it is added.
#include "invgrad/rules/first_order_rules.h"

#include <cmath>
#include <limits>
#include <string>

#include "gtest/gtest.h"

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
  VectorXd step;
  std::string error;
  EXPECT_TRUE(rule->ComputeStep(at_x, &step, &error)) << error;
  return step;
}

double ScalarStep(UpdateRule* rule, double gradient) {
  return StepFor(rule, VectorXd::Constant(1, gradient))[0];
}

TEST(GradientDescent, PlainStep) {
  GradientDescent rule(GradientDescent::Options{});
  EXPECT_EQ(ScalarStep(&rule, 3.0), -0.03);
  EXPECT_EQ(ScalarStep(&rule, -1.0), 0.01);
}

TEST(GradientDescent, MomentumAddsUp) {
  GradientDescent::Options options;
  options.step_size.step_size = 0.1;
  options.momentum = 0.5;
  GradientDescent rule(options);
  EXPECT_DOUBLE_EQ(ScalarStep(&rule, 2.0), -0.2);
  EXPECT_DOUBLE_EQ(ScalarStep(&rule, 4.0), -0.5);   // v = 5
  EXPECT_DOUBLE_EQ(ScalarStep(&rule, 0.0), -0.25);  // v = 2.5
}

TEST(GradientDescent, NesterovLooksAhead) {
  GradientDescent::Options options;
  options.step_size.step_size = 0.1;
  options.momentum = 0.5;
  options.nesterov = true;
  GradientDescent rule(options);
  EXPECT_DOUBLE_EQ(ScalarStep(&rule, 2.0), -0.3);   // 2 + 0.5 * 2
  EXPECT_DOUBLE_EQ(ScalarStep(&rule, 4.0), -0.65);  // 4 + 0.5 * 5
}

TEST(GradientDescent, TheVelocityDoesNotRememberTheStepSize) {
  GradientDescent::Options options;
  options.step_size.step_size = 1.0;
  options.step_size.schedule = "linear";
  options.step_size.final_fraction = 0.5;
  options.momentum = 0.5;
  GradientDescent rule(options);
  StepFor(&rule, VectorXd::Constant(1, 2.0), 0.0);
  EXPECT_DOUBLE_EQ(StepFor(&rule, VectorXd::Constant(1, 0.0), 1.0)[0], -0.5);
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
  GradientDescent rule(GradientDescent::Options{});
  Vector2d x(3.0, 3.0);
  for (const Vector2d& expected : printed) {
    x += StepFor(&rule, Vector2d(2.0 * x[0], 4.0 * std::pow(x[1], 3)));
    EXPECT_LE((x - expected).norm(), 1e-6);
  }
  EXPECT_NEAR(x[0], 2.45121842066264, 1e-13);
  EXPECT_NEAR(x[1], 0.961711524440409, 1e-13);
}

TEST(Adam, BiasCorrectedSteps) {
  Adam::Options options;
  options.step_size.step_size = 0.5;
  options.epsilon = 0.1;
  Adam rule(options);
  // m / 0.1 = 2, v / 0.001 = 4.
  EXPECT_NEAR(ScalarStep(&rule, 2.0), -0.5 * 2.0 / (2.0 + 0.1), 1e-14);
  // m = 0.9 * 0.2 - 0.1, v = 0.999 * 0.004 + 0.001.
  EXPECT_NEAR(ScalarStep(&rule, -1.0),
              -0.5 * (0.08 / 0.19) / (std::sqrt(0.004996 / 0.001999) + 0.1),
              1e-13);
}

TEST(Adam, AConstantGradientOfAnySizeGivesStepsOfEta) {
  Adam rule(Adam::Options{});
  for (int k = 0; k < 100; ++k) {
    const VectorXd step = StepFor(&rule, Vector2d(1e6, -1e3));
    // epsilon / 1e3 is below 1e-11.
    EXPECT_NEAR(step[0], -1e-3, 1e-13);
    EXPECT_NEAR(step[1], 1e-3, 1e-13);
  }
}

TEST(RmsProp, Steps) {
  RmsProp::Options options;
  options.step_size.step_size = 0.5;
  options.decay = 0.75;
  options.epsilon = 0.1;
  RmsProp rule(options);
  EXPECT_DOUBLE_EQ(ScalarStep(&rule, 2.0), -0.5 * 2.0 / (1.0 + 0.1));  // v = 1
  EXPECT_DOUBLE_EQ(ScalarStep(&rule, 1.0), -0.5 / (1.0 + 0.1));        // v = 1
  options.momentum = 0.5;
  RmsProp with_momentum(options);
  EXPECT_DOUBLE_EQ(ScalarStep(&with_momentum, 2.0), -0.5 * 2.0 / 1.1);
  EXPECT_DOUBLE_EQ(ScalarStep(&with_momentum, 1.0),
                   -0.5 * (0.5 * 2.0 / 1.1 + 1.0 / 1.1));
}

TEST(Adagrad, Steps) {
  Adagrad::Options options;
  options.step_size.step_size = 0.5;
  options.epsilon = 0.1;
  Adagrad rule(options);
  EXPECT_DOUBLE_EQ(ScalarStep(&rule, 3.0), -0.5 * 3.0 / 3.1);
  EXPECT_DOUBLE_EQ(ScalarStep(&rule, -4.0), 0.5 * 4.0 / 5.1);
  options.initial_sum = 7.0;
  Adagrad with_sum(options);
  EXPECT_DOUBLE_EQ(ScalarStep(&with_sum, 3.0), -0.5 * 3.0 / 4.1);
}

TEST(Adadelta, Steps) {
  Adadelta::Options options;
  options.step_size.step_size = 0.5;
  options.decay = 0.75;
  options.epsilon = 0.25;
  Adadelta rule(options);
  // v = 1, u = 0: delta = sqrt(0.25 / 1.25) 2.
  const double first = 2.0 * std::sqrt(0.25 / 1.25);
  EXPECT_DOUBLE_EQ(ScalarStep(&rule, 2.0), -0.5 * first);
  // v = 1, u = 0.25 * 0.8.
  EXPECT_DOUBLE_EQ(ScalarStep(&rule, 1.0), -0.5 * std::sqrt(0.45 / 1.25));
}

TEST(FirstOrderRules, DefaultsArePyTorchs) {
  EXPECT_EQ(GradientDescent::Options{}.step_size.step_size, 0.01);
  EXPECT_EQ(GradientDescent::Options{}.momentum, 0.0);
  EXPECT_FALSE(GradientDescent::Options{}.nesterov);
  EXPECT_EQ(Adam::Options{}.step_size.step_size, 1e-3);
  EXPECT_EQ(Adam::Options{}.beta1, 0.9);
  EXPECT_EQ(Adam::Options{}.beta2, 0.999);
  EXPECT_EQ(Adam::Options{}.epsilon, 1e-8);
  EXPECT_EQ(RmsProp::Options{}.step_size.step_size, 0.01);
  EXPECT_EQ(RmsProp::Options{}.decay, 0.99);
  EXPECT_EQ(RmsProp::Options{}.momentum, 0.0);
  EXPECT_EQ(RmsProp::Options{}.epsilon, 1e-8);
  EXPECT_EQ(Adagrad::Options{}.step_size.step_size, 0.01);
  EXPECT_EQ(Adagrad::Options{}.initial_sum, 0.0);
  EXPECT_EQ(Adagrad::Options{}.epsilon, 1e-10);
  EXPECT_EQ(Adadelta::Options{}.step_size.step_size, 1.0);
  EXPECT_EQ(Adadelta::Options{}.decay, 0.9);
  EXPECT_EQ(Adadelta::Options{}.epsilon, 1e-6);
}

// Without a check, 1e200 squared would make every later step zero.
TEST(FirstOrderRules, RefuseAGradientWhoseSquareOverflows) {
  Adam adam(Adam::Options{});
  RmsProp rmsprop(RmsProp::Options{});
  Adagrad adagrad(Adagrad::Options{});
  Adadelta adadelta(Adadelta::Options{});
  for (UpdateRule* rule : {static_cast<UpdateRule*>(&adam),
                           static_cast<UpdateRule*>(&rmsprop),
                           static_cast<UpdateRule*>(&adagrad),
                           static_cast<UpdateRule*>(&adadelta)}) {
    Linearization at_x;
    at_x.gradient = Vector2d(1.0, 1e200);
    VectorXd step;
    std::string error;
    EXPECT_FALSE(rule->ComputeStep(at_x, &step, &error));
    EXPECT_EQ(error, "the squared gradient is not finite: entry 1 is inf");
  }
}

TEST(FirstOrderRulesDeathTest, BadOptionsAndChangedSizesAreChecked) {
  Adam::Options options;
  options.beta1 = 1.0;
  EXPECT_DEATH(Adam{options}, "beta1=1 is out of range; allowed: \\[0, 1\\)");
  options = Adam::Options();
  options.step_size.step_size = std::numeric_limits<double>::quiet_NaN();
  EXPECT_DEATH(Adam{options}, "step_size=nan is not a finite number");
  options.step_size.step_size = std::nullopt;
  EXPECT_DEATH(Adam{options}, "no automatic step size");
  Adam rule(Adam::Options{});
  StepFor(&rule, VectorXd::Ones(2));
  EXPECT_DEATH(StepFor(&rule, VectorXd::Ones(3)), "number of unknowns");
}

}  // namespace first_order_rules_test
}  // namespace invgrad
