// The laws of scale in docs/conventions.md, section 3: by which factor a step
// changes when residuals, loss, x or y are measured in other units.
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "Eigen/Core"
#include "fmt/core.h"
#include "gtest/gtest.h"
#include "invgrad/core/specification.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/rules.h"
#include "invgrad/spectral.h"
#include "invgrad/stored_jacobian.h"

namespace invgrad {
namespace conventions_test {

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

// --- The rules that see more, or less, than J and g ---

// The unscaled problem or one of its changes, with a Hessian whose columns are
// no multiples of J^T J's. Columns A to D of the table, in this order.
enum class Change { kNone, kResiduals, kLoss, kUnitOfX, kUnitOfY };

Linearization Problem(Change change) {
  const double c = kScale;
  Eigen::MatrixXd J = Jacobian();
  Eigen::VectorXd g = LossGradient();
  // d2L/dy2 and what the simulator's curvature adds; indefinite on purpose.
  Eigen::MatrixXd loss_hessian = Eigen::Vector3d(1.0, 2.0, 0.5).asDiagonal();
  Eigen::MatrixXd hessian(4, 4);
  hessian << 3.0, 0.5, -0.2, 0.1,  //
      0.5, -2.0, 0.3, 0.4,         //
      -0.2, 0.3, 1.5, -0.6,        //
      0.1, 0.4, -0.6, 2.5;
  switch (change) {
    case Change::kNone:
      break;
    case Change::kResiduals:  // L = 1/2 |r|^2 keeps its H_L
      J *= c;
      g *= c;
      hessian *= c * c;
      break;
    case Change::kLoss:
      g *= c;
      loss_hessian *= c;
      hessian *= c;
      break;
    case Change::kUnitOfX:
      J *= c;
      hessian *= c * c;
      break;
    case Change::kUnitOfY:
      J *= c;
      g /= c;
      loss_hessian /= c * c;
      break;
  }
  Linearization at_x;
  at_x.cost = 1.0;  // no rule reads it
  at_x.gradient = J.transpose() * g;
  at_x.loss_gradient = g;
  at_x.jacobian = std::make_shared<DenseJacobian>(J);
  at_x.loss_hessian_times = [loss_hessian](const Eigen::VectorXd& v) {
    return Eigen::VectorXd(loss_hessian * v);
  };
  at_x.hessian = hessian;
  at_x.hessian_times = [hessian](const auto& v, auto* Hv, auto*) {
    *Hv = hessian * v;
    return true;
  };
  return at_x;
}

// The second of two steps at one place, so that what a rule remembers counts.
Eigen::VectorXd SecondStep(const Specification& specification, Change change) {
  std::string error;
  const std::unique_ptr<UpdateRule> rule = MakeRule(specification, &error);
  EXPECT_NE(rule, nullptr) << error;
  const Linearization at_x = Problem(change);
  Eigen::VectorXd step;
  for (int i = 0; i < 2; ++i) {
    EXPECT_TRUE(rule->ComputeStep(at_x, &step, &error)) << error;
  }
  // A step of x' in the old units is c times as long.
  return change == Change::kUnitOfX ? Eigen::VectorXd(kScale * step) : step;
}

void ExpectRuleScaling(const std::string& name,
                       Settings settings,
                       const Exponents& exponents,
                       double tolerance = kTolerance) {
  SCOPED_TRACE(name);
  const Specification specification{name, name, std::move(settings)};
  const Eigen::VectorXd d = SecondStep(specification, Change::kNone);
  const auto expect_factor = [&](Change change, double p) {
    const Eigen::VectorXd changed = SecondStep(specification, change);
    const double factor = std::pow(kScale, p);
    EXPECT_LE((changed - factor * d).norm(), tolerance * factor * d.norm())
        << "measured factor " << changed.norm() / d.norm() << ", expected "
        << factor;
  };
  expect_factor(Change::kResiduals, exponents.residuals);
  expect_factor(Change::kLoss, exponents.loss);
  expect_factor(Change::kUnitOfX, exponents.unit_of_x);
  expect_factor(Change::kUnitOfY, exponents.unit_of_y);
}

TEST(Conventions, ScalingOfNewton) {
  ExpectRuleScaling("newton", {}, {0.0, 0.0, 0.0, 0.0});
  ExpectRuleScaling("saddle_free_newton", {}, {0.0, 0.0, 0.0, 0.0});
}

TEST(Conventions, ScalingOfAdaHessian) {
  ExpectRuleScaling(
      "adahessian", {{"epsilon", "1e-12"}}, {0.0, 0.0, 0.0, 0.0}, 1e-6);
}

// The damping is in units of the Hessian.
TEST(Conventions, ScalingOfHessianFree) {
  const auto step = [](double damping, Change change) {
    return SecondStep({"hessian_free",
                       "hessian_free",
                       {{"damping", fmt::format("{:.17g}", damping)}}},
                      change);
  };
  const double damping = 0.1;
  const Eigen::VectorXd d = step(damping, Change::kNone);
  EXPECT_GT((step(2.0 * damping, Change::kNone) - d).norm(), 0.01 * d.norm());
  const double c = kScale;
  for (const auto& [change, factor] : {std::pair(Change::kResiduals, c * c),
                                       std::pair(Change::kLoss, c),
                                       std::pair(Change::kUnitOfX, c * c),
                                       std::pair(Change::kUnitOfY, 1.0)}) {
    EXPECT_LE((step(factor * damping, change) - d).norm(),
              kTolerance * d.norm());
  }
}

// epsilon is not negligible to kTolerance, but to this: gradients are about 1.
TEST(Conventions, ScalingOfTheRulesThatNormalizeTheGradient) {
  const double tolerance = 1e-6;
  const Exponents exponents = {0.0, 0.0, 1.0, 0.0};
  const std::string epsilon = "1e-12";
  ExpectRuleScaling("adam", {{"epsilon", epsilon}}, exponents, tolerance);
  ExpectRuleScaling("rmsprop", {{"epsilon", epsilon}}, exponents, tolerance);
  ExpectRuleScaling("adagrad", {{"epsilon", epsilon}}, exponents, tolerance);
  ExpectRuleScaling("adadelta", {{"epsilon", epsilon}}, exponents, tolerance);
}

TEST(Conventions, ScalingOfMomentum) {
  ExpectRuleScaling(
      "gradient_descent", {{"momentum", "0.9"}}, {2.0, 1.0, 2.0, 0.0});
}

TEST(Conventions, AnAutomaticStepSizeMakesEveryDirectionFree) {
  const Exponents exponents = {0.0, 0.0, 0.0, 0.0};
  // The rules' own truncation keeps the smallest singular value, 3e-5 s_max: by
  // the SVD the steps are off by a few epsilon / 3e-5, some 1e-11.
  for (const char* name :
       {"half_inverse", "gauss_newton", "levenberg_marquardt", "power"}) {
    for (const char* control : {"none", "gain"}) {
      ExpectRuleScaling(
          name,
          {{"step_size", "auto"}, {"route", "svd"}, {"control", control}},
          exponents,
          1e-10);
    }
  }
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

}  // namespace conventions_test
}  // namespace invgrad
