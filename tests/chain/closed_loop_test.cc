// Models whose network is called at every step.
#include <limits>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "ceres/jet.h"
#include "gtest/gtest.h"
#include "invgrad/chain/network_jacobian.h"
#include "invgrad/dense_network.h"
#include "invgrad/internal/trajectory_simulator.h"
#include "invgrad/loss.h"
#include "invgrad/model.h"
#include "invgrad/time_stepping_simulator.h"
#include "tests/chain/pendulum_step.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace closed_loop_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Terms {
  template <typename T>
  bool operator()(int t, const T* next_state, const T* u, T* z) const {
    z[0] = next_state[0] * (1.0 + 0.1 * t);
    z[1] = next_state[0] * next_state[1];
    z[2] = 0.3 * u[0];
    return true;
  }
};

// Calls per sample, controls per call, hidden widths, and whether y is the
// trajectory (or the last state).
using Shape = std::tuple<int, int, std::vector<int>, bool>;

class ClosedLoopTest : public testing::TestWithParam<Shape> {
 protected:
  static constexpr int kBatchSize = 3;

  static std::shared_ptr<const Loss> MakeLoss(int size) {
    return std::make_shared<SquaredNormLoss>(size, 1.5);
  }

  static Model MakeModel() {
    const auto& [num_calls, num_controls, hidden, trajectory] = GetParam();
    std::vector<int> widths = {3};  // the state and a set point
    widths.insert(widths.end(), hidden.begin(), hidden.end());
    widths.push_back(num_controls);
    const DenseNetwork network(widths, Activation::kTanh);
    const PendulumStep step{num_controls};
    if (trajectory) {
      const auto simulator =
          std::make_shared<TrajectorySimulator<PendulumStep, Terms>>(
              step, Terms(), 2, num_controls, 3, num_calls);
      return Model(network,
                   simulator,
                   MakeLoss(simulator->num_outputs()),
                   Reduction::kMean,
                   simulator);
    }
    const auto simulator =
        std::make_shared<TimeSteppingSimulator<PendulumStep>>(
            step, 2, num_controls, num_calls);
    return Model(network, simulator, MakeLoss(2), Reduction::kMean, simulator);
  }

  DataSet MakeData() const {
    DataSet data;
    data.inputs = RandomMatrix(3, kBatchSize, 11);
    data.contexts = data.inputs.topRows(2);
    data.targets =
        RandomMatrix(model_.simulator().num_outputs(), kBatchSize, 12);
    return data;
  }

  // The whole loop on one scalar type: the oracle. y, and x if wanted.
  template <typename T>
  std::vector<T> RollOut(const std::vector<T>& weights,
                         int sample,
                         std::vector<T>* x) const {
    const auto& [num_calls, num_controls, hidden, trajectory] = GetParam();
    const NetworkFunctor network(*model_.dense_network());
    std::vector<T> a;  // state and set point
    for (const double value : data_.inputs.col(sample)) a.push_back(T(value));
    std::vector<T> u(num_controls);
    std::vector<T> next(2);
    std::vector<T> y;
    if (x != nullptr) x->clear();
    for (int t = 0; t < num_calls; ++t) {
      network(weights.data(), a.data(), u.data());
      PendulumStep{num_controls}(a.data(), u.data(), next.data());
      if (trajectory) {
        T z[3];
        Terms()(t, next.data(), u.data(), z);
        y.insert(y.end(), z, z + 3);
      }
      a[0] = next[0];
      a[1] = next[1];
      if (x != nullptr) x->insert(x->end(), u.begin(), u.end());
    }
    return trajectory ? y : next;
  }

  // Entries of the derivative in the weights of y, or of x.
  MatrixXd JacobianByJets(bool of_x) const {
    using Jet = ceres::Jet<double, 1>;
    MatrixXd J;
    for (int k = 0; k < model_.num_weights(); ++k) {
      std::vector<Jet> weights(weights_.begin(), weights_.end());
      weights[k].v[0] = 1.0;
      std::vector<double> column;
      for (int s = 0; s < kBatchSize; ++s) {
        std::vector<Jet> x;
        const std::vector<Jet> y = RollOut(weights, s, &x);
        for (const Jet& value : of_x ? x : y) column.push_back(value.v[0]);
      }
      if (k == 0) J.resize(column.size(), model_.num_weights());
      J.col(k) = Eigen::Map<const VectorXd>(column.data(), J.rows());
    }
    return J;
  }

