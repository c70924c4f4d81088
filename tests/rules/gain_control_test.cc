#include "invgrad/rules/gain_control.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/stored_jacobian.h"
#include "tests/support/spectral_reference.h"

namespace invgrad {
namespace gain_control_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

GainControl MakeControl(const std::string& adapts,
                        double kappa = 0.5,
                        double relative_damping = 0.0) {
  GainControlOptions options;
  options.control = "gain";
  options.adapts = adapts;
  SpectralFilter filter = SpectralFilter::Power(kappa, 1e-6);
  filter.relative_damping = relative_damping;
  return {options, filter};
}

// L(eta) = L(0) + slope eta + curvature eta^2 / 2.
AlongDirection ModelOf(double slope, double curvature) {
  AlongDirection model;
  model.unit = 1.0;
  model.slope = slope;
  model.curvature = curvature;
  return model;
}

// A step from the cost 1, of which a decrease of 1/2 was promised, that has
// this gain.
bool JudgeGain(GainControl* control, double gain) {
  control->Expect(1.0, ModelOf(-1.0, 1.0), 1.0);
  const bool is_kept = control->Judge(1.0 - 0.5 * gain, 1.0);
  EXPECT_NEAR(control->last_gain(), gain, 1e-14);
  return is_kept;
}

// L = 1/2 |A x - b|^2 is its own model, however long the step is.
TEST(GainControl, TheGainOfLinearLeastSquaresIsOne) {
  RandomMatrices random(3);
  const MatrixXd A =
      MatrixXd::NullaryExpr(6, 4, [&]() { return random.Vector(1)[0]; });
  const VectorXd b = random.Vector(6);
  const auto cost = [&](const VectorXd& x) {
    return 0.5 * (A * x - b).squaredNorm();
  };
  const VectorXd x = random.Vector(4);
  Linearization at_x;
  at_x.cost = cost(x);
  at_x.loss_gradient = A * x - b;
  at_x.jacobian = std::make_shared<DenseJacobian>(A);
  const VectorXd d = -A.transpose() * at_x.loss_gradient;
  AlongDirection model;
  std::string error;
  ASSERT_TRUE(ModelAlong(at_x, d, &model, &error)) << error;
  double best = 0.0;
  ASSERT_TRUE(AutoStepSize(model, 1.0, &best, &error)) << error;
  for (const double part : {1e-6, 0.3, 1.0, 1.9}) {
    for (const double fraction : {1.0, 0.5}) {
      GainControl control = MakeControl("both");
      double kappa = 0.5;
      double damping = control.filter().relative_damping;
      EXPECT_EQ(damping, 1e-6);
      for (int k = 0; k < 40; ++k) {
        control.Expect(at_x.cost, model, part * best);
        ASSERT_TRUE(
            control.Judge(cost(x + fraction * part * best * d), fraction));
        ASSERT_NEAR(control.last_gain(), 1.0, 1e-8);
        kappa = std::min(kappa + 0.02, 1.0);
        damping = std::max(damping / 3.0, 1e-14);
        EXPECT_NEAR(control.filter().kappa, kappa, 1e-14);
        EXPECT_NEAR(control.filter().relative_damping / damping, 1.0, 1e-12);
        EXPECT_EQ(control.step_factor(), 1.0);
      }
      EXPECT_EQ(kappa, 1.0);
      EXPECT_EQ(damping, 1e-14);
    }
  }
}

TEST(GainControl, AGainInBetweenLeavesTheExponent) {
  GainControl control = MakeControl("exponent", 0.5, 1e-3);
  for (const double gain : {0.41, 0.6, 0.84}) {
    EXPECT_TRUE(JudgeGain(&control, gain));
    EXPECT_EQ(control.filter().kappa, 0.5);
    EXPECT_EQ(control.step_factor(), 1.0);
  }
}

// Nielsen's law: a smooth factor, 1 at a gain of 1/2, between 1/3 and 2.
TEST(GainControl, TheDampingFollowsTheGainSmoothly) {
  const auto factor = [](double gain) {
    GainControl control = MakeControl("damping", 1.0, 1e-3);
    JudgeGain(&control, gain);
    return control.filter().relative_damping / 1e-3;
  };
  EXPECT_NEAR(factor(0.5), 1.0, 1e-12);
  EXPECT_NEAR(factor(0.25), 1.125, 1e-12);
  EXPECT_NEAR(factor(0.75), 0.875, 1e-12);
  EXPECT_NEAR(factor(1e-9), 2.0, 1e-7);
  EXPECT_NEAR(factor(1.0), 1.0 / 3.0, 1e-12);
  EXPECT_NEAR(factor(3.0), 1.0 / 3.0, 1e-12);
  EXPECT_NEAR(factor(-1e-9), 4.0, 1e-12);
}

TEST(GainControl, ALowGainLowersTheExponentAndRaisesTheDamping) {
  GainControl control = MakeControl("both", 0.5, 1e-3);
  EXPECT_TRUE(JudgeGain(&control, 0.25));
  EXPECT_DOUBLE_EQ(control.filter().kappa, 0.45);
  EXPECT_DOUBLE_EQ(control.filter().relative_damping, 1.125e-3);
  EXPECT_EQ(control.step_factor(), 1.0) << "the step was kept";
  for (int k = 0; k < 40; ++k) JudgeGain(&control, 0.1);
  EXPECT_EQ(control.filter().kappa, 0.3);
  EXPECT_EQ(control.filter().relative_damping, 100.0);
  // And up again.
  JudgeGain(&control, 1.0);
  EXPECT_DOUBLE_EQ(control.filter().kappa, 0.32);
  EXPECT_DOUBLE_EQ(control.filter().relative_damping, 100.0 / 3.0);
}

// A setting outside of the range of control is moved towards it, if at all.
TEST(GainControl, SettingsOutsideOfItsRange) {
  GainControl low = MakeControl("both", -0.5, 1e-20);
  JudgeGain(&low, -0.1);
  EXPECT_EQ(low.filter().kappa, -0.5);
  EXPECT_DOUBLE_EQ(low.filter().relative_damping, 4e-14);
  JudgeGain(&low, 1.0);
  EXPECT_DOUBLE_EQ(low.filter().kappa, -0.48);
  GainControl high = MakeControl("both", 1.0, 0.0);
  JudgeGain(&high, 1.0);
  EXPECT_EQ(high.filter().kappa, 1.0);
  JudgeGain(&high, 0.1);
  EXPECT_DOUBLE_EQ(high.filter().kappa, 0.95);
}

TEST(GainControl, AdaptsWhatItIsTold) {
  for (const std::string adapts : {"nothing", "exponent", "damping", "both"}) {
    SCOPED_TRACE(adapts);
    GainControl control = MakeControl(adapts, 0.5, 0.0);
    const bool exponent = adapts == "exponent" || adapts == "both";
    const bool damping = adapts == "damping" || adapts == "both";
    EXPECT_EQ(control.filter().kappa, 0.5);
    EXPECT_EQ(control.filter().relative_damping, damping ? 1e-6 : 0.0);
    EXPECT_FALSE(JudgeGain(&control, -0.1));
    EXPECT_DOUBLE_EQ(control.filter().kappa, exponent ? 0.45 : 0.5);
    EXPECT_DOUBLE_EQ(control.filter().relative_damping, damping ? 4e-6 : 0.0);
    EXPECT_EQ(control.step_factor(), 0.5);
    // The rest of the filter is the rule's.
    EXPECT_EQ(control.filter().tau, 1e-6);
  }
}

TEST(GainControl, TakenBackStepsHalveTheStepSize) {
  GainControl control = MakeControl("nothing");
  for (const double expected : {0.5, 0.25, 0.125}) {
    EXPECT_FALSE(JudgeGain(&control, -1e-3));
    EXPECT_EQ(control.step_factor(), expected);
  }
  for (const double expected : {0.25, 0.5, 1.0, 1.0}) {
    EXPECT_TRUE(JudgeGain(&control, 0.8));
    EXPECT_EQ(control.step_factor(), expected);
  }
}

// Many batches that are at their minimum, or a bad start, do not end a run.
TEST(GainControl, TheStepSizeRecovers) {
  GainControl control = MakeControl("nothing");
  for (int k = 0; k < 100; ++k) JudgeGain(&control, -1.0);
  EXPECT_EQ(control.step_factor(), 1e-12);
  // Of such short steps nothing is promised beyond rounding.
  for (int k = 0; k < 40; ++k) {
    control.Expect(1.0, ModelOf(-1.0, 1.0), 1e-2 * control.step_factor());
    EXPECT_TRUE(control.Judge(1.0, 1.0));
  }
  EXPECT_EQ(control.step_factor(), 1.0);
}

TEST(GainControl, ACostThatIsNotFiniteIsTakenBack) {
  for (const double cost : {kNaN, kInfinity}) {
    GainControl control = MakeControl("both", 0.5, 1e-3);
    control.Expect(1.0, ModelOf(-1.0, 1.0), 1.0);
    EXPECT_FALSE(control.Judge(cost, 1.0));
    EXPECT_EQ(control.last_gain(), -kInfinity);
    EXPECT_EQ(control.step_factor(), 0.5);
    EXPECT_DOUBLE_EQ(control.filter().kappa, 0.45);
    EXPECT_DOUBLE_EQ(control.filter().relative_damping, 4e-3);
    // Even where nothing was promised.
    control.Expect(1.0, AlongDirection(), 1.0);
    EXPECT_FALSE(control.Judge(cost, 1.0));
  }
}

// What drowns in the rounding of the cost is no evidence.
TEST(GainControl, PromisesBelowRounding) {
  GainControl control = MakeControl("both", 0.5, 1e-3);
  const VectorXd before = *control.mutable_state();
  for (const double change : {-1e-3, -4e-14, 0.0, 4e-14}) {
    control.Expect(1.0, ModelOf(-1.0, 1.0), 1e-14);
    EXPECT_TRUE(control.Judge(1.0 + change, 1.0)) << change;
    EXPECT_EQ(*control.mutable_state(), before);
  }
  // A step of zero, at a minimum.
  control.Expect(1.0, AlongDirection(), 1.0);
  EXPECT_TRUE(control.Judge(1.0, 1.0));
  EXPECT_EQ(*control.mutable_state(), before);
  // But what gets worse by more is no rounding.
  control.Expect(1.0, ModelOf(-1.0, 1.0), 1e-14);
  EXPECT_FALSE(control.Judge(1.0 + 1e-9, 1.0));
  EXPECT_EQ(control.step_factor(), 0.5);
}

// The model has its minimum at 1, and at 3 it promises 1.5 more than at 0.
TEST(GainControl, AStepThatGoesTooFarForTheModel) {
  GainControl control = MakeControl("both", 0.5, 1e-3);
  control.Expect(1.0, ModelOf(-1.0, 1.0), 3.0);
  EXPECT_TRUE(control.Judge(0.9, 1.0)) << "the cost fell nonetheless";
  control.Expect(1.0, ModelOf(-1.0, 1.0), 3.0);
  EXPECT_FALSE(control.Judge(2.5, 1.0)) << "as promised, but worse";
  EXPECT_EQ(control.step_factor(), 0.5);
  // A part of it may be another matter: 1 - 1.5 + 1.125.
  control.Expect(1.0, ModelOf(-1.0, 1.0), 3.0);
  EXPECT_TRUE(control.Judge(0.625, 0.5));
  EXPECT_NEAR(control.last_gain(), 1.0, 1e-14);
}

// A loss that is 1 - cos(a) along the curve, of which only the curve knows the
// minimum: it predicts every step, whatever its length.
TEST(GainControl, PredictsAlongTheCurve) {
  AlongDirection model;
  model.unit = 0.5;
  model.curve = [](double a) {
    return LossOnCurve{1.0 - std::cos(a - 1.0), std::sin(a - 1.0), 1.0};
  };
  model.start = model.curve(0.0);
  model.slope = model.start.slope;
  GainControl control = MakeControl("both");
  for (const double eta : {1e-3, 1.0, 2.0, 3.0}) {
    for (const double fraction : {1.0, 0.5}) {
      control.Expect(model.start.loss, model, eta);
      EXPECT_TRUE(
          control.Judge(1.0 - std::cos(0.5 * fraction * eta - 1.0), fraction));
      EXPECT_NEAR(control.last_gain(), 1.0, 1e-10);
    }
  }
  // Beyond 4 it promises more than at 0.
  control.Expect(model.start.loss, model, 4.5);
  EXPECT_FALSE(control.Judge(1.0 - std::cos(1.25), 1.0));
}

// The state is all that the next step depends on, and a step of which nothing
// is known but that it led nowhere is judged as if it had been expected.
TEST(GainControl, AResumedControlGoesOnBitForBit) {
  for (const double cost : {0.97, 0.5, 1.2, kNaN}) {
    SCOPED_TRACE(cost);
    GainControl whole = MakeControl("both");
    whole.Expect(1.0, ModelOf(-1.0, 3.0), 0.1);
    whole.Judge(0.92, 1.0);
    JudgeGain(&whole, -1.0);
    GainControl resumed = MakeControl("both");
    *resumed.mutable_state() = *whole.mutable_state();
    for (GainControl* control : {&whole, &resumed}) {
      if (!std::isnan(cost)) control->Expect(1.0, ModelOf(-1.0, 3.0), 0.1);
      control->Judge(cost, 1.0);
    }
    EXPECT_EQ(*resumed.mutable_state(), *whole.mutable_state());
    EXPECT_EQ(resumed.filter().kappa, whole.filter().kappa);
    EXPECT_EQ(resumed.filter().relative_damping,
              whole.filter().relative_damping);
    EXPECT_EQ(resumed.step_factor(), whole.step_factor());
  }
}

}  // namespace gain_control_test
}  // namespace invgrad
