// Sentences of the book about gradients, Newton's method, inverse gradients and
// physical gradients, in closed form: what docs/examples/physical_gradients.cc
// measures for docs/results/physical_gradients.md.

#include "docs/examples/physical_gradients.h"

#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/LU"
#include "Eigen/SVD"
#include "docs/examples/physical_gradients_in_time.h"
#include "gtest/gtest.h"
#include "invgrad/linear_simulator.h"
#include "tests/support/create_problem.h"
#include "tests/support/least_squares.h"

namespace invgrad {
namespace physical_gradients_test {

using namespace physical_gradients;  // NOLINT: what is tested
using Eigen::Matrix3d;

void ExpectNearRelative(double value, double expected, double tolerance) {
  EXPECT_NEAR(value, expected, tolerance * std::abs(expected));
}

// "Function sensitivity": L = c x.
TEST(FunctionSensitivity, TheLossFallsBySquareOfCForGradientsOnly) {
  for (const bool is_linear : {true, false}) {
    for (const double c : {0.1, 1.0, 10.0}) {
      SCOPED_TRACE(c);
      const auto fall = [&](int method) {
        return FallOfLoss(kMethods[method].text, c, is_linear);
      };
      // The steps have eta = 1e-6: the second order is eta c^2.
      ExpectNearRelative(fall(kGradientDescent), c * c, 1e-3);
      ExpectNearRelative(fall(kHalfInverse), std::sqrt(c), 1e-3);
      ExpectNearRelative(fall(kInverseGradient), 1.0, 1e-3);
      ExpectNearRelative(fall(kPhysicalGradient), 1.0, 1e-3);
      ExpectNearRelative(FallOfLoss("adam:step_size=", c, is_linear), c, 1e-3);
    }
  }
}

TEST(FunctionSensitivity, NewtonNeedsALossThatCurves) {
  for (const double c : {0.1, 1.0, 10.0}) {
    ExpectNearRelative(FallOfLoss(kMethods[kNewton].text, c, false), 1.0, 1e-3);
    EXPECT_LT(FallOfLoss(kMethods[kNewton].text, c, true), 1e-200);
  }
}

// "Consistency in function compositions": L = 1/2 (sqrt(y(x)) - 3)^2 at y = 1,
// where dL/dy = -1 and d2L/dy2 = 3/4.

struct InnerDerivatives {
  double slope;  // y'(x)
  double curvature;
};
constexpr InnerDerivatives kInner[kNumInner] = {
    {1.0, 0.0}, {10.0, 0.0}, {1.0, 1.0}, {3.0, 6.0}};

TEST(Composition, ThePhysicalGradientChangesYAsIfYWereTheUnknown) {
  for (const double eta : {1e-4, 0.3, 1.0}) {
    for (int inner = 0; inner < kNumInner; ++inner) {
      const double z = 1.0 + 2.0 * eta;
      ExpectNearRelative(
          ChangeOfY(kPhysicalGradient, inner, eta), z * z - 1.0, 1e-11);
    }
  }
}

TEST(Composition, TheOthersDependOnYOfX) {
  constexpr double kEta = 1e-4;
  for (int inner = 0; inner < kNumInner; ++inner) {
    SCOPED_TRACE(inner);
    const auto& [slope, curvature] = kInner[inner];
    const auto change = [inner](int method) {
      return ChangeOfY(method, inner, kEta) / kEta;
    };
    ExpectNearRelative(change(kGradientDescent), slope * slope, 5e-3);
    ExpectNearRelative(change(kHalfInverse), std::sqrt(8.0 * slope), 5e-3);
    // Not even Newton's: of y = exp(x) it has the wrong sign.
    ExpectNearRelative(change(kNewton),
                       slope * slope / (0.75 * slope * slope - curvature),
                       5e-3);
    // Right to first order.
    ExpectNearRelative(change(kInverseGradient), 4.0, 5e-3);
  }
  ExpectNearRelative(
      ChangeOfY(kInverseGradient, kExponential, 1.0), std::exp(4.0) - 1, 1e-9);
}

// "Applying normalization to a simulation anywhere but after the last solver
// step would destroy the state of the simulation."
TEST(Normalization, OfALastStateCanBeUndone) {
  for (const bool is_linear : {false, true}) {
    const NormalizationErrors errors =
        ErrorsByNormalization(is_linear, false, 2);
    EXPECT_GT(errors.as_it_is, 0.1);
    EXPECT_LT(errors.after_map, 1e-13);
  }
}

TEST(Normalization, BetweenStepsDestroysTheStateUnlessTheSimulatorIsLinear) {
  EXPECT_LT(ErrorsByNormalization(true, true, 16).after_map, 1e-12);
  EXPECT_GT(ErrorsByNormalization(false, true, 2).after_map, 0.03);
  EXPECT_GT(ErrorsByNormalization(false, true, 16).after_map, 0.5);
}

// "... when simulation parameters at different time steps are optimized
// simultaneously".
TEST(TimeSteps, OscillatorsAreThoseOfTheProblem) {
  struct Case {
    std::string problem;
    Oscillators oscillators;
  };
  for (const auto& [specification, oscillators] :
       {Case{"oscillator_chain:num_samples=1", {}},
        Case{"oscillator_chain:coupling=cubic:num_samples=1",
             {0.125, 0.0, 1.0, 3.0}}}) {
    const LearningProblem problem = CreateLearningProblem(specification);
    const Simulator& simulator = problem.model->simulator();
    const VectorXd state = problem.train.contexts.col(0);
    const int num_steps = simulator.num_inputs();
    const VectorXd x = VectorXd::Zero(num_steps);
    VectorXd y(4);
    Eigen::Matrix<double, 4, Eigen::Dynamic, Eigen::RowMajor> J(4, num_steps);
    ASSERT_TRUE(simulator.Evaluate(x.data(), state.data(), y.data(), J.data()));
    EXPECT_LT((JacobianOf(oscillators, num_steps, state) - J).norm(),
              1e-12 * J.norm());
  }
}

TEST(TimeSteps, GradientsScaleWithTheColumnsOfJ) {
  const MatrixXd J = JacobianOf({}, 24, Eigen::Vector4d::Zero());
  EXPECT_LT((StepByTime(J, -1.0) - J.colwise().norm().transpose()).norm(),
            1e-12);
  const MatrixXd pseudo_inverse = LeastSquares(J, MatrixXd::Identity(4, 4));
  EXPECT_LT((StepByTime(J, 1.0) - pseudo_inverse.rowwise().norm()).norm(),
            1e-12);
}

// "More prone to high-frequency noise": y = x + epsilon sin(kx).
TEST(Noise, MovesThePhysicalGradientByEpsilonAtMost) {
  for (const double k : {1.0, 10.0, 99.0}) {  // P is injective
    EXPECT_LT(NoiseErrors(MethodText(kPhysicalGradient, 1.0), k).largest,
              1e-14);
  }
  for (const double k : {1e3, 1e4}) {
    const StepErrors errors =
        NoiseErrors(MethodText(kPhysicalGradient, 1.0), k);
    EXPECT_LE(errors.largest, Noisy::kEpsilon);
    EXPECT_GT(errors.largest, 0.1 * Noisy::kEpsilon);
  }
}

// With epsilon k = 0.3 and epsilon k^2 = 9.
TEST(Noise, MovesNewtonByTheSecondDerivativeAndTheOthersByTheFirst) {
  const auto median = [](int method) {
    return NoiseErrors(MethodText(method, 1.0), 30.0).median;
  };
  EXPECT_GT(median(kNewton), 0.9);
  EXPECT_NEAR(median(kGradientDescent), 0.2, 0.1);
  EXPECT_NEAR(median(kInverseGradient), 0.2, 0.1);
  EXPECT_NEAR(median(kHalfInverse), 0.5 * median(kInverseGradient), 0.02);
}

// "Convergence near optimum": y = exp(x), y* = e, from x = 0.8.

std::vector<double> ExpDistances(int method, double eta) {
  return Distances(
      ExpSetting(std::exp(1.0)), 0.8, 1.0, MethodText(method, eta), 6);
}

TEST(ConvergenceNearOptimum, OfGradientsIsLinear) {
  // 1 - eta s^2 and 1 - eta s^(1/2) with s = e.
  const std::vector<double> gradient = ExpDistances(kGradientDescent, 0.1);
  EXPECT_NEAR(gradient[6] / gradient[5], 1.0 - 0.1 * std::exp(2.0), 2e-3);
  const std::vector<double> half = ExpDistances(kHalfInverse, 0.5);
  EXPECT_NEAR(half[6] / half[5], 1.0 - 0.5 * std::exp(0.5), 1e-3);
}

TEST(ConvergenceNearOptimum, OfNewtonAndTheInverseGradientIsQuadratic) {
  struct Case {
    int method;
    double factor;  // L''' / (2 L'') and y'' / (2 y')
  };
  for (const auto& [method, factor] :
       {Case{kNewton, 1.5}, Case{kInverseGradient, 0.5}}) {
    const std::vector<double> distance = ExpDistances(method, 1.0);
    for (int k = 0; k < 6; ++k) {
      if (distance[k] > 0.05 || distance[k + 1] < 1e-14) continue;
      ExpectNearRelative(
          distance[k + 1] / (distance[k] * distance[k]), factor, 0.1);
    }
    EXPECT_LT(distance[6], 1e-14);
  }
}

TEST(ConvergenceNearOptimum, OfThePhysicalGradientIsExact) {
  EXPECT_LT(ExpDistances(kPhysicalGradient, 1.0)[1], 1e-15);
  // With eta = 1/2 the distance in y is halved.
  const std::vector<double> distance = ExpDistances(kPhysicalGradient, 0.5);
  const double first = std::exp(1.0) - std::exp(1.0 - distance[0]);
  for (int k = 1; k <= 6; ++k) {
    EXPECT_NEAR(std::exp(1.0) - std::exp(1.0 - distance[k]),
                std::pow(0.5, k) * first,
                1e-14);
  }
}

// y = x^2, y* = 0: the loss x^4 / 2 is flat at its optimum.
TEST(ConvergenceNearOptimum, OfNewtonIsLinearWhereTheHessianVanishes) {
  const auto distances = [](int method, double eta) {
    return Distances(SquareSetting(), 1.0, 0.0, MethodText(method, eta), 6);
  };
  EXPECT_NEAR(distances(kNewton, 1.0)[6], std::pow(2.0 / 3.0, 6), 1e-14);
  EXPECT_NEAR(distances(kInverseGradient, 1.0)[6], std::pow(0.5, 6), 1e-14);
  EXPECT_EQ(distances(kPhysicalGradient, 1.0)[1], 0.0);
  for (const int method : {kGradientDescent, kHalfInverse}) {
    const std::vector<double> distance = distances(method, 0.1);
    // Slower and slower.
    EXPECT_GT(distance[6] / distance[5], distance[1] / distance[0]);
  }
}

// "A local inverse approximates it and matches it exactly as y -> y0": of order
// p, |P^-1(y; x0) - P^-1(y)| ~ |y - y0|^p, and the book's limit needs p > 1.
TEST(LocalInverse, HasTheOrderOfItsMethod) {
  struct Case {
    std::string method;
    int num_steps;
    double order;
    double first, second;  // changes of y, above the rounding
  };
  for (const auto& [method, num_steps, order, first, second] :
       {Case{MethodText(kGradientDescent, 0.1), 1, 1.0, 1e-4, 1e-5},
        Case{MethodText(kHalfInverse, 0.5), 1, 1.0, 1e-4, 1e-5},
        Case{"gauss_newton", 1, 2.0, 1e-3, 1e-4},
        Case{"gauss_newton", 2, 4.0, 0.02, 0.01},
        Case{"gauss_newton", 3, 8.0, 0.1, 0.07},
        Case{MethodText(kNewton, 1.0), 1, 2.0, 1e-3, 1e-4}}) {
    const double measured =
        std::log(LocalInverseError(method, num_steps, first) /
                 LocalInverseError(method, num_steps, second)) /
        std::log(first / second);
    EXPECT_NEAR(measured, order, 0.1 * order) << method << " " << num_steps;
  }
  // The inverse gradient's: |x''(y)| / 2 change^2, x'' = 1 / y^2.
  ExpectNearRelative(
      LocalInverseError("gauss_newton", 1, 1e-3), 1e-6 / 8.0, 1e-2);
  EXPECT_LT(LocalInverseError(MethodText(kPhysicalGradient, 1.0), 1, 1.0),
            1e-15);
}

// "Even when the Jacobian is singular (because the function is ... chaotic)":
// Lorenz' equations, with Lyapunov exponents 0.906, 0 and -14.572.

// The volume shrinks at the same rate everywhere, by Liouville's theorem.
TEST(Chaos, TheJacobianHasTheDeterminantOfTheFlow) {
  for (const Vector3d& state : LorenzStates(10)) {
    const Matrix3d J = LorenzJacobian(state, Lorenz{40, 0.0025});
    EXPECT_NEAR(std::log(J.determinant()), -(41.0 / 3.0) * 0.1, 1e-6);
  }
}

TEST(Chaos, TheJacobianGrowsWithTheLargestLyapunovExponent) {
  const std::vector<Vector3d> states = LorenzStates(40);
  const auto mean_log_norm = [&](int num_steps) {
    double sum = 0.0;
    for (const Vector3d& state : states) {
      const Matrix3d J = LorenzJacobian(state, Lorenz{num_steps});
      sum += std::log(Eigen::JacobiSVD<Matrix3d>(J).singularValues()[0]);
    }
    return sum / static_cast<double>(states.size());
  };
  EXPECT_NEAR(
      (mean_log_norm(1000) - mean_log_norm(400)) / 6.0, Lorenz::kExponent, 0.1);
}

TEST(Chaos, BackwardsTheErrorGrowsSixteenTimesAsFast) {
  const std::vector<Vector3d> states = LorenzStates(20);
  const auto mean_log_error = [&](double time) {
    const int num_steps = static_cast<int>(std::lround(100.0 * time));
    double sum = 0.0;
    for (const Vector3d& x : states) {
      const Vector3d y = Lorenz{num_steps}(x);
      sum += std::log((LorenzBackwards(y, num_steps, true) - x).norm());
    }
    return sum / static_cast<double>(states.size());
  };
  EXPECT_NEAR(mean_log_error(1.5) - mean_log_error(0.5), 14.57, 1.5);
}

// "To first order, eta_eff = eta eta_NN."

// One step of a network in front of y = exp(x), or of y = 2 x.
VectorXd WeightStep(bool is_linear, const std::string& method) {
  const DenseNetwork network({1, 8, 1}, Activation::kTanh);
  std::shared_ptr<const Simulator> simulator =
      std::make_shared<AutoDiffSimulator<Exp, 1, 1>>();
  if (is_linear) {
    simulator = std::make_shared<LinearSimulator>(
        MatrixXd::Constant(1, 1, 2.0).sparseView(), VectorXd::Zero(1));
  }
  const Model model(network,
                    simulator,
                    std::make_shared<SquaredNormLoss>(1, 0.5),
                    Reduction::kMean);
  const MatrixXd y = VectorXd::LinSpaced(16, 0.2, 2.0).transpose();
  TrainOptions options;
  options.batch_size = 0;
  options.max_num_steps = 1;
  options.inverse = is_linear
                        ? Inverse([](const auto& y, const auto& /*x_now*/) {
                            return std::optional<VectorXd>(0.5 * y);
                          })
                        : ExpSetting(0.0).inverse;
  NumpyRandom random(1);
  options.initial_weights =
      network.InitialWeights(Initialization::kGlorotUniform, &random);
  const TrainResult result = Train(model, {y, y}, method, options);
  EXPECT_EQ(result.error, "");
  return result.weights - options.initial_weights;
}

VectorXd WeightStep(bool is_linear,
                    const std::string& rule,
                    double step_size,
                    double y_step_size) {
  return WeightStep(
      is_linear,
      WithNumber(
          WithNumber("newton/inverse/" + rule + ":step_size=", step_size) +
              ":y_step_size=",
          y_step_size));
}

TEST(EffectiveRate, IsTheProductForGradientDescentToFirstOrder) {
  const auto difference = [](bool is_linear, double eta) {
    const auto step = [is_linear](double y_step_size) {
      return WeightStep(
          is_linear, "gradient_descent", 0.01 / y_step_size, y_step_size);
    };
    const VectorXd limit = step(1e-5);
    return (step(eta) - limit).norm() / limit.norm();
  };
  EXPECT_LT(difference(true, 1.0), 1e-9);
  EXPECT_GT(difference(false, 1.0), 0.02);
  EXPECT_NEAR(difference(false, 0.04) / difference(false, 0.02), 2.0, 0.1);
}

TEST(EffectiveRate, IsThatOfTheNetworkForAdam) {
  const VectorXd full = WeightStep(true, "adam", 1e-3, 1.0);
  EXPECT_LT((WeightStep(true, "adam", 1e-3, 1e-2) - full).norm(),
            1e-3 * full.norm());
}

// "... when individual samples in a batch lead to vectors in the Jacobian that
// are linearly dependent (or very close to it)".

double StepLength(const std::string& rule, double distance, double conflict) {
  return StepOfTwoSamples(rule, distance, conflict).length;
}

TEST(CloseSamples, GaussNewtonsStepGrowsAsTheInverseOfTheirDistance) {
  const std::string rule = "gauss_newton:truncation=0";
  ExpectNearRelative(
      StepLength(rule, 1e-5, 0.1) / StepLength(rule, 1e-3, 0.1), 100.0, 0.1);
}

TEST(CloseSamples, HalfInversesStepGrowsAsItsRoot) {
  const std::string rule = "half_inverse:truncation=0";
  ExpectNearRelative(
      StepLength(rule, 1e-9, 0.1) / StepLength(rule, 1e-7, 0.1), 10.0, 0.2);
}

TEST(CloseSamples, WithTargetsThatAgreeGaussNewtonsStepIsBounded) {
  const std::string rule = "gauss_newton:truncation=0";
  ExpectNearRelative(
      StepLength(rule, 1e-5, 0.0), StepLength(rule, 1e-3, 0.0), 0.1);
}

TEST(CloseSamples, TruncationTakesEqualOnesForOne) {
  for (const double conflict : {0.0, 0.1}) {
    ExpectNearRelative(StepLength("gauss_newton", 1e-9, conflict),
                       StepLength("gauss_newton", 0.0, conflict),
                       1e-4);
  }
}

}  // namespace physical_gradients_test
}  // namespace invgrad