  const Model model_ = MakeModel();
  const DataSet data_ = MakeData();
  const VectorXd weights_ = RandomMatrix(model_.num_weights(), 1, 14);
};

// Some hundred operations on numbers of order one to ten.
constexpr double kRounding = 1e-12;

TEST_P(ClosedLoopTest, ForwardIsTheRollOutStepByStep) {
  DenseNetwork::Activations activations;
  std::string error;
  ASSERT_TRUE(model_.Forward(
      weights_, data_, Network::Derivatives::kFirst, &activations, &error))
      << error;
  EXPECT_EQ(activations.num_columns(), kBatchSize * model_.num_calls());
  const auto x = model_.SimulatorInputs(activations);
  ASSERT_EQ(x.cols(), kBatchSize);
  MatrixXd y;
  ASSERT_TRUE(model_.Predict(weights_, data_, &y, &error)) << error;
  const std::vector<double> weights(weights_.begin(), weights_.end());
  for (int s = 0; s < kBatchSize; ++s) {
    std::vector<double> x_s;
    const std::vector<double> y_s = RollOut(weights, s, &x_s);
    ASSERT_EQ(x.rows(), static_cast<int>(x_s.size()));
    for (int i = 0; i < x.rows(); ++i) EXPECT_NEAR(x(i, s), x_s[i], kRounding);
    ASSERT_EQ(y.rows(), static_cast<int>(y_s.size()));
    for (int i = 0; i < y.rows(); ++i) EXPECT_NEAR(y(i, s), y_s[i], kRounding);
  }
  // The activations are those of one forward pass over all calls.
  DenseNetwork::Activations again;
  model_.dense_network()->Forward(
      weights_,
      activations.inputs[0].topRows(model_.network().num_inputs()),
      false,
      &again);
  EXPECT_LT((again.outputs - activations.outputs).norm(), kRounding);
  for (int l = 0; l < model_.dense_network()->num_layers(); ++l) {
    EXPECT_LT((again.inputs[l] - activations.inputs[l]).norm(), kRounding);
    EXPECT_LT((again.slopes[l] - activations.slopes[l]).norm(), kRounding);
  }
}

TEST_P(ClosedLoopTest, JacobianIsThatOfJetsThroughTheLoop) {
  LinearizationParts parts;
  parts.jacobian = true;
  Linearization at;
  std::string error;
  ASSERT_TRUE(model_.Linearize(weights_, data_, parts, &at, &error)) << error;
  MatrixXd J;
  at.jacobian->ToDense(&J);
  const MatrixXd expected = JacobianByJets(false);
  ASSERT_EQ(J.rows(), expected.rows());
  EXPECT_LT((J - expected).norm(), kRounding * expected.norm());

  const VectorXd v = RandomMatrix(J.cols(), 1, 4);
  const VectorXd w = RandomMatrix(J.rows(), 1, 5);
  VectorXd Jv;
  VectorXd Jtw;
  MatrixXd gram;
  at.jacobian->Times(v, &Jv);
  at.jacobian->TransposeTimes(w, &Jtw);
  at.jacobian->Gram(&gram);
  gram = MatrixXd(gram.selfadjointView<Eigen::Lower>());
  EXPECT_LT((Jv - expected * v).norm(), kRounding * expected.norm());
  EXPECT_LT((Jtw - expected.transpose() * w).norm(),
            kRounding * expected.norm());
  EXPECT_LT((gram - expected * expected.transpose()).norm(),
            kRounding * expected.squaredNorm());
}

