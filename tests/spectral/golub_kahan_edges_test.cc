// Golub-Kahan steps at the edges: rank deficiency, zeros, one row, any scale,
// what is not finite, wrong calls.

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/spectral/golub_kahan.h"
#include "invgrad/stored_jacobian.h"
#include "tests/spectral/golub_kahan_step_of.h"
#include "tests/support/spectral_reference.h"

namespace invgrad {
namespace golub_kahan_edges_test {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

using Random = RandomMatrices;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// With a diagonal J the other components stay exactly zero.
TEST(GolubKahanStep, EndsWhereTheDataSpanAnInvariantSpace) {
  const VectorXd s = LogUniform(30, 1e-3);
  const MatrixXd J = s.asDiagonal();
  VectorXd g = VectorXd::Zero(30);
  g[3] = 2.0;
  g[9] = -1.0;
  g[20] = 0.5;
  for (const double tau : {0.0, 1e-2}) {
    const SpectralFilter filter = SpectralFilter::HalfInverse(tau);
    VectorXd d;
    const GolubKahanSummary summary =
        StepOf(DenseJacobian(J), g, filter, WithTolerance(1e-6), &d);
    EXPECT_TRUE(summary.converged);
    EXPECT_EQ(summary.num_iterations, 3);
    // s_max is the largest that g has a part of.
    EXPECT_DOUBLE_EQ(summary.s_max, s[3]);
    EXPECT_EQ(summary.rank, s[20] > tau * s[3] ? 3 : 2);
    for (Index i = 0; i < 30; ++i) {
      EXPECT_NEAR(d[i], filter(s[i], s[3]) * g[i], 1e-12);
    }
  }
}

TEST(GolubKahanStep, RankDeficiency) {
  Random random(8);
  for (const auto& [m, n] :
       std::vector<std::pair<int, int>>{{20, 30}, {30, 20}}) {
    const Factored factored(m, n, LogUniform(7, 1e-2), &random);
    const VectorXd g = random.Vector(m);
    for (const double kappa : {-0.5, 0.5, 1.0}) {
      SpectralFilter filter = SpectralFilter::Power(kappa, 1e-4);
      VectorXd d;
      GolubKahanSummary summary = StepOf(
          DenseJacobian(factored.J()), g, filter, WithTolerance(1e-6), &d);
      EXPECT_TRUE(summary.converged);
      EXPECT_EQ(summary.rank, 7);
      EXPECT_LE(summary.num_iterations, 9);
      EXPECT_LT(factored.RelativeError(filter, g, d), 1e-9);
      // Ritz values of zero are nothing special where phi is smooth.
      filter.tau = 0.0;
      filter.relative_damping = 1e-3;
      summary = StepOf(
          DenseJacobian(factored.J()), g, filter, WithTolerance(1e-6), &d);
      EXPECT_TRUE(summary.converged);
      EXPECT_LE(summary.num_iterations, 9);
      EXPECT_LT(factored.RelativeError(filter, g, d), 1e-9);
    }
  }
}

TEST(GolubKahanStep, ZeroJacobianAndZeroData) {
  VectorXd d;
  const SpectralFilter filter = SpectralFilter::HalfInverse(1e-2);
  EXPECT_TRUE(StepOf(DenseJacobian(MatrixXd::Zero(3, 4)),
                     VectorXd::Ones(3),
                     filter,
                     GolubKahanOptions(),
                     &d)
                  .converged);
  EXPECT_TRUE(d.isZero(0.0));
  EXPECT_TRUE(StepOf(DenseJacobian(MatrixXd::Ones(3, 4)),
                     VectorXd::Zero(3),
                     filter,
                     GolubKahanOptions(),
                     &d)
                  .converged);
  EXPECT_TRUE(d.isZero(0.0));
}

// One row, one column or one entry: s = |J|, d = s^(-1/2) v u^T g.
TEST(GolubKahanStep, OneRowOrOneColumn) {
  VectorXd d;
  const SpectralFilter filter = SpectralFilter::HalfInverse(1e-2);
  MatrixXd row(1, 3);
  row << 2.0, 0.0, 0.0;
  StepOf(DenseJacobian(row),
         VectorXd::Constant(1, 3.0),
         filter,
         GolubKahanOptions(),
         &d);
  EXPECT_NEAR(d[0], 3.0 / std::sqrt(2.0), 1e-14);
  EXPECT_EQ(d[1], 0.0);
  const MatrixXd column = row.transpose();
  StepOf(DenseJacobian(column),
         VectorXd::Constant(3, 3.0),
         filter,
         GolubKahanOptions(),
         &d);
  ASSERT_EQ(d.size(), 1);
  EXPECT_NEAR(d[0], 3.0 / std::sqrt(2.0), 1e-14);
  StepOf(DenseJacobian(MatrixXd::Constant(1, 1, -4.0)),
         VectorXd::Ones(1),
         filter,
         GolubKahanOptions(),
         &d);
  EXPECT_NEAR(d[0], -0.5, 1e-15);
}

// (J, g) -> (a J, b g) multiplies d by a^-kappa b, and nothing else changes.
TEST(GolubKahanStep, FollowsTheLawOfScaleToTheEndsOfTheRange) {
  Random random(9);
  const Factored factored(30, 50, LogUniform(30, 1e-4), &random);
  const VectorXd g = random.Vector(30);
  const SpectralFilter filter = SpectralFilter::HalfInverse(1.01e-2);
  VectorXd d;
  const GolubKahanSummary unscaled =
      StepOf(DenseJacobian(factored.J()), g, filter, WithTolerance(1e-6), &d);
  for (const double a : {1e-100, 1e100}) {
    for (const double b : {1e-100, 1.0, 1e100}) {
      SCOPED_TRACE(testing::Message() << a << ", " << b);
      VectorXd scaled;
      const GolubKahanSummary summary = StepOf(DenseJacobian(a * factored.J()),
                                               b * g,
                                               filter,
                                               WithTolerance(1e-6),
                                               &scaled);
      EXPECT_TRUE(summary.converged);
      EXPECT_EQ(summary.num_iterations, unscaled.num_iterations);
      EXPECT_LT((scaled * (std::sqrt(a) / b) - d).norm(), 1e-10 * d.norm());
    }
  }
}

// Raising small values leaves no mode out: right, but at full price.
TEST(GolubKahanStep, ClampingNeedsEveryMode) {
  Random random(11);
  const Factored factored(50, 30, LogUniform(30, 1e-3), &random);
  const VectorXd g = random.Vector(50);
  SpectralFilter filter = SpectralFilter::HalfInverse(1e-1);
  filter.clamp = true;
  VectorXd d;
  const GolubKahanSummary summary =
      StepOf(DenseJacobian(factored.J()), g, filter, WithTolerance(1e-6), &d);
  EXPECT_TRUE(summary.converged);
  EXPECT_EQ(summary.num_iterations, 30);
  EXPECT_LT(factored.RelativeError(filter, g, d), summary.estimated_error);
}

TEST(GolubKahanStep, RefusesWhatIsNotFinite) {
  MatrixXd basis;
  GolubKahanSummary summary;
  VectorXd d;
  VectorXd g = VectorXd::Ones(3);
  MatrixXd J = MatrixXd::Identity(3, 4);
  const SpectralFilter filter = SpectralFilter::HalfInverse(1e-2);
  g[1] = kNaN;
  EXPECT_FALSE(GolubKahanStep(
      DenseJacobian(J), g, filter, GolubKahanOptions(), &basis, &d, &summary));
  EXPECT_EQ(summary.message, "g is not finite: entry 1 is nan");
  g[1] = 1.0;
  for (const double bad : {kNaN, std::numeric_limits<double>::infinity()}) {
    J(2, 3) = bad;
    EXPECT_FALSE(GolubKahanStep(DenseJacobian(J),
                                g,
                                filter,
                                GolubKahanOptions(),
                                &basis,
                                &d,
                                &summary));
    EXPECT_EQ(summary.message.rfind("J^T g is not finite: entry", 0), 0u)
        << summary.message;
    EXPECT_FALSE(summary.converged);
  }
  // Finite entries whose norm is not.
  EXPECT_FALSE(GolubKahanStep(DenseJacobian(MatrixXd::Identity(3, 4)),
                              VectorXd::Constant(3, 1.7e308),
                              filter,
                              GolubKahanOptions(),
                              &basis,
                              &d,
                              &summary));
  EXPECT_EQ(summary.message, "the norm of g overflows");
  // A step that overflows.
  EXPECT_FALSE(GolubKahanStep(DenseJacobian(MatrixXd::Constant(1, 1, 1e-300)),
                              VectorXd::Constant(1, 1e200),
                              SpectralFilter::GaussNewton(1e-2),
                              GolubKahanOptions(),
                              &basis,
                              &d,
                              &summary));
  EXPECT_EQ(summary.message.rfind("the step is not finite", 0), 0u);
}

TEST(GolubKahanStepDeathTest, WrongCallsAreChecked) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const DenseJacobian J(MatrixXd::Ones(3, 4));
  MatrixXd basis;
  GolubKahanSummary summary;
  VectorXd d;
  EXPECT_DEATH(GolubKahanStep(J,
                              VectorXd::Ones(4),
                              SpectralFilter(),
                              GolubKahanOptions(),
                              &basis,
                              &d,
                              &summary),
               "g.size");
  EXPECT_DEATH(GolubKahanStep(J,
                              VectorXd::Ones(3),
                              SpectralFilter(),
                              WithTolerance(0.0),
                              &basis,
                              &d,
                              &summary),
               "tolerance");
  EXPECT_DEATH(GolubKahanStep(J,
                              VectorXd::Ones(3),
                              SpectralFilter::HalfInverse(2.0),
                              GolubKahanOptions(),
                              &basis,
                              &d,
                              &summary),
               "tau=2");
}

}  // namespace golub_kahan_edges_test
}  // namespace invgrad
