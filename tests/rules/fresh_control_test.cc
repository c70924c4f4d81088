#include "invgrad/rules/fresh_control.h"

#include <cmath>
#include <limits>

#include "gtest/gtest.h"

namespace invgrad {
namespace fresh_control_test {

using Verdict = FreshControl::Verdict;
using Return = FreshControl::Return;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Losses that fall by `rate` a step from exp(-rate first), with fluctuations.
// The number of copies.
int Fall(FreshControl* control, double rate, int first, int end) {
  int num_copies = 0;
  for (int k = first; k < end; ++k) {
    const Verdict verdict =
        control->Judge(std::exp(-rate * k + (k % 2 == 0 ? 0.1 : -0.1)));
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
      control.Judge(loss);
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
  for (int k = 0; k < 60; ++k) constant.Judge(1.0);
  EXPECT_GE(Adjusted(constant, 0.5).noise, 1.0);
}

TEST(FreshControl, CautionFollowsTheTrendAndKappa) {
  FreshControl control{{}};
  Fall(&control, 0.02, 0, 40);
  for (int k = 0; k < 200 && control.caution() == 1.0; ++k) {
    control.Judge(std::exp(-0.8 + 0.003 * k + (k % 2 == 0 ? 0.1 : -0.1)));
  }
  const double caution = control.caution();
  EXPECT_NEAR(caution, 0.97, 1e-15);
  EXPECT_DOUBLE_EQ(Adjusted(control, 1.0).kappa, 0.5 + 0.5 * caution);
  EXPECT_EQ(Adjusted(control, 0.4).kappa, 0.4);
}

TEST(FreshControl, ReturnsAfterAWorseBlock) {
  FreshControl control{{}};
  const auto fluctuation = [](int k) { return std::exp(k % 2 ? 0.02 : -0.02); };
  for (int k = 0; k < 30; ++k) control.Judge(fluctuation(k));
  Verdict verdict = Verdict::kGoOn;
  int num_steps = 0;
  // Higher by a factor 1.9: no outlier, but worse than 1.6 and three standard
  // errors of 0.02 / 3, from both means.
  while (verdict == Verdict::kGoOn && num_steps < 20) {
    verdict = control.Judge(1.9 * fluctuation(num_steps));
    ++num_steps;
  }
  EXPECT_EQ(verdict, Verdict::kReturn);
  EXPECT_EQ(num_steps, 10);
  const double caution = control.caution();
  control.Returned(Return::kToCopy, 1.0);
  EXPECT_DOUBLE_EQ(control.caution(), 0.5 * caution);
}

TEST(FreshControl, AFactorBelowTheLimitIsNoReturn) {
  FreshControl control{{}};
  Fall(&control, 0.0, 0, 30);
  for (int k = 0; k < 60; ++k) {
    const Verdict verdict =
        control.Judge(1.5 * std::exp(k % 2 == 0 ? 0.1 : -0.1));
    EXPECT_NE(verdict, Verdict::kReturn);
  }
}

TEST(FreshControl, ComparesOutliersAndWhatIsNotFinite) {
  FreshControl control{{}};
  EXPECT_EQ(control.Judge(kNaN), Verdict::kCompare);
  control.Returned(Return::kNowhere, kNaN);
  EXPECT_EQ(control.Judge(std::numeric_limits<double>::infinity()),
            Verdict::kCompare);
  Fall(&control, 0.0, 0, 30);
  EXPECT_EQ(control.Judge(3.0), Verdict::kCompare);
  const double caution = control.caution();
  control.Returned(Return::kLastStep, 1.0);
  EXPECT_DOUBLE_EQ(control.caution(), 0.5 * caution);
}

// The copy would be of weights that the next comparison may leave.
TEST(FreshControl, DoesNotCopyAtAnOutlier) {
  FreshControl control{{}};
  Fall(&control, 0.0, 0, 19);  // the next loss ends a block
  EXPECT_EQ(control.Judge(3.0), Verdict::kCompare);
  control.Returned(Return::kNowhere, 3.0);
  for (int k = 0; k < 9; ++k) control.Judge(1.0);
  EXPECT_EQ(control.Judge(1.0), Verdict::kCopy);
}

TEST(FreshControl, CautionHasALowerEnd) {
  FreshControl control{{}};
  for (int k = 0; k < 100; ++k) control.Returned(Return::kLeftOut, kNaN);
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
    EXPECT_EQ(control.Judge(loss), copy.Judge(loss));
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
  for (int k = 0; k < 60; ++k) no_caution.Judge(std::exp(0.01 * k));
  EXPECT_EQ(no_caution.caution(), 1.0);
  no_caution.Returned(Return::kToCopy, 1.0);
  EXPECT_EQ(no_caution.caution(), 0.5);

  FreshControl no_returns{{"returns"}};
  for (int k = 0; k < 60; ++k) {
    EXPECT_EQ(no_returns.Judge(k < 30 ? 1.0 : 1e3), Verdict::kGoOn);
  }
  // As without control=fresh, the engine then reverts the last step.
  EXPECT_EQ(no_returns.Judge(kNaN), Verdict::kCompare);
}

}  // namespace fresh_control_test
}  // namespace invgrad
