#include "invgrad/rules/evidence.h"

#include <cmath>
#include <random>

#include "gtest/gtest.h"

namespace invgrad {
namespace evidence_test {

using Eigen::VectorXd;

// Normal coefficients of variance K (x^a + noise), x log-uniform in
// [1e-8, 1].
Spectrum Draw(int size, double K, double a, double noise, int seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  Spectrum spectrum;
  spectrum.lambda.resize(size);
  spectrum.squared_coefficients.resize(size);
  for (int i = 0; i < size; ++i) {
    const double x = std::pow(1e-8, i / (size - 1.0));
    const double z = normal(generator);
    spectrum.lambda[i] = 7.0 * x;
    spectrum.squared_coefficients[i] = K * (std::pow(x, a) + noise) * z * z;
  }
  return spectrum;
}

TEST(Evidence, FindsTheModelOfItsData) {
  for (const double a : {0.5, 1.0}) {
    for (const double noise : {1e-5, 1e-3, 1e-1}) {
      Evidence evidence;
      evidence.Add(Draw(4000, 3.0, a, noise, 1));
      const Evidence::Model model = evidence.Fit();
      EXPECT_EQ(model.signal_exponent, a);
      // Of 4000 coefficients hundreds determine the noise: its standard error
      // is below 10 %, and the search has steps of a quarter of a decade.
      EXPECT_NEAR(std::log10(model.noise), std::log10(noise), 0.25);
    }
  }
}

TEST(Evidence, DoesNotDependOnUnits) {
  Evidence one, other;
  Spectrum spectrum = Draw(300, 1.0, 0.75, 1e-2, 2);
  one.Add(spectrum);
  spectrum.squared_coefficients *= 1e20;
  spectrum.lambda *= 1e-6;
  other.Add(spectrum);
  EXPECT_EQ(one.Fit().noise, other.Fit().noise);
  EXPECT_EQ(one.Fit().signal_exponent, other.Fit().signal_exponent);
}

TEST(Evidence, AFlatSpectrumIsNoiseAndASignalHasNone) {
  Evidence flat, steep;
  flat.Add(Draw(2000, 1.0, 1.0, 1e9, 3));
  EXPECT_GE(flat.Fit().noise, 10.0);
  steep.Add(Draw(2000, 1.0, 1.0, 0.0, 3));
  EXPECT_LE(steep.Fit().noise, 1e-8);
}

TEST(Evidence, DirectionsOutsideTheRangeAreNoise) {
  Spectrum spectrum = Draw(200, 1.0, 1.0, 0.0, 4);
  spectrum.num_outside = 1000;
  spectrum.outside = 1000.0 * 1e-2;  // variance 1e-2 each
  Evidence evidence;
  evidence.Add(spectrum);
  EXPECT_NEAR(std::log10(evidence.Fit().noise), -2.0, 0.25);
}

TEST(Evidence, ForgetsOldSpectra) {
  Evidence evidence;
  evidence.Add(Draw(500, 1.0, 1.0, 1e-1, 5));
  for (int i = 0; i < 40; ++i) evidence.Add(Draw(500, 1.0, 1.0, 1e-4, 6 + i));
  EXPECT_NEAR(std::log10(evidence.Fit().noise), -4.0, 0.25);
}

TEST(Evidence, WithoutDataThereIsNoNoise) {
  Evidence evidence;
  EXPECT_EQ(evidence.Fit().noise, 0.0);
  evidence.Add(Spectrum());
  Spectrum zero = Draw(10, 0.0, 1.0, 1.0, 1);
  evidence.Add(zero);
  zero.squared_coefficients[3] = std::nan("");
  evidence.Add(zero);
  EXPECT_EQ(evidence.mutable_state()->size(), 0);
  EXPECT_EQ(evidence.Fit().noise, 0.0);
}

}  // namespace evidence_test
}  // namespace invgrad
