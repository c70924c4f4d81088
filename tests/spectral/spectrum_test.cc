// The spectrum that a step measures, and steps by a filter with noise.
#include <cmath>
#include <utility>
#include <vector>

#include "Eigen/SVD"
#include "gtest/gtest.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/spectral.h"
#include "invgrad/stored_jacobian.h"
#include "tests/support/spectral_reference.h"
#include "tests/support/spectral_step_of.h"

namespace invgrad {
namespace spectrum_test {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Eigenvectors, the tridiagonal form; both sides.
const std::vector<std::pair<int, int>> kShapes = {
    {20, 30}, {30, 20}, {70, 90}, {90, 70}};

SpectralStepSummary StepAndMeasure(const MatrixXd& J,
                                   const VectorXd& g,
                                   const SpectralFilter& filter,
                                   SpectralRoute route,
                                   VectorXd* d) {
  SpectralStepOptions options = Take(route);
  options.measures_spectrum = true;
  SpectralStepSummary summary;
  EXPECT_TRUE(SpectralStep(DenseJacobian(J), g, filter, options, d, &summary))
      << summary.message;
  return summary;
}

TEST(Spectrum, DeterminesTheNormOfEveryStep) {
  RandomMatrices random(2);
  for (const auto& [m, n] : kShapes) {
    const MatrixXd J =
        random.WithSpectrum(m, n, LogUniform(std::min(m, n), 1e-3));
    const VectorXd g = random.Vector(m);
    for (const SpectralRoute route :
         {SpectralRoute::kGram, SpectralRoute::kSvd}) {
      SCOPED_TRACE(std::to_string(m) + " x " + std::to_string(n) + " " +
                   SpectralRouteName(route));
      VectorXd d;
      const Spectrum spectrum =
          StepAndMeasure(J, g, SpectralFilter::HalfInverse(0.0), route, &d)
              .spectrum;
      ASSERT_EQ(spectrum.lambda.size(), std::min(m, n));
      EXPECT_EQ(spectrum.num_outside, std::max(0, m - n));
      EXPECT_NEAR(spectrum.squared_coefficients.sum() + spectrum.outside,
                  g.squaredNorm(),
                  1e-9 * g.squaredNorm());
      // |V phi(S) c|^2 = sum phi^2 c^2 with phi^2 = 1 / s.
      const double squared_norm = (spectrum.squared_coefficients.array() /
                                   spectrum.lambda.array().sqrt())
                                      .sum();
      EXPECT_NEAR(squared_norm, d.squaredNorm(), 1e-7 * d.squaredNorm());
      // sum lambda c^2 = |J^T g|^2.
      EXPECT_NEAR(spectrum.lambda.dot(spectrum.squared_coefficients),
                  (J.transpose() * g).squaredNorm(),
                  1e-10 * (J.transpose() * g).squaredNorm());
    }
  }
}

TEST(Spectrum, IsEmptyUnlessMeasured) {
  RandomMatrices random(3);
  const MatrixXd J = random.WithSpectrum(20, 30, LogUniform(20, 1e-3));
  SpectralStepSummary summary;
  VectorXd d;
  ASSERT_TRUE(SpectralStep(DenseJacobian(J),
                           random.Vector(20),
                           SpectralFilter::HalfInverse(0.0),
                           Take(SpectralRoute::kGram),
                           &d,
                           &summary));
  EXPECT_TRUE(summary.spectrum.is_empty());
}

TEST(FilterWithNoise, GivesTheSameStepByAllRoutes) {
  RandomMatrices random(4);
  for (const auto& [m, n] : kShapes) {
    const MatrixXd J =
        random.WithSpectrum(m, n, LogUniform(std::min(m, n), 1e-4));
    const VectorXd g = random.Vector(m);
    const Eigen::JacobiSVD<MatrixXd> svd(
        J, Eigen::ComputeThinU | Eigen::ComputeThinV);
    const VectorXd& s = svd.singularValues();
    for (const double exponent : {0.5, 0.75, 1.0}) {
      for (const double kappa : {0.5, 0.8, 1.0}) {
        SpectralFilter filter = SpectralFilter::Power(kappa, 1.1e-3);
        filter.noise = 1e-2;
        filter.signal_exponent = exponent;
        for (const SpectralRoute route :
             {SpectralRoute::kGram, SpectralRoute::kSvd}) {
          VectorXd d;
          const SpectralStepSummary summary =
              StepAndMeasure(J, g, filter, route, &d);
          VectorXd c = svd.matrixU().transpose() * g;
          for (Index i = 0; i < c.size(); ++i) c[i] *= filter(s[i], s[0]);
          const VectorXd expected = svd.matrixV() * c;
          // The Jacobi SVD's errors are some roundings of s_max, 1e4 times as
          // large relative to the smallest value.
          EXPECT_LE((d - expected).norm(),
                    (summary.estimated_error + 1e-11) * expected.norm())
              << m << " x " << n << " a " << exponent << " kappa " << kappa
              << " " << SpectralRouteName(route);
        }
      }
    }
  }
}

}  // namespace spectrum_test
}  // namespace invgrad
