#include "invgrad/linalg/spectral_filter.h"

#include <cmath>
#include <limits>
#include <string>

#include "gtest/gtest.h"

namespace invgrad {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(SpectralFilter, DefaultIsThePublishedHalfInverse) {
  const SpectralFilter filter;
  EXPECT_EQ(filter.kind, SpectralFilter::Kind::kPower);
  EXPECT_EQ(filter.kappa, 0.5);
  EXPECT_EQ(filter.tau, 1e-6);
  EXPECT_FALSE(filter.clamp);
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
  SpectralFilter filter = SpectralFilter::LevenbergMarquardt(1.0, 0.0);
  filter.kappa = -1.0;
  EXPECT_FALSE(filter.IsGradientDescent());
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

}  // namespace
}  // namespace invgrad