TEST_P(ClosedLoopTest, GradientIsThatOfCentralDifferences) {
  LinearizationParts parts;
  parts.gradient = true;
  Linearization at;
  std::string error;
  ASSERT_TRUE(model_.Linearize(weights_, data_, parts, &at, &error)) << error;
  const double h = 1e-5;
  for (int k = 0; k < model_.num_weights(); ++k) {
    double above = 0.0;
    double below = 0.0;
    const VectorXd e = h * VectorXd::Unit(model_.num_weights(), k);
    ASSERT_TRUE(model_.Cost(weights_ + e, data_, &above, &error)) << error;
    ASSERT_TRUE(model_.Cost(weights_ - e, data_, &below, &error)) << error;
    // h^2 times a third derivative of order ten to a hundred, and eps / h.
    EXPECT_NEAR(at.gradient[k], (above - below) / (2.0 * h), 1e-7) << k;
  }
  // The two ways to the gradient.
  parts.jacobian = true;
  Linearization both;
  ASSERT_TRUE(model_.Linearize(weights_, data_, parts, &both, &error)) << error;
  EXPECT_LT((both.gradient - at.gradient).norm(),
            kRounding * at.gradient.norm());
  EXPECT_NEAR(both.cost, at.cost, kRounding);
}

// The pull-back of a wanted change of x: dx/dtheta with the loop closed.
TEST_P(ClosedLoopTest, CovectorsOfXReachTheWeightsThroughTheLoop) {
  DenseNetwork::Activations activations;
  std::string error;
  ASSERT_TRUE(model_.Forward(
      weights_, data_, Network::Derivatives::kFirst, &activations, &error))
      << error;
  const int num_x = model_.simulator().num_inputs();
  MatrixXd x_bar = RandomMatrix(num_x, kBatchSize, 7);
  const VectorXd covector = x_bar.reshaped();
  ASSERT_TRUE(model_.CloseLoop(weights_, data_, activations, x_bar, &error))
      << error;
  x_bar.resize(model_.network().num_outputs(), activations.num_columns());
  VectorXd gradient;
  model_.network().Backward(weights_, activations, x_bar, &gradient);
  const VectorXd expected = JacobianByJets(true).transpose() * covector;
  EXPECT_LT((gradient - expected).norm(), kRounding * expected.norm());
}

INSTANTIATE_TEST_SUITE_P(Shapes,
                         ClosedLoopTest,
                         testing::Values(Shape{1, 1, {4}, false},
                                         Shape{3, 1, {}, false},
                                         Shape{3, 1, {4}, true},
                                         Shape{4, 2, {5, 3}, false},
                                         Shape{6, 3, {4, 4}, true}));

// With one call the loop is open: the same numbers to the bit.
TEST(ClosedLoop, OneCallIsTheChainWithoutFeedback) {
  const auto simulator = std::make_shared<TimeSteppingSimulator<PendulumStep>>(
      PendulumStep(), 2, 1, 1);
  const auto loss = std::make_shared<SquaredNormLoss>(2, 1.0);
  const DenseNetwork network({2, 5, 1}, Activation::kTanh);
  const Model open(network, simulator, loss, Reduction::kSum);
  const Model closed(network, simulator, loss, Reduction::kSum, simulator);
  EXPECT_EQ(open.feedback(), nullptr);
  EXPECT_EQ(closed.feedback(), simulator.get());
  // Other states at the start than the network sees: a noisy measurement.
  const DataSet data = {RandomMatrix(2, 4, 1),
                        RandomMatrix(2, 4, 2),
                        RandomMatrix(2, 4, 3),
                        MatrixXd()};
  const VectorXd weights = RandomMatrix(network.num_weights(), 1, 4);
  LinearizationParts all;
  all.gradient = all.jacobian = all.hessian = true;
  Linearization of_open;
  Linearization of_closed;
  std::string error;
  ASSERT_TRUE(open.Linearize(weights, data, all, &of_open, &error)) << error;
  ASSERT_TRUE(closed.Linearize(weights, data, all, &of_closed, &error))
      << error;
  EXPECT_EQ(of_open.cost, of_closed.cost);
  EXPECT_EQ(of_open.gradient, of_closed.gradient);
  EXPECT_EQ(of_open.hessian, of_closed.hessian);
  MatrixXd J_open;
  MatrixXd J_closed;
  of_open.jacobian->ToDense(&J_open);
  of_closed.jacobian->ToDense(&J_closed);
  EXPECT_EQ(J_open, J_closed);
}

Model PendulumModel(int num_calls) {
  const auto simulator = std::make_shared<TimeSteppingSimulator<PendulumStep>>(
      PendulumStep(), 2, 1, num_calls);
  return Model(DenseNetwork({2, 3, 1}, Activation::kTanh),
               simulator,
               std::make_shared<SquaredNormLoss>(2, 1.0),
               Reduction::kSum,
               simulator);
}

