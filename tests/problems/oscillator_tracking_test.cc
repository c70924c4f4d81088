#include "problems/oscillator_tracking.h"

#include <cmath>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/random.h"
#include "problems/problems.h"
#include "tests/support/create_problem.h"
#include "tests/support/least_squares.h"
#include "tests/support/take_steps.h"
#include "tests/support/train_problem.h"

namespace invgrad {
namespace oscillator_tracking_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// The linear-quadratic regulator of the linear problem over its horizon, from
// its equations alone.
struct Regulator {
  MatrixXd A;               // ns x ns
  MatrixXd B;               // ns x 1
  std::vector<MatrixXd> K;  // u_t = -K_t s_t
  MatrixXd Pi;              // L = s_0^T Pi s_0

  explicit Regulator(const OscillatorTracking& options) {
    const int n = options.num_oscillators;
    const int ns = 2 * n + 4;
    const double dt = options.dt;
    // s' = F s + G u of the chain; a Runge-Kutta step of order 4 is the
    // exponential series up to the fourth power.
    MatrixXd F = MatrixXd::Zero(2 * n, 2 * n);
    F.topRightCorner(n, n).setIdentity();
    F.bottomLeftCorner(n, n) = -MatrixXd::Identity(n, n);
    for (int i = 0; i + 1 < n; ++i) {
      F.block(n + i, i, 2, 2) +=
          0.2 * (Eigen::Matrix2d() << -1, 1, 1, -1).finished();
    }
    VectorXd G = VectorXd::Zero(2 * n);
    G[2 * n - 1] = 1.0;
    const MatrixXd I = MatrixXd::Identity(2 * n, 2 * n);
    MatrixXd integral = I;  // of the series, over dt
    for (int k = 4; k > 1; --k) integral = I + (dt / k) * F * integral;
    A = MatrixXd::Zero(ns, ns);
    A.topLeftCorner(2 * n, 2 * n) = I + dt * F * integral;
    B = MatrixXd::Zero(ns, 1);
    B.topRows(2 * n) = dt * integral * G;
    for (int i = 0; i < 2; ++i) {
      const double angle = OscillatorTracking::kFrequencies[i] * dt;
      A.block(2 * n + 2 * i, 2 * n + 2 * i, 2, 2) << std::cos(angle),
          std::sin(angle), -std::sin(angle), std::cos(angle);
    }
    Eigen::RowVectorXd C = Eigen::RowVectorXd::Zero(ns);  // the error
    C[n - 1] = 1.0;
    C[2 * n] = C[2 * n + 2] = -1.0;
    Pi = MatrixXd::Zero(ns, ns);
    K.resize(options.horizon);
    for (int t = options.horizon - 1; t >= 0; --t) {
      const double weight = t + 1 == options.horizon ? options.end_weight : 1.0;
      const MatrixXd W = Pi + dt * weight * C.transpose() * C;
      const double curvature =
          dt * options.control_weight + (B.transpose() * W * B).value();
      K[t] = B.transpose() * W * A / curvature;
      Pi = A.transpose() * W * A - curvature * K[t].transpose() * K[t];
    }
  }

  VectorXd OptimalControls(VectorXd state) const {
    VectorXd x(K.size());
    for (std::size_t t = 0; t < K.size(); ++t) {
      x[t] = -(K[t] * state).value();
      state = A * state + B * x[t];
    }
    return x;
  }

