#include "invgrad/rules/fresh_control.h"

#include <cmath>
#include <limits>

#include "gtest/gtest.h"

namespace invgrad {
namespace fresh_control_test {

using Verdict = FreshControl::Verdict;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

struct Others final : FreshControl::OtherWeights {
  Others() = default;
  Others(double before, double at_copy) : before(before), at_copy(at_copy) {}
  double CostBeforeLastStep() override { return before; }
  double CostAtCopy() override { return at_copy; }

  double before = kNaN;
  double at_copy = kNaN;
};

Verdict Judge(FreshControl* control, double cost, Others others = {}) {
  return control->Judge(cost, &others);
}

// Losses that fall by `rate` a step from exp(-rate first), with fluctuations.
// The number of copies.
int Fall(FreshControl* control, double rate, int first, int end) {
  int num_copies = 0;
  for (int k = first; k < end; ++k) {
    const Verdict verdict =
        Judge(control, std::exp(-rate * k + (k % 2 == 0 ? 0.1 : -0.1)));
    EXPECT_TRUE(verdict == Verdict::kGoOn || verdict == Verdict::kCopy) << k;
    num_copies += verdict == Verdict::kCopy ? 1 : 0;
  }
  return num_copies;
}

// A spectrum that is all noise.
Spectrum Flat() {
  Spectrum spectrum;
  spectrum.lambda = Eigen::VectorXd::LinSpaced(100, 0.01, 1.0);
  spectrum.squared_coefficients = Eigen::VectorXd::Ones(100);
  return spectrum;
}

SpectralFilter Adjusted(const FreshControl& control, double kappa) {
  SpectralFilter filter = SpectralFilter::Power(kappa, 1e-6);
  control.Adjust(&filter);
  return filter;
}

TEST(FreshControl, GoesOnAndCopiesWhileTheLossFalls) {
  FreshControl control{{}};
  EXPECT_EQ(Fall(&control, 0.02, 0, 100), 10);  // a copy each block
  EXPECT_EQ(control.caution(), 1.0);
}

TEST(FreshControl, WithoutLossesChangesNothing) {
  FreshControl control{{}};
  control.Observe(Flat());
  EXPECT_EQ(Adjusted(control, 0.9).kappa, 0.9);
  EXPECT_EQ(Adjusted(control, 0.9).noise, 0.0);
  EXPECT_EQ(control.caution(), 1.0);
}

TEST(FreshControl, AResidualThatShrinksIsNotNoise) {
  FreshControl falling{{}}, constant{{}};
  falling.Observe(Flat());
  constant.Observe(Flat());
  Fall(&falling, 0.05, 0, 60);
  Fall(&constant, 0.0, 0, 60);
  // The fluctuations tilt the line by less than 1e-3 a step.
  EXPECT_LE(Adjusted(falling, 0.5).noise, 1e3 * std::exp(-1000.0 * 0.049));
  EXPECT_GE(Adjusted(constant, 0.5).noise, 1.0);
}

// The weight that the header states, for losses of the same slope.
TEST(FreshControl, ASureDecreaseIsNotNoise) {
  Evidence evidence;
  evidence.Add(Flat());
  double weights[2];
  for (const bool is_sure : {false, true}) {
    FreshControl control{{}};
    control.Observe(Flat());
    LossTrend trend;
    for (int k = 0; k < 60; ++k) {
      const double fluctuation = is_sure ? 0.002 : 0.1;
      const double loss =
          std::exp(-0.001 * k + (k % 2 == 0 ? fluctuation : -fluctuation));
      Judge(&control, loss);
      trend.Add(loss);
    }
    const double d = -trend.slope();
    const double errors = d / trend.slope_error();
    weights[is_sure] = Adjusted(control, 0.5).noise / evidence.Fit().noise;
    EXPECT_NEAR(
        std::log(weights[is_sure]), -1000.0 * d - 0.1 * errors * errors, 1e-9);
  }
  EXPECT_GE(weights[false], 0.1);
  EXPECT_LE(weights[true], 1e-6);
}

// Equal losses after each other have a trend without error.
TEST(FreshControl, ATrendWithoutErrorsIsDefined) {
  FreshControl constant{{}};
  constant.Observe(Flat());
  for (int k = 0; k < 60; ++k) Judge(&constant, 1.0);
  EXPECT_GE(Adjusted(constant, 0.5).noise, 1.0);
}

TEST(FreshControl, CautionFollowsTheTrendAndKappa) {
  FreshControl control{{}};
  Fall(&control, 0.02, 0, 40);
  for (int k = 0; k < 200 && control.caution() == 1.0; ++k) {
    Judge(&control, std::exp(-0.8 + 0.003 * k + (k % 2 == 0 ? 0.1 : -0.1)));
  }
  const double caution = control.caution();
  EXPECT_NEAR(caution, 0.97, 1e-15);
  EXPECT_DOUBLE_EQ(Adjusted(control, 1.0).kappa, 0.5 + 0.5 * caution);
  EXPECT_EQ(Adjusted(control, 0.4).kappa, 0.4);
}

TEST(FreshControl, ReturnsAfterAWorseBlock) {
  FreshControl control{{}};
  const auto fluctuation = [](int k) { return std::exp(k % 2 ? 0.02 : -0.02); };
  for (int k = 0; k < 30; ++k) Judge(&control, fluctuation(k));
  const double caution = control.caution();
  Verdict verdict = Verdict::kGoOn;
  int num_steps = 0;
  // Higher by a factor 1.9: no outlier, but worse than 1.6 and three standard
  // errors of 0.02 / 3, from both means.
  while (verdict == Verdict::kGoOn && num_steps < 20) {
    verdict = Judge(&control, 1.9 * fluctuation(num_steps), {1.9, 1.0});
    ++num_steps;
  }
  EXPECT_EQ(verdict, Verdict::kUndoToCopy);
  EXPECT_EQ(num_steps, 10);
  // Halved, after the trend had changed it.
  EXPECT_LE(control.caution(), 0.5 * caution);
}

TEST(FreshControl, AFactorBelowTheLimitIsNoReturn) {
  FreshControl control{{}};
  Fall(&control, 0.0, 0, 30);
  for (int k = 0; k < 60; ++k) {
    const Verdict verdict =
        Judge(&control, 1.5 * std::exp(k % 2 == 0 ? 0.1 : -0.1), {1.0, 1.0});
    EXPECT_NE(verdict, Verdict::kUndoToCopy);
  }
}

TEST(FreshControl, ALossThatIsNotFiniteGoesBackToWhereItIsLowest) {
  for (const double not_finite : {kNaN, kInf}) {
    FreshControl control{{}};
    EXPECT_EQ(Judge(&control, not_finite, {1.0, 2.0}), Verdict::kUndoStep);
    EXPECT_EQ(control.caution(), 0.5);
    EXPECT_EQ(Judge(&control, not_finite, {2.0, 1.0}), Verdict::kUndoToCopy);
    EXPECT_EQ(Judge(&control, not_finite, {1.0, kNaN}), Verdict::kUndoStep);
    EXPECT_EQ(Judge(&control, not_finite, {kNaN, 1.0}), Verdict::kUndoToCopy);
    EXPECT_EQ(control.caution(), 0.0625);
    EXPECT_EQ(Judge(&control, not_finite, {kNaN, kNaN}), Verdict::kLeaveOut);
    EXPECT_EQ(control.caution(), 0.03125);
  }
}

// The batch is a hard one: its loss is no lower elsewhere.
TEST(FreshControl, AnOutlierThatIsNoBetterElsewhereStartsNoTrial) {
  FreshControl control{{}};
  Fall(&control, 0.0, 0, 30);
  EXPECT_EQ(Judge(&control, 3.0, {1.51, 1.51}), Verdict::kGoOn);
  EXPECT_EQ(Judge(&control, 3.0), Verdict::kGoOn) << "there is no copy";
  for (int k = 0; k < 10; ++k) {
    EXPECT_NE(Judge(&control, 1.0, {1e-9, 1e-9}), Verdict::kUndoToCopy);
  }
}

TEST(FreshControl, AnOutlierStartsATrialAgainstTheBetterWeights) {
  for (const bool is_before : {false, true}) {
    // Ten steps; the second half decides.
    for (const double at_copy : {0.49, 0.51}) {
      FreshControl control{{}};
      Fall(&control, 0.0, 0, 30);
      EXPECT_EQ(
          Judge(&control, 3.0, is_before ? Others(1.4, 1.5) : Others(1.5, 1.4)),
          is_before ? Verdict::kCopyBefore : Verdict::kGoOn);
      for (int k = 1; k <= 9; ++k) {
        EXPECT_EQ(Judge(&control, 1.0, {1.0, k <= 5 ? 1e-9 : at_copy}),
                  Verdict::kGoOn);
      }
      EXPECT_EQ(Judge(&control, 1.0, {1.0, at_copy}),
                at_copy < 0.5 ? Verdict::kUndoToCopy : Verdict::kGoOn);
      EXPECT_EQ(control.caution(), at_copy < 0.5 ? 0.5 : 1.0);
    }
  }
}

// The last good weights are the copy of the trial.
TEST(FreshControl, ATrialEndsWithALossThatIsNotFinite) {
  FreshControl control{{}};
  Fall(&control, 0.0, 0, 30);
  Judge(&control, 3.0, {1.4, 1.5});
  EXPECT_EQ(Judge(&control, kNaN, {kNaN, 1.0}), Verdict::kUndoToCopy);
  for (int k = 0; k < 20; ++k) {
    EXPECT_NE(Judge(&control, 1.0, {1.0, 1e-9}), Verdict::kUndoToCopy);
  }
}

// The copy would be of weights that the trial may leave.
TEST(FreshControl, DoesNotCopyInATrial) {
  FreshControl control{{}};
  Fall(&control, 0.0, 0, 19);  // the next loss ends a block
  EXPECT_EQ(Judge(&control, 3.0, {1.5, 1.4}), Verdict::kGoOn);
  for (int k = 0; k < 10; ++k) {
    EXPECT_EQ(Judge(&control, 0.1, {1.0, 1.0}), Verdict::kGoOn);
  }
}

TEST(FreshControl, CautionHasALowerEnd) {
  FreshControl control{{}};
  for (int k = 0; k < 100; ++k) Judge(&control, kNaN);
  EXPECT_EQ(control.caution(), 1e-3);
}

TEST(FreshControl, WantsASpectrumInEveryFifthStep) {
  FreshControl control{{}};
  for (int k = 0; k < 20; ++k) {
    EXPECT_EQ(control.wants_spectrum(), k % 5 == 0);
    control.Observe(Spectrum());
  }
}

TEST(FreshControl, ItsStateIsAll) {
  FreshControl control{{}}, copy{{}};
  control.Observe(Flat());
  Fall(&control, 0.01, 0, 57);
  const auto from = control.MutableState();
  const auto to = copy.MutableState();
  ASSERT_EQ(from.size(), to.size());
  for (size_t i = 0; i < from.size(); ++i) *to[i] = *from[i];
  for (int k = 0; k < 40; ++k) {
    const double loss = std::exp(std::sin(k));
    EXPECT_EQ(Judge(&control, loss, {0.5, 0.4}),
              Judge(&copy, loss, {0.5, 0.4}));
    EXPECT_EQ(control.caution(), copy.caution());
    EXPECT_EQ(Adjusted(control, 0.8).noise, Adjusted(copy, 0.8).noise);
  }
}

TEST(FreshControl, EachPartCanBeOff) {
  FreshControl no_noise{{"noise"}};
  no_noise.Observe(Flat());
  Fall(&no_noise, 0.0, 0, 60);
  EXPECT_EQ(Adjusted(no_noise, 0.5).noise, 0.0);

  FreshControl no_caution{{"caution"}};
  for (int k = 0; k < 60; ++k) Judge(&no_caution, std::exp(0.01 * k));
  EXPECT_EQ(no_caution.caution(), 1.0);
  Judge(&no_caution, kNaN, {kNaN, 1.0});
  EXPECT_EQ(no_caution.caution(), 0.5);

  FreshControl no_returns{{"returns"}};
  for (int k = 0; k < 60; ++k) {
    EXPECT_EQ(Judge(&no_returns, k < 30 ? 1.0 : 1e3, {0.1, 0.1}),
              Verdict::kGoOn);
  }
  EXPECT_EQ(Judge(&no_returns, kNaN, {1.0, kNaN}), Verdict::kUndoStep);
}

}  // namespace fresh_control_test
}  // namespace invgrad
