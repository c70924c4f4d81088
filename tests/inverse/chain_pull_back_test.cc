#include "invgrad/inverse/chain_pull_back.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/linear_simulator.h"
#include "tests/inverse/bend_chain.h"

namespace invgrad {
namespace chain_pull_back_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;
using Options = ChainPullBack::Options;

// --- The adjoint ---

TEST(ChainPullBackTest, GradientAndAdjointAreTheModelsGradient) {
  const DataSet data = RandomData();
  for (const Reduction reduction : {Reduction::kMean, Reduction::kSum}) {
    for (const auto& loss : {QuarticLoss(),
                             std::shared_ptr<const Loss>(
                                 std::make_shared<SquaredNormLoss>(2, 1.5))}) {
      const Model model = MakeModel(loss, reduction);
      const VectorXd weights = RandomWeights(model);
      Linearization expected;
      std::string error;
      ASSERT_TRUE(
          model.Linearize(weights, data, AllParts(), &expected, &error));
      for (const double eta : {1.0, 0.3}) {
        Options options = Ways(LossWay::kGradient, SimulatorWay::kAdjoint);
        options.y_step_size = eta;
        ChainPullBack chain(&model, nullptr, options);
        const Linearization at = Linearized(&chain, weights, data);
        EXPECT_NEAR(at.cost, expected.cost, 1e-13 * expected.cost);
        EXPECT_LT((at.gradient - eta * expected.gradient).norm(),
                  1e-13 * expected.gradient.norm());
        EXPECT_EQ(chain.counts().of(PullBackSource::kDerivative), kNumSamples);
        EXPECT_EQ(chain.counts().Report(), "");
      }
    }
  }
}

// --- The proxy ---

class ProxyTest : public testing::TestWithParam<ChainPullBack::Proxy> {};

TEST_P(ProxyTest, DerivativesAreThoseWithTheWantedInputHeld) {
  const bool is_l2 = GetParam() == ChainPullBack::Proxy::kL2;
  const DataSet data = RandomData();
  for (const Reduction reduction : {Reduction::kMean, Reduction::kSum}) {
    const Model model = MakeModel(QuarticLoss(), reduction);
    const double scale = model.BatchScale(kNumSamples);
    const VectorXd weights = RandomWeights(model);
    Options options = Physical();
    options.proxy = GetParam();
    options.y_step_size = 0.4;
    ChainPullBack chain(&model, BendInverse(), options);
    const Linearization at = Linearized(&chain, weights, data);
    ASSERT_EQ(chain.counts().of(PullBackSource::kInverse), kNumSamples);

    // x~ = P^-1(y - eta H_L^-1 g), by hand.
    const MatrixXd x = NetworkOutputs(model, weights, data);
    MatrixXd wanted(2, kNumSamples);
    for (int s = 0; s < kNumSamples; ++s) {
      Vector2d y = Vector2d::Zero();
      Bend()(x.col(s).data(), y.data());
      const Vector2d d = y - data.targets.col(s);
      y[0] -= 0.4 * (d[0] * d[0] * d[0] + d[0]) / (3.0 * d[0] * d[0] + 1.0);
      y[1] -= 0.4 * d[1];
      wanted.col(s) = InvertBend(y, x.col(s)).value();
    }
    // The kinks of the L1 proxy are far.
    ASSERT_GT((wanted - x).cwiseAbs().minCoeff(), 1e-3);

    const auto proxy = [&](const VectorXd& theta) {
      const MatrixXd d = NetworkOutputs(model, theta, data) - wanted;
      return scale * (is_l2 ? 0.5 * d.squaredNorm() : d.cwiseAbs().sum());
    };
    EXPECT_LT((at.gradient - Differences(proxy, weights)).norm(), 1e-8);

    // J, g and H_L of what comes after x.
    MatrixXd J;
    at.jacobian->ToDense(&J);
    ASSERT_EQ(J.rows(), 2 * kNumSamples);
    for (int row = 0; row < J.rows(); ++row) {
      const auto output = [&](const VectorXd& theta) {
        return NetworkOutputs(model, theta, data).reshaped()[row];
      };
      EXPECT_LT((J.row(row).transpose() - Differences(output, weights)).norm(),
                1e-8);
    }
    EXPECT_LT((J.transpose() * at.loss_gradient - at.gradient).norm(), 1e-14);
    const MatrixXd d = x - wanted;
    const VectorXd g =
        scale * (is_l2 ? d : MatrixXd(d.array().sign())).reshaped();
    EXPECT_LT((at.loss_gradient - g).norm(), 1e-14);
    const VectorXd v = RandomMatrix(2 * kNumSamples, 1, 15);
    const VectorXd Hv = at.loss_hessian_times(v);
    EXPECT_EQ(Hv, (is_l2 ? scale : 0.0) * v);

    // The exact Hessian: differences of the gradients of later linearizations
    // towards the same x~.
    options.updates_per_evaluation = 2;
    ChainPullBack again(&model, BendInverse(), options);
    Linearized(&again, weights, data);
    const double h = 1e-5;
    for (int i = 0; i < weights.size(); ++i) {
      const VectorXd e = h * VectorXd::Unit(weights.size(), i);
      Linearization above;
      Linearization below;
      std::string error;
      ASSERT_TRUE(
          again.LinearizeAgain(weights + e, data, AllParts(), &above, &error));
      ASSERT_TRUE(
          again.LinearizeAgain(weights - e, data, AllParts(), &below, &error));
      const VectorXd column = (above.gradient - below.gradient) / (2.0 * h);
      EXPECT_LT((at.hessian.col(i) - column).norm(), 1e-8);
    }
  }
}

TEST_P(ProxyTest, LaterUpdatesMoveTowardsTheSameInput) {
  const bool is_l2 = GetParam() == ChainPullBack::Proxy::kL2;
  const DataSet data = RandomData();
  const Model model = MakeModel(QuarticLoss());
  const VectorXd weights = RandomWeights(model);
  Options options = Physical();
  options.proxy = GetParam();
  options.updates_per_evaluation = 3;
  options.curvature_weight = 0.5;
  ChainPullBack chain(&model, BendInverse(), options);
  EXPECT_EQ(chain.updates_per_step(), 3);
  const Linearization first = Linearized(&chain, weights, data);
  double loss = 0.0;
  std::string error;
  ASSERT_TRUE(model.Cost(weights, data, &loss, &error));
  EXPECT_NEAR(first.cost, loss, 1e-14);

  // At the same weights all is as before, but for the cost.
  Linearization again;
  ASSERT_TRUE(chain.LinearizeAgain(weights, data, AllParts(), &again, &error));
  EXPECT_LT((again.gradient - first.gradient).norm(), 1e-14);
  EXPECT_LT((again.hessian - first.hessian).norm(), 1e-13);
  EXPECT_GT(std::abs(again.cost - loss), 1e-3);

  // Elsewhere it is the value, and the gradient, of the same proxy.
  const VectorXd elsewhere = weights + 0.1 * RandomMatrix(weights.size(), 1, 3);
  const auto proxy = [&](const VectorXd& theta) {
    Linearization at;
    EXPECT_TRUE(
        chain.LinearizeAgain(theta, data, LinearizationParts(), &at, &error));
    return at.cost;
  };
  ASSERT_TRUE(
      chain.LinearizeAgain(elsewhere, data, AllParts(), &again, &error));
  EXPECT_LT((again.gradient - Differences(proxy, elsewhere)).norm(), 1e-8);
  EXPECT_GT((again.gradient - first.gradient).norm(), 1e-3);
  // The network alone was evaluated.
  EXPECT_EQ(chain.counts().of(PullBackSource::kInverse), kNumSamples);
  if (is_l2) {
    EXPECT_GT(again.loss_hessian_times(VectorXd::Ones(10)).minCoeff(), 0.0);
  }
}

INSTANTIATE_TEST_SUITE_P(Proxies,
                         ProxyTest,
                         testing::Values(ChainPullBack::Proxy::kL2,
                                         ChainPullBack::Proxy::kL1));

// --- Other terms of d_x ---

TEST(ChainPullBackTest, ChangesAreCutToTheirMaximum) {
  const DataSet data = RandomData();
  const Model model = MakeModel(QuarticLoss());
  const VectorXd weights = RandomWeights(model);
  Options options = Physical();
  ChainPullBack whole(&model, BendInverse(), options);
  const MatrixXd d_x = WeightedChange(model, Linearized(&whole, weights, data));
  const VectorXd lengths = d_x.colwise().norm();
  options.max_change = 0.5 * (lengths.minCoeff() + lengths.maxCoeff());
  ChainPullBack cut(&model, BendInverse(), options);
  const MatrixXd shortened =
      WeightedChange(model, Linearized(&cut, weights, data));
  for (int s = 0; s < kNumSamples; ++s) {
    const double factor = std::min(1.0, options.max_change / lengths[s]);
    EXPECT_LT((shortened.col(s) - factor * d_x.col(s)).norm(), 1e-14);
  }
}

// The gradient of L + w / 2 |x - x*|^2.
TEST(ChainPullBackTest, DataWeightAddsTheDistanceToTheSolutions) {
  const DataSet data = RandomData();
  for (const Reduction reduction : {Reduction::kMean, Reduction::kSum}) {
    const Model model = MakeModel(QuarticLoss(), reduction);
    const VectorXd weights = RandomWeights(model);
    Options options = Ways(LossWay::kGradient, SimulatorWay::kAdjoint);
    options.data_weight = 0.7;
    ChainPullBack chain(&model, nullptr, options);
    const Linearization at = Linearized(&chain, weights, data);
    const auto loss = [&](const VectorXd& theta) {
      double cost = 0.0;
      std::string error;
      EXPECT_TRUE(model.Cost(theta, data, &cost, &error));
      const MatrixXd d = NetworkOutputs(model, theta, data) - data.solutions;
      return cost + model.BatchScale(kNumSamples) * 0.5 * 0.7 * d.squaredNorm();
    };
    EXPECT_LT((at.gradient - Differences(loss, weights)).norm(), 1e-7);
  }
}

TEST(ChainPullBackTest, SupervisedTrainingSeesTheSolutionsOnly) {
  DataSet data = RandomData();
  const Model model = MakeModel(QuarticLoss());
  const VectorXd weights = RandomWeights(model);
  Options options = Physical();
  options.simulator.way = SimulatorWay::kData;
  ChainPullBack chain(&model, BendInverse(), options);
  const Linearization at = Linearized(&chain, weights, data);
  const MatrixXd d_x = data.solutions - NetworkOutputs(model, weights, data);
  EXPECT_LT((WeightedChange(model, at) - d_x).norm(), 1e-14);
  double cost = 0.0;
  std::string error;
  ASSERT_TRUE(model.Cost(weights, data, &cost, &error));
  EXPECT_NEAR(at.cost, cost, 1e-14);  // L, for the record
  EXPECT_EQ(chain.counts().Report(), "");
  // Nor do targets matter to the step.
  data.targets.setZero();
  EXPECT_EQ(Linearized(&chain, weights, data).gradient, at.gradient);
}

// --- Threads, failures and counts ---

// An inverse that refuses where y0 <= 0 and is wrong where y0 > 2.
std::shared_ptr<const InverseSimulator> UnreliableInverse() {
  return Inverse([](const auto& y, const auto& x_now) {
    std::optional<VectorXd> x = InvertBend(y, x_now);
    if (x.has_value() && y[0] > 2.0) *x = x_now;
    return x;
  });
}

TEST(ChainPullBackTest, ThreadsDoNotChangeABit) {
  constexpr int kMany = 40;
  DataSet data = RandomData(kMany);
  data.targets.row(0).array() -= 1.0;  // some are out of range
  const Model model = MakeModel(QuarticLoss());
  const VectorXd weights = 1.5 * RandomWeights(model);
  Options options = Physical();
  options.curvature_weight = 0.5;
  ChainPullBack alone(&model, UnreliableInverse(), options);
  const Linearization expected = Linearized(&alone, weights, data);
  const PullBackCounts& counts = alone.counts();
  EXPECT_GT(counts.of(PullBackSource::kInverse), 0);
  EXPECT_GT(counts.of(PullBackSource::kNumericalInverse), 0);
  EXPECT_LT(counts.of(PullBackSource::kInverse), kMany);
  EXPECT_NE(counts.Report().find("(first at step 1, sample "),
            std::string::npos)
      << counts.Report();
  for (const int num_threads : {2, 3, 64}) {
    const Model threaded = model.WithThreads(num_threads);
    ChainPullBack shared(&threaded, UnreliableInverse(), options);
    for (int repeat = 0; repeat < 3; ++repeat) {
      const Linearization at = Linearized(&shared, weights, data);
      EXPECT_EQ(at.cost, expected.cost);
      EXPECT_EQ(at.gradient, expected.gradient);
      EXPECT_EQ(at.hessian, expected.hessian);
      if (repeat == 0) {
        EXPECT_EQ(shared.counts().State(), counts.State());
        EXPECT_EQ(shared.counts().Report(), counts.Report());
      }
    }
  }
}

TEST(ChainPullBackTest, ErrorsNameTheSample) {
  const Model model = MakeModel(QuarticLoss());
  const VectorXd weights = RandomWeights(model);
  const auto expect_error = [&](const VectorXd& theta,
                                const DataSet& data,
                                const std::string& expected) {
    for (const SimulatorWay way :
         {SimulatorWay::kAdjoint, SimulatorWay::kInverse}) {
      for (const int num_threads : {1, 3}) {
        const Model threaded = model.WithThreads(num_threads);
        ChainPullBack chain(
            &threaded, BendInverse(), Ways(LossWay::kNewton, way));
        Linearization at;
        std::string error;
        EXPECT_FALSE(chain.Linearize(theta, data, AllParts(), &at, &error));
        EXPECT_EQ(error, expected);
      }
    }
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  DataSet data = RandomData();
  data.inputs(1, 3) = nan;
  expect_error(weights, data, "sample 3: the network's output is not finite");
  data = RandomData();
  data.targets(1, 3) = 1e200;
  expect_error(weights, data, "sample 3: the loss has no finite value");
  VectorXd outside = weights;
  // The bias of x0, the first unit of the last layer.
  outside[model.dense_network()->offset(1) + 4] = 100.0;
  expect_error(
      outside, RandomData(), "sample 0: the simulator has no finite value");
  // Three finite losses whose sum is not.
  data = RandomData(3);
  data.targets.row(1).setConstant(6e153);
  const Model sum = MakeModel(QuarticLoss(), Reduction::kSum);
  ChainPullBack chain(
      &sum, nullptr, Ways(LossWay::kGradient, SimulatorWay::kAdjoint));
  Linearization at;
  std::string error;
  EXPECT_FALSE(chain.Linearize(weights, data, AllParts(), &at, &error));
  EXPECT_EQ(error, "the cost of the batch is not finite");
}

TEST(ChainPullBackTest, ASampleThatCannotBePulledBackDoesNotMove) {
  // Where A is zero, nothing helps.
  const auto zero = std::make_shared<LinearSimulator>(
      LinearSimulator::Matrix(2, 2), Vector2d::Zero());
  const Model model = MakeModel(QuarticLoss(), Reduction::kMean, zero);
  const DataSet data = RandomData();
  for (const double gamma : {0.0, 1.0}) {
    Options options = Physical();
    options.curvature_weight = gamma;
    ChainPullBack chain(&model, nullptr, options);
    const VectorXd weights = RandomWeights(model);
    EXPECT_EQ(Linearized(&chain, weights, data).gradient,
              VectorXd::Zero(weights.size()));
    EXPECT_EQ(chain.counts().of(PullBackSource::kNone), kNumSamples);
    EXPECT_EQ(chain.counts().Report().rfind(
                  "5 not moved (first at step 1, sample 0: ", 0),
              0u)
        << chain.counts().Report();
  }
}

TEST(ChainPullBackDeathTest, LaterUpdatesNeedAFirst) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const Model model = MakeModel(QuarticLoss());
  ChainPullBack::Options options = Physical();
  options.updates_per_evaluation = 2;
  ChainPullBack chain(&model, BendInverse(), options);
  Linearization at;
  std::string error;
  EXPECT_DEATH(chain.LinearizeAgain(
                   RandomWeights(model), RandomData(), AllParts(), &at, &error),
               "LinearizeAgain follows Linearize");
}

}  // namespace chain_pull_back_test
}  // namespace invgrad
