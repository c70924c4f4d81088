#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/spectral.h"

namespace invgrad {
namespace spectral_filter_test {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(SpectralFilter, DefaultIsThePublishedHalfInverse) {
  const SpectralFilter filter;
  EXPECT_EQ(filter.kappa, 0.5);
  EXPECT_EQ(filter.tau, 1e-6);
  EXPECT_FALSE(filter.clamp);
  EXPECT_EQ(filter.damping, 0.0);
  EXPECT_EQ(filter.relative_damping, 0.0);
  EXPECT_FALSE(filter.IsDamped());
}

TEST(SpectralFilter, PowersOfTheSingularValue) {
  EXPECT_DOUBLE_EQ(SpectralFilter::HalfInverse(0.0)(4.0, 4.0), 0.5);
  EXPECT_DOUBLE_EQ(SpectralFilter::GaussNewton(0.0)(4.0, 4.0), 0.25);
  EXPECT_DOUBLE_EQ(SpectralFilter::Power(0.0, 0.0)(4.0, 4.0), 1.0);
  EXPECT_DOUBLE_EQ(SpectralFilter::Power(-0.5, 0.0)(4.0, 4.0), 2.0);
  EXPECT_DOUBLE_EQ(SpectralFilter::GradientDescent()(4.0, 4.0), 4.0);
}

TEST(SpectralFilter, OnlyTheUntruncatedGradientIsGradientDescent) {
  EXPECT_TRUE(SpectralFilter::GradientDescent().IsGradientDescent());
  EXPECT_TRUE(SpectralFilter::Power(-1.0, 0.0).IsGradientDescent());
  EXPECT_FALSE(SpectralFilter::Power(-1.0, 0.1).IsGradientDescent());
  EXPECT_FALSE(SpectralFilter::Power(-0.9, 0.0).IsGradientDescent());
  EXPECT_FALSE(
      SpectralFilter::LevenbergMarquardt(1.0, 0.0).IsGradientDescent());
  // s (s^2 + lambda)^0: damping has nothing to damp.
  SpectralFilter damped = SpectralFilter::GradientDescent();
  damped.relative_damping = 0.5;
  EXPECT_TRUE(damped.IsGradientDescent());
  EXPECT_DOUBLE_EQ(damped(3.0, 4.0), 3.0);
}

TEST(SpectralFilter, AValueExactlyAtTheThresholdIsDropped) {
  const SpectralFilter filter = SpectralFilter::HalfInverse(0.25);
  const double threshold = 0.25 * 8.0;
  EXPECT_FALSE(filter.Keeps(threshold, 8.0));
  EXPECT_EQ(filter(threshold, 8.0), 0.0);
  const double above = std::nextafter(threshold, 3.0);
  EXPECT_TRUE(filter.Keeps(above, 8.0));
  EXPECT_DOUBLE_EQ(filter(above, 8.0), 1.0 / std::sqrt(2.0));
}

TEST(SpectralFilter, ZeroNeverContributes) {
  for (const double kappa : {-1.0, -0.5, 0.0, 0.5, 1.0}) {
    for (const bool clamp : {false, true}) {
      SpectralFilter filter = SpectralFilter::Power(kappa, clamp ? 0.1 : 0.0);
      filter.clamp = clamp;
      EXPECT_FALSE(filter.Keeps(0.0, 1.0));
      EXPECT_EQ(filter(0.0, 1.0), 0.0) << kappa;
      EXPECT_EQ(filter(0.0, 0.0), 0.0) << kappa;
    }
  }
  EXPECT_EQ(SpectralFilter::LevenbergMarquardt(0.0, 0.0)(0.0, 1.0), 0.0);
  EXPECT_EQ(SpectralFilter::LevenbergMarquardt(2.0, 0.0)(0.0, 1.0), 0.0);
  EXPECT_EQ(SpectralFilter::LevenbergMarquardt(0.0, 1.0)(0.0, 0.0), 0.0);
}

TEST(SpectralFilter, ClampingRaisesSmallValuesToTheThreshold) {
  SpectralFilter filter = SpectralFilter::HalfInverse(0.25);
  filter.clamp = true;
  EXPECT_DOUBLE_EQ(filter(4.0, 4.0), 0.5);
  EXPECT_DOUBLE_EQ(filter(1.0, 4.0), 1.0);
  EXPECT_DOUBLE_EQ(filter(1e-9, 4.0), 1.0);
  EXPECT_FALSE(filter.Keeps(1e-9, 4.0)) << "clamped, not kept as it is";
}

TEST(SpectralFilter, LevenbergMarquardt) {
  EXPECT_DOUBLE_EQ(SpectralFilter::LevenbergMarquardt(3.0, 0.0)(2.0, 9.0),
                   2.0 / 7.0);
  EXPECT_DOUBLE_EQ(SpectralFilter::LevenbergMarquardt(0.0, 0.5)(2.0, 4.0),
                   2.0 / 12.0);
  EXPECT_DOUBLE_EQ(SpectralFilter::LevenbergMarquardt(1.0, 0.5)(2.0, 4.0),
                   2.0 / 13.0);
  // Without damping it is Gauss-Newton, however small the value.
  EXPECT_DOUBLE_EQ(SpectralFilter::LevenbergMarquardt(0.0, 0.0)(1e-9, 1.0),
                   1e9);
  // Squares of these values are not representable.
  EXPECT_DOUBLE_EQ(SpectralFilter::LevenbergMarquardt(0.0, 1.0)(1e200, 1e200),
                   0.5e-200);
  EXPECT_DOUBLE_EQ(SpectralFilter::LevenbergMarquardt(0.0, 1.0)(1e-200, 1e-200),
                   0.5e200);
}

TEST(SpectralFilter, DampedPowers) {
  for (const double kappa : {-0.5, 0.0, 0.5, 0.75, 1.0}) {
    SCOPED_TRACE(kappa);
    SpectralFilter filter = SpectralFilter::Power(kappa, 0.0);
    const SpectralFilter undamped = filter;
    filter.damping = 1.0;
    filter.relative_damping = 0.125;
    // lambda = 1 + 0.125 * 16 = 3, s = 1.
    EXPECT_DOUBLE_EQ(filter(1.0, 4.0), std::pow(4.0, -filter.Exponent()));
    // Far above sqrt(lambda) the power, far below it the gradient.
    filter.damping = 1e-20;
    filter.relative_damping = 0.0;
    EXPECT_DOUBLE_EQ(filter(2.0, 2.0), undamped(2.0, 2.0));
    EXPECT_DOUBLE_EQ(filter(1e-20, 2.0) / 1e-20,
                     std::pow(1e-20, -filter.Exponent()));
    // To the ends of the range, in either unit.
    for (const double unit : {1e-150, 1e150}) {
      filter.damping = 0.0;
      filter.relative_damping = 3.0;
      EXPECT_NEAR(filter(unit, unit) / std::pow(unit, -kappa),
                  std::pow(4.0, -filter.Exponent()),
                  1e-13);
    }
    // And where s_max / s is not representable.
    filter.damping = 1.0;
    filter.relative_damping = 0.0;
    EXPECT_DOUBLE_EQ(filter(1e-310, 1e10), 1e-310);
  }
}

TEST(SpectralFilter, DampingAndTruncationTogether) {
  SpectralFilter filter = SpectralFilter::HalfInverse(0.25);
  filter.damping = 3.0;
  EXPECT_EQ(filter(0.5, 4.0), 0.0);
  EXPECT_DOUBLE_EQ(filter(2.0, 4.0), 2.0 * std::pow(7.0, -0.75));
  filter.clamp = true;
  EXPECT_DOUBLE_EQ(filter(0.5, 4.0), std::pow(4.0, -0.75));
}

// Against a search.
TEST(SpectralFilter, PeakBelow) {
  for (const double kappa : {-0.5, 0.0, 0.25, 0.5, 1.0}) {
    for (const double lambda : {1e-4, 1e-2, 1.0}) {
      SpectralFilter filter = SpectralFilter::Power(kappa, 0.0);
      filter.relative_damping = lambda;
      const double peak = filter.PeakBelow(0.5, 2.0);
      EXPECT_LE(peak, 0.5);
      for (int i = 1; i <= 1000; ++i) {
        EXPECT_LE(filter(5e-4 * i, 2.0), filter(peak, 2.0) * (1.0 + 1e-14));
      }
    }
  }
  EXPECT_EQ(SpectralFilter::HalfInverse(0.0).PeakBelow(0.5, 2.0), 0.5);
}

TEST(SpectralFilter, ValidityNamesTheField) {
  const auto message = [](double SpectralFilter::*field, double value) {
    SpectralFilter filter;
    filter.*field = value;
    std::string error;
    return filter.IsValid(&error) ? "valid" : error;
  };
  EXPECT_EQ(message(&SpectralFilter::kappa, 1.0), "valid");
  EXPECT_EQ(message(&SpectralFilter::kappa, 1.5),
            "kappa=1.5 is out of range; allowed: [-1, 1]");
  EXPECT_EQ(message(&SpectralFilter::kappa, kNaN),
            "kappa=nan is out of range; allowed: [-1, 1]");
  EXPECT_EQ(message(&SpectralFilter::tau, 0.0), "valid");
  EXPECT_EQ(message(&SpectralFilter::tau, 1.0),
            "tau=1 is out of range; allowed: [0, 1)");
  EXPECT_EQ(message(&SpectralFilter::damping, -1.0),
            "damping=-1 is out of range; allowed: [0, inf)");
  EXPECT_EQ(message(&SpectralFilter::damping, kInfinity),
            "damping=inf is out of range; allowed: [0, inf)");
  EXPECT_EQ(message(&SpectralFilter::relative_damping, -1.0),
            "relative_damping=-1 is out of range; allowed: [0, inf)");
}

}  // namespace spectral_filter_test
}  // namespace invgrad