// With one call the Hessian is that of the open chain, see above.
TEST(ClosedLoop, HasNoExactHessian) {
  const Model model = PendulumModel(3);
  LinearizationParts parts;
  std::string error;
  EXPECT_TRUE(model.CanLinearize(parts, &error));
  parts.gradient = parts.jacobian = true;
  EXPECT_TRUE(model.CanLinearize(parts, &error));
  parts.hessian = true;
  EXPECT_FALSE(model.CanLinearize(parts, &error));
  EXPECT_EQ(error,
            "a network in a closed loop has no exact Hessian: choose a method "
            "that needs the gradient or the Jacobian");
  const DataSet data = {RandomMatrix(2, 4, 1),
                        RandomMatrix(2, 4, 2),
                        RandomMatrix(2, 4, 3),
                        MatrixXd()};
  Linearization at;
  EXPECT_FALSE(model.Linearize(
      RandomMatrix(model.num_weights(), 1, 1), data, parts, &at, &error));
  EXPECT_TRUE(PendulumModel(1).CanLinearize(parts, &error));
}

TEST(ClosedLoop, LossAndNetworkAreExchangedInTheLoop) {
  const Model model = PendulumModel(3);
  const Model other =
      model.WithLoss(std::make_shared<DotProductLoss>(2), Reduction::kMean);
  EXPECT_EQ(other.num_calls(), 3);
  EXPECT_EQ(
      model.WithNetwork(DenseNetwork({2, 1}, Activation::kTanh)).num_calls(),
      3);
}

TEST(ClosedLoop, ErrorsNameTheSample) {
  const Model model = PendulumModel(3);
  const VectorXd weights = RandomMatrix(model.num_weights(), 1, 1);
  const DataSet good = {RandomMatrix(2, 4, 1),
                        RandomMatrix(2, 4, 2),
                        RandomMatrix(2, 4, 3),
                        MatrixXd()};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto expect_error = [&](const VectorXd& theta,
                                const DataSet& data,
                                const std::string& expected) {
    std::string error;
    double cost;
    EXPECT_FALSE(model.Cost(theta, data, &cost, &error));
    EXPECT_EQ(error, expected);
    for (int mask = 1; mask < 4; ++mask) {
      LinearizationParts parts;
      parts.gradient = (mask & 1) != 0;
      parts.jacobian = (mask & 2) != 0;
      Linearization at;
      EXPECT_FALSE(model.Linearize(theta, data, parts, &at, &error));
      EXPECT_EQ(error, expected);
    }
  };
  DataSet data = good;
  data.inputs(1, 2) = nan;
  expect_error(weights, data, "sample 2: the network's output is not finite");
  data = good;
  data.contexts(0, 2) = nan;
  expect_error(weights,
               data,
               "sample 2: the simulator has no finite value: there is no "
               "finite state after time step 1 of 3");
  VectorXd huge = weights;
  huge[huge.size() - 1] = 100.0;  // the torque's bias: the step refuses it
  expect_error(huge,
               good,
               "sample 0: the simulator has no finite value: there is no "
               "finite state after time step 1 of 3");
}

TEST(ClosedLoopDeathTest, RefusesPartsThatDoNotFit) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const auto simulator = std::make_shared<TimeSteppingSimulator<PendulumStep>>(
      PendulumStep(), 2, 1, 3);
  const auto loss = std::make_shared<SquaredNormLoss>(2, 1.0);
  const auto make = [&](std::vector<int> widths, int num_calls) {
    Model(DenseNetwork(std::move(widths), Activation::kTanh),
          simulator,
          loss,
          Reduction::kSum,
          std::make_shared<TimeSteppingSimulator<PendulumStep>>(
              PendulumStep{1}, 2, 1, num_calls));
  };
  make({2, 1}, 3);
  EXPECT_DEATH(make({2, 3}, 3), "outputs are the simulator's inputs");
  EXPECT_DEATH(make({2, 1}, 2), "outputs are the simulator's inputs");
  EXPECT_DEATH(make({2, 3}, 1), "outputs are the controls of a step");
  EXPECT_DEATH(make({1, 1}, 3), "first part of the network's inputs");
}

}  // namespace closed_loop_test
}  // namespace invgrad