  // The least mean loss of the samples.
  double Bound(const DataSet& data) const {
    return data.contexts.cwiseProduct(Pi * data.contexts).sum() /
           data.num_samples();
  }
};

class LinearTracking : public testing::TestWithParam<OscillatorTracking> {};

// The physics, the loss and its terms against the linear theory.
TEST_P(LinearTracking, OptimalControlsAreThoseOfTheRegulator) {
  LearningProblem problem;
  std::string error;
  ASSERT_TRUE(GetParam().Create(&problem, &error));
  const Regulator regulator(GetParam());
  const Simulator& simulator = problem.model->simulator();
  VectorXd y(simulator.num_outputs());
  VectorXd x_bar(simulator.num_inputs());
  for (int s = 0; s < 3; ++s) {
    const VectorXd state = problem.train.contexts.col(s);
    const VectorXd x = regulator.OptimalControls(state);
    ASSERT_TRUE(simulator.Adjoint(
        x.data(),
        state.data(),
        [&y](const double* at, double* w) {
          Eigen::Map<VectorXd>(w, y.size()) =
              2.0 * Eigen::Map<const VectorXd>(at, y.size());
          return true;
        },
        y.data(),
        x_bar.data()));
    EXPECT_NEAR(y.squaredNorm(), state.dot(regulator.Pi * state), 1e-12);
    EXPECT_LT(x_bar.norm(), 1e-12);
    EXPECT_GT(y.squaredNorm(), 1e-3);
    const DataSet sample = problem.train.Range(s, 1);
    ASSERT_TRUE(problem.metric.has_value());
    EXPECT_LT(problem.metric->evaluate(x, sample), 1e-24);
    EXPECT_GT(problem.metric->evaluate(-x, sample), 1e-3);
  }
}

// The floor by least squares: y = y_0(s_0) + J x with the same J for all
// samples.
TEST_P(LinearTracking, RegretIsTheDistanceFromTheLeastSquares) {
  LearningProblem problem;
  std::string error;
  ASSERT_TRUE(GetParam().Create(&problem, &error));
  ASSERT_TRUE(problem.metric.has_value());
  const Simulator& simulator = problem.model->simulator();
  VectorXd y(simulator.num_outputs());
  MatrixXd J_transposed(simulator.num_inputs(), simulator.num_outputs());
  NumpyRandom random(3);
  for (int s = 0; s < 3; ++s) {
    const VectorXd state = problem.train.contexts.col(s);
    const VectorXd x =
        2.0 * random.Rand(simulator.num_inputs(), 1).array() - 1.0;
    ASSERT_TRUE(simulator.Evaluate(
        x.data(), state.data(), y.data(), J_transposed.data()));
    const MatrixXd J = J_transposed.transpose();
    const VectorXd best = x - LeastSquares(J, y);
    const double gain = (J * (x - best)).squaredNorm();
    EXPECT_GT(gain, 0.1);
    const DataSet sample = problem.train.Range(s, 1);
    EXPECT_NEAR(problem.metric->evaluate(x, sample), gain, 1e-12 * gain);
    EXPECT_LT(problem.metric->evaluate(best, sample), 1e-24);
  }
}

OscillatorTracking WithEndWeight() {
  OscillatorTracking options;
  options.num_oscillators = 4;
  options.horizon = 9;
  options.control_weight = 0.3;
  options.end_weight = 5.0;
  options.num_samples = 4;
  return options;
}

INSTANTIATE_TEST_SUITE_P(Options,
                         LinearTracking,
                         testing::Values(OscillatorTracking(), WithEndWeight()),
                         [](const auto& info) {
                           return info.index == 0 ? "Defaults" : "EndWeight";
                         });

// No network can pass the bound, and a short training comes near it.
TEST(OscillatorTracking, TrainedNetworkComesNearTheRegulator) {
  const LearningProblem problem =
      CreateLearningProblem("oscillator_tracking:num_samples=64");
  const double bound = Regulator(OscillatorTracking()).Bound(problem.train);
  std::string error;
  VectorXd weights = InitialWeights(problem, 0);
  double cost = 0.0;
  ASSERT_TRUE(problem.model->Cost(weights, problem.train, &cost, &error));
  EXPECT_GT(cost, 4.0 * bound);
  TakeSteps(problem, "half_inverse:step_size=auto", 16, 30, &weights);
  ASSERT_TRUE(problem.model->Cost(weights, problem.train, &cost, &error));
  EXPECT_GT(cost, bound);
  EXPECT_LT(cost, 1.05 * bound);

  DenseNetwork::Activations activations;
  ASSERT_TRUE(problem.model->Forward(weights,
                                     problem.train,
                                     Network::Derivatives::kFirst,
                                     &activations,
                                     &error));
  EXPECT_NEAR(problem.metric->evaluate(
                  problem.model->SimulatorInputs(activations), problem.train),
              cost - bound,
              1e-13);
}

// No array grows faster than the horizon. Without force the regret is the loss
// but for the floor.
TEST(OscillatorTracking, RegretIsKnownOverLongHorizons) {
  OscillatorTracking options;
  options.horizon = 20000;
  options.num_samples = 1;
  LearningProblem problem;
  std::string error;
  ASSERT_TRUE(options.Create(&problem, &error));
  const VectorXd x = VectorXd::Zero(options.horizon);
  VectorXd y(2 * options.horizon);
  ASSERT_TRUE(problem.model->simulator().Evaluate(
      x.data(), problem.train.contexts.col(0).data(), y.data(), nullptr));
  const double regret =
      y.squaredNorm() - Regulator(options).Bound(problem.train);
  EXPECT_GT(regret, 1.0);
  EXPECT_NEAR(
      problem.metric->evaluate(x, problem.train), regret, 1e-9 * regret);
}

// Where the last step's force changes nothing, any will do.
TEST(OscillatorTracking, AForceWithoutWeightCostsNothing) {
  const LearningProblem problem = CreateLearningProblem(
      "oscillator_tracking:num_samples=2:horizon=1:control_weight=0:"
      "end_weight=0");
  EXPECT_EQ(problem.metric->evaluate(MatrixXd::Ones(1, 2), problem.train), 0.0);
}

TEST(OscillatorTracking, NothingIsKnownOfTheBestForceWithCubicCoupling) {
  EXPECT_FALSE(CreateLearningProblem("oscillator_tracking:coupling=cubic")
                   .metric.has_value());
}

}  // namespace oscillator_tracking_test
}  // namespace invgrad
