// The route svd for shapes around the one from which a QR factorization comes
// first.
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/stored_jacobian.h"
#include "tests/support/spectral_reference.h"
#include "tests/support/spectral_step_of.h"

namespace invgrad {
namespace svd_route_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// Just below and above p / q = 11 / 6; the smallest sizes; square.
const std::vector<std::pair<int, int>> kShapes = {
    {1, 1}, {5, 1}, {2, 2}, {30, 30}, {36, 20}, {37, 20}, {200, 20}, {300, 80}};

TEST(SvdRoute, StepsAreThoseOfTheReference) {
  RandomMatrices random(1);
  SpectralWorkspace workspace;  // the same for all: sizes may change
  for (const auto& [p, q] : kShapes) {
    const VectorXd s = LogUniform(q, 1e-9);
    const MatrixXd tall = random.WithSpectrum(p, q, s);
    for (const bool wide : {false, true}) {
      SCOPED_TRACE(std::to_string(p) + " x " + std::to_string(q) +
                   (wide ? " transposed" : ""));
      const MatrixXd J = wide ? MatrixXd(tall.transpose()) : tall;
      const VectorXd g = random.Vector(J.rows());
      const SpectralReference reference(J);
      for (const SpectralFilter& filter : {SpectralFilter::HalfInverse(0.0101),
                                           SpectralFilter::GaussNewton(1.01e-6),
                                           SpectralFilter::GradientDescent()}) {
        SpectralStepSummary summary;
        VectorXd d;
        ASSERT_TRUE(SpectralStep(DenseJacobian(J),
                                 g,
                                 filter,
                                 Take(SpectralRoute::kSvd),
                                 &workspace,
                                 &d,
                                 &summary))
            << summary.message;
        EXPECT_EQ(summary.route, SpectralRoute::kSvd);
        EXPECT_NEAR(summary.s_max, s[0], 100.0 * kEpsilon);
        int rank = 0;
        for (const double value : s) rank += filter.Keeps(value, s[0]) ? 1 : 0;
        EXPECT_EQ(summary.rank, rank);
        EXPECT_LE(reference.RelativeError(filter, g, d),
                  summary.estimated_error);
      }
    }
  }
}

// All entries one: the step is J^+ g, a multiple of ones.
TEST(SvdRoute, RankDeficientMatrices) {
  for (const auto& [m, n] : kShapes) {
    SpectralStepSummary summary;
    const VectorXd d = StepOf(MatrixXd::Ones(m, n),
                              VectorXd::Ones(m),
                              SpectralFilter::GaussNewton(1e-6),
                              SpectralRoute::kSvd,
                              &summary);
    EXPECT_EQ(summary.rank, 1);
    EXPECT_NEAR(summary.s_max,
                std::sqrt(1.0 * m * n),
                100 * kEpsilon * std::sqrt(m * n));
    EXPECT_LE((d - VectorXd::Constant(n, 1.0 / n)).norm(), 100 * kEpsilon);
  }
}

// phi(s) = 1/s overflows, or s itself.
TEST(SvdRoute, ReturnsFalseWhereTheStepOrTheSvdOverflows) {
  RandomMatrices random(2);
  for (const auto& [m, n] :
       std::vector<std::pair<int, int>>{{10, 40}, {40, 10}, {20, 20}}) {
    const MatrixXd J =
        random.WithSpectrum(m, n, VectorXd::Ones(std::min(m, n)));
    for (const double scale : {1e-310, 1.7e308}) {
      SCOPED_TRACE(std::to_string(m) + " x " + std::to_string(n));
      const MatrixXd scaled = scale < 1.0
                                  ? MatrixXd(scale * J)
                                  : MatrixXd::Constant(m, n, scale);  // s = inf
      SpectralStepSummary summary;
      VectorXd d;
      EXPECT_FALSE(SpectralStep(DenseJacobian(scaled),
                                VectorXd::Ones(m),
                                SpectralFilter::GaussNewton(1e-6),
                                Take(SpectralRoute::kSvd),
                                &d,
                                &summary));
      EXPECT_FALSE(summary.message.empty());
    }
  }
}

}  // namespace svd_route_test
}  // namespace invgrad
