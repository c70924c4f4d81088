// The laws of scale in docs/conventions.md, section 3: by which factor a step
// changes when residuals, loss, x or y are measured in other units.
#include <cmath>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/linalg/jacobian_operator.h"
#include "invgrad/linalg/spectral_filter.h"
#include "invgrad/linalg/spectral_step.h"

namespace invgrad {
namespace {

constexpr double kScale = 7.3;
constexpr double kTau = 1e-3;

// The oracle's relative error is a few epsilon / tau.
constexpr double kTolerance = 1e-12;

// 3 x 4, its rows of different sizes: singular values about 3, 0.7 and 1e-4,
// the last of which kTau drops.
Eigen::MatrixXd Jacobian() {
  Eigen::MatrixXd J(3, 4);
  J << 1.0, -2.0, 0.5, 1.5,  //
      0.3, 0.1, -0.6, 0.4,   //
      1e-4, 2e-4, 1e-4, -1e-4;
  return J;
}

Eigen::VectorXd LossGradient() { return Eigen::Vector3d(0.8, -1.1, 0.6); }

Eigen::VectorXd Direction(const SpectralFilter& filter,
                          const Eigen::MatrixXd& J,
                          const Eigen::VectorXd& g) {
  SpectralStepOptions options;
  options.route = SpectralRoute::kSvd;
  SpectralStepSummary summary;
  Eigen::VectorXd d;
  EXPECT_TRUE(SpectralStep(DenseJacobian(J), g, filter, options, &d, &summary))
      << summary.message;
  return d;
}

// The exponents p of the table: the step changes by kScale^p.
struct Exponents {
  double residuals;
  double loss;
  double unit_of_x;
  double unit_of_y;
};

void ExpectScaling(const SpectralFilter& filter, const Exponents& exponents) {
  const Eigen::MatrixXd J = Jacobian();
  const Eigen::VectorXd g = LossGradient();
  const double c = kScale;
  const Eigen::VectorXd d = Direction(filter, J, g);
  const auto expect_factor = [&d](const Eigen::VectorXd& changed, double p) {
    const double factor = std::pow(kScale, p);
    EXPECT_LE((changed - factor * d).norm(), kTolerance * factor * d.norm())
        << "measured factor " << changed.norm() / d.norm() << ", expected "
        << factor;
  };
  expect_factor(Direction(filter, c * J, c * g), exponents.residuals);
  expect_factor(Direction(filter, J, c * g), exponents.loss);
  // A step of x' in the old units is c times as long.
  expect_factor(c * Direction(filter, c * J, g), exponents.unit_of_x);
  expect_factor(Direction(filter, c * J, g / c), exponents.unit_of_y);
}

TEST(Conventions, ScalingOfGradientDescent) {
  ExpectScaling(SpectralFilter::GradientDescent(), {2.0, 1.0, 2.0, 0.0});
}

TEST(Conventions, ScalingOfHalfInverse) {
  ExpectScaling(SpectralFilter::HalfInverse(kTau), {0.5, 1.0, 0.5, -1.5});
}

TEST(Conventions, ScalingOfTruncatedGaussNewton) {
  ExpectScaling(SpectralFilter::GaussNewton(kTau), {0.0, 1.0, 0.0, -2.0});
}

TEST(Conventions, ScalingOfAnyPower) {
  for (const double kappa : {-0.5, 0.0, 0.25, 0.75}) {
    SCOPED_TRACE(kappa);
    ExpectScaling(SpectralFilter::Power(kappa, kTau),
                  {1.0 - kappa, 1.0, 1.0 - kappa, -1.0 - kappa});
  }
}

TEST(Conventions, ClampingScalesAsTruncationDoes) {
  SpectralFilter filter = SpectralFilter::HalfInverse(kTau);
  filter.clamp = true;
  ExpectScaling(filter, {0.5, 1.0, 0.5, -1.5});
}

TEST(Conventions, ScalingOfLevenbergMarquardtWithRelativeDamping) {
  ExpectScaling(SpectralFilter::LevenbergMarquardt(0.0, 0.01),
                {0.0, 1.0, 0.0, -2.0});
}

TEST(Conventions, AbsoluteDampingHasTheUnitOfSquaredSingularValues) {
  const double damping = 0.05;
  const double c = kScale;
  const Eigen::MatrixXd J = Jacobian();
  const Eigen::VectorXd g = LossGradient();
  const Eigen::VectorXd expected = Direction(
      SpectralFilter::LevenbergMarquardt(damping / (c * c), 0.0), J, g);
  const Eigen::VectorXd actual =
      Direction(SpectralFilter::LevenbergMarquardt(damping, 0.0), c * J, c * g);
  EXPECT_LE((actual - expected).norm(), kTolerance * expected.norm());
}

// Section 4: a model against the same model as a Ceres problem, whose residuals
// and Jacobian both hold the root of alpha.
TEST(Conventions, StepSizeOfAModelAsACeresProblem) {
  const double alpha = 2.0 / 32.0;
  const Eigen::MatrixXd J = Jacobian();
  const Eigen::VectorXd difference = LossGradient();  // y - y*
  for (const double kappa : {-1.0, 0.5, 1.0}) {
    SCOPED_TRACE(kappa);
    const SpectralFilter filter = SpectralFilter::Power(kappa, kTau);
    const Eigen::VectorXd in_training =
        Direction(filter, J, alpha * difference);
    const Eigen::VectorXd in_problem =
        std::pow(alpha, (1.0 + kappa) / 2.0) *
        Direction(filter, std::sqrt(alpha) * J, std::sqrt(alpha) * difference);
    EXPECT_LE((in_training - in_problem).norm(),
              kTolerance * in_training.norm());
  }
}

}  // namespace
}  // namespace invgrad
