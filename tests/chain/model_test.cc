#include "invgrad/model.h"

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/autodiff_loss.h"
#include "invgrad/dense_network.h"
#include "invgrad/internal/nested_jet.h"
#include "invgrad/linear_simulator.h"
#include "invgrad/loss.h"
#include "invgrad/time_stepping_simulator.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace model_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// A pendulum under a torque, semi-implicit Euler; refuses torques beyond 50.
struct PendulumStep {
  template <typename T>
  bool operator()(const T* s, const T* u, T* next) const {
    using std::sin;
    next[1] = s[1] + 0.3 * (u[0] * (1.0 + s[0] * s[0]) - sin(s[0]));
    next[0] = s[0] + 0.3 * next[1];
    return u[0] < T(50.0) && u[0] > T(-50.0);
  }
};

// L = log(1 + |y - y*|^2) + y0 y1.
struct RobustLoss {
  template <typename T>
  bool operator()(const T* y, const double* target, T* loss) const {
    using std::log;
    const T d0 = y[0] - target[0];
    const T d1 = y[1] - target[1];
    *loss = log(1.0 + d0 * d0 + d1 * d1) + y[0] * y[1];
    return true;
  }
};

constexpr int kNumSteps = 3;

Model PendulumModel(std::shared_ptr<const Loss> loss, Reduction reduction) {
  return Model(DenseNetwork({2, 3, kNumSteps}, Activation::kTanh),
               std::make_shared<TimeSteppingSimulator<PendulumStep>>(
                   PendulumStep(), 2, 1, kNumSteps),
               std::move(loss),
               reduction);
}

DataSet RandomData(int num_samples) {
  return {RandomMatrix(2, num_samples, 11),
          RandomMatrix(2, num_samples, 12),
          RandomMatrix(2, num_samples, 13),
          Eigen::MatrixXd()};
}

// The whole chain on one scalar type: the oracle. `general` chooses RobustLoss
// over factor |y - y*|^2.
template <typename T>
T ChainLoss(const DenseNetwork& network,
            const std::vector<T>& weights,
            const DataSet& batch,
            bool general,
            double factor) {
  T sum(0.0);
  for (int s = 0; s < batch.num_samples(); ++s) {
    const T a[] = {T(batch.inputs(0, s)), T(batch.inputs(1, s))};
    T x[kNumSteps];
    NetworkFunctor network_functor(network);
    network_functor(weights.data(), a, x);
    T state[] = {T(batch.contexts(0, s)), T(batch.contexts(1, s))};
    T next[2];
    for (int t = 0; t < kNumSteps; ++t) {
      PendulumStep()(state, x + t, next);
      state[0] = next[0];
      state[1] = next[1];
    }
    const double* target = batch.targets.col(s).data();
    if (general) {
      T loss;
      RobustLoss()(state, target, &loss);
      sum += loss;
    } else {
      for (int j = 0; j < 2; ++j) {
        sum += factor * (state[j] - target[j]) * (state[j] - target[j]);
      }
    }
  }
  return sum;
}

struct Case {
  bool general;
  Reduction reduction;
};

class ModelTest : public testing::TestWithParam<Case> {
 protected:
  static constexpr double kFactor = 1.5;

  ModelTest()
      : model_(PendulumModel(MakeLoss(), GetParam().reduction)),
        data_(RandomData(4)),
        weights_(RandomMatrix(model_.num_weights(), 1, 14)) {}

  static std::shared_ptr<const Loss> MakeLoss() {
    if (GetParam().general) {
      return std::make_shared<AutoDiffLoss<RobustLoss, 2>>();
    }
    return std::make_shared<SquaredNormLoss>(2, kFactor);
  }

  // Value, first and second derivatives of the batch's loss in the weights.
  void Oracle(double* cost, VectorXd* gradient, MatrixXd* hessian) const {
    using Jet = NestedJet<1>;
    const int n = model_.num_weights();
    const double scale = GetParam().reduction == Reduction::kMean ? 0.25 : 1.0;
    gradient->resize(n);
    hessian->resize(n, n);
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        std::vector<Jet> weights;
        for (const double w : weights_) weights.emplace_back(InnerJet<1>(w));
        weights[i].v[0] = InnerJet<1>(1.0);
        weights[j].a.v[0] = 1.0;
        const Jet loss = ChainLoss(*model_.dense_network(),
                                   weights,
                                   data_,
                                   GetParam().general,
                                   kFactor);
        *cost = scale * loss.a.a;
        (*gradient)[i] = scale * loss.v[0].a;
        (*hessian)(i, j) = scale * loss.v[0].v[0];
      }
    }
  }

  const Model model_;
  const DataSet data_;
  const VectorXd weights_;
};

// Sums of about a hundred terms of order one to ten.
constexpr double kRounding = 1e-12;

TEST_P(ModelTest, CostGradientAndHessianAreThoseOfTheFunctors) {
  double cost;
  VectorXd gradient;
  MatrixXd hessian;
  Oracle(&cost, &gradient, &hessian);

  std::string error;
  double value;
  ASSERT_TRUE(model_.Cost(weights_, data_, &value, &error)) << error;
  EXPECT_NEAR(value, cost, kRounding);
  for (int mask = 0; mask < 16; ++mask) {
    LinearizationParts parts;
    parts.gradient = (mask & 1) != 0;
    parts.jacobian = (mask & 2) != 0;
    parts.hessian = (mask & 4) != 0;
    parts.loss_gradient = (mask & 8) != 0;
    Linearization at;
    ASSERT_TRUE(model_.Linearize(weights_, data_, parts, &at, &error)) << error;
    EXPECT_NEAR(at.cost, cost, kRounding);
    ASSERT_EQ(at.gradient.size() > 0, parts.gradient);
    ASSERT_EQ(at.jacobian != nullptr, parts.jacobian);
    ASSERT_EQ(at.loss_gradient.size() > 0,
              parts.jacobian || parts.loss_gradient);
    ASSERT_EQ(at.hessian.size() > 0, parts.hessian);
    if (parts.gradient) {
      EXPECT_LT((at.gradient - gradient).norm(), kRounding);
    }
    if (parts.hessian) {
      EXPECT_LT((at.hessian - hessian).norm(), 10 * kRounding);
    }
    if (parts.jacobian) {
      VectorXd Jtg;
      at.jacobian->TransposeTimes(at.loss_gradient, &Jtg);
      EXPECT_LT((Jtg - gradient).norm(), kRounding);
    }
  }
}

// g and H_L: the derivatives in y of L(y) at y = Predict().
TEST_P(ModelTest, LossDerivativesAreThoseOfTheLossInY) {
  LinearizationParts parts;
  parts.jacobian = true;
  Linearization at;
  MatrixXd y;
  std::string error;
  ASSERT_TRUE(model_.Linearize(weights_, data_, parts, &at, &error)) << error;
  ASSERT_TRUE(model_.Predict(weights_, data_, &y, &error)) << error;
  const double scale = model_.BatchScale(4);
  EXPECT_EQ(scale, GetParam().reduction == Reduction::kMean ? 0.25 : 1.0);
  const VectorXd v = RandomMatrix(8, 1, 15);
  const VectorXd Hv = at.loss_hessian_times(v);
  ASSERT_EQ(Hv.size(), 8);
  for (Eigen::Index s = 0; s < 4; ++s) {
    double loss;
    Eigen::Vector2d g;
    Eigen::Matrix2d H;
    ASSERT_TRUE(model_.loss().Evaluate(y.col(s).data(),
                                       data_.targets.col(s).data(),
                                       &loss,
                                       g.data(),
                                       H.data()));
    EXPECT_LT((at.loss_gradient.segment<2>(2 * s) - scale * g).norm(), 1e-14);
    EXPECT_LT((Hv.segment<2>(2 * s) - scale * H * v.segment<2>(2 * s)).norm(),
              1e-14);
  }
}

INSTANTIATE_TEST_SUITE_P(Losses,
                         ModelTest,
                         testing::Values(Case{false, Reduction::kMean},
                                         Case{false, Reduction::kSum},
                                         Case{true, Reduction::kMean},
                                         Case{true, Reduction::kSum}));

TEST(Model, UnwantedPartsOfAnEarlierLinearizationAreEmptied) {
  const Model model =
      PendulumModel(std::make_shared<SquaredNormLoss>(2, 0.5), Reduction::kSum);
  const VectorXd weights = RandomMatrix(model.num_weights(), 1, 1);
  const DataSet data = RandomData(3);
  LinearizationParts all;
  all.gradient = all.jacobian = all.hessian = true;
  Linearization at;
  std::string error;
  ASSERT_TRUE(model.Linearize(weights, data, all, &at, &error));
  ASSERT_TRUE(
      model.Linearize(weights, data, LinearizationParts(), &at, &error));
  EXPECT_EQ(at.gradient.size(), 0);
  EXPECT_EQ(at.loss_gradient.size(), 0);
  EXPECT_EQ(at.jacobian, nullptr);
  EXPECT_EQ(at.loss_hessian_times, nullptr);
  EXPECT_EQ(at.loss_on_curve, nullptr);
  EXPECT_EQ(at.hessian.size(), 0);
}

// A zero residual: no cost, no gradient, and the Gauss-Newton Hessian.
TEST(Model, ZeroResidualIsAStationaryPoint) {
  const Model model =
      PendulumModel(std::make_shared<SquaredNormLoss>(2, 0.5), Reduction::kSum);
  const VectorXd weights = RandomMatrix(model.num_weights(), 1, 1);
  DataSet data = RandomData(3);
  std::string error;
  ASSERT_TRUE(model.Predict(weights, data, &data.targets, &error));
  LinearizationParts all;
  all.gradient = all.jacobian = all.hessian = true;
  Linearization at;
  ASSERT_TRUE(model.Linearize(weights, data, all, &at, &error));
  // The roll-outs with and without Jets may differ in the last bit.
  EXPECT_NEAR(at.cost, 0.0, 1e-30);
  EXPECT_LT(at.gradient.norm(), 1e-14);
  MatrixXd J;
  at.jacobian->ToDense(&J);
  EXPECT_LT((at.hessian - J.transpose() * J).norm(), 1e-13);
}

// Sample 2 of 4 is spoiled in one way after the other.
TEST(Model, ErrorsNameTheSample) {
  const Model model = PendulumModel(std::make_shared<SquaredNormLoss>(2, 0.5),
                                    Reduction::kMean);
  const VectorXd weights = RandomMatrix(model.num_weights(), 1, 1);
  const double nan = std::numeric_limits<double>::quiet_NaN();

  const auto expect_error = [&](const VectorXd& theta,
                                const DataSet& data,
                                const std::string& expected) {
    for (int mask = 0; mask < 8; ++mask) {
      LinearizationParts parts;
      parts.gradient = (mask & 1) != 0;
      parts.jacobian = (mask & 2) != 0;
      parts.hessian = (mask & 4) != 0;
      Linearization at;
      std::string error;
      EXPECT_FALSE(model.Linearize(theta, data, parts, &at, &error));
      EXPECT_EQ(error, expected);
    }
    std::string error;
    double cost;
    EXPECT_FALSE(model.Cost(theta, data, &cost, &error));
    EXPECT_EQ(error, expected);
  };

  DataSet data = RandomData(4);
  data.inputs(1, 2) = nan;
  expect_error(weights, data, "sample 2: the network's output is not finite");
  data = RandomData(4);
  data.contexts(0, 2) = nan;
  expect_error(weights,
               data,
               "sample 2: the simulator has no finite value: the state is not "
               "finite after time step 1 of 3");
  data = RandomData(4);
  data.targets(1, 2) = 1e200;
  expect_error(weights, data, "sample 2: the loss has no finite value");
  VectorXd huge = weights;
  huge[huge.size() - 1] = 100.0;  // the last torque's bias: the step refuses it
  expect_error(huge,
               RandomData(4),
               "sample 0: the simulator has no finite value: the step has no "
               "value at time step 3 of 3");
  // Three finite losses whose sum is not.
  const Model sum =
      PendulumModel(std::make_shared<SquaredNormLoss>(2, 0.5), Reduction::kSum);
  data = RandomData(3);
  data.targets.row(0).setConstant(1.2e154);
  double cost;
  std::string error;
  EXPECT_FALSE(sum.Cost(weights, data, &cost, &error));
  EXPECT_EQ(error, "the cost of the batch is not finite");
}

// Linear network, linear simulator: L = sum |A (W a + b) - y*|^2, by hand.
TEST(Model, LinearChainIsLinearRegression) {
  Eigen::Matrix<double, 2, 2, Eigen::RowMajor> A;
  A << 2.0, 0.0, 1.0, -1.0;
  const Model model(
      DenseNetwork({1, 2}, Activation::kLinear),
      std::make_shared<LinearSimulator>(LinearSimulator::Matrix(A.sparseView()),
                                        VectorXd::Zero(2)),
      std::make_shared<SquaredNormLoss>(2, 1.0),
      Reduction::kSum);
  Eigen::Vector4d weights(1.0, 2.0, 3.0, 4.0);  // x = (a + 2, 3 a + 4)
  DataSet data;
  data.inputs = Eigen::RowVector2d(1.0, -1.0);  // x = (3, 7), (1, 1)
  data.contexts.resize(0, 2);
  data.targets = MatrixXd::Zero(2, 2);  // y = (6, -4), (2, 0)
  LinearizationParts parts;
  parts.gradient = parts.jacobian = true;
  Linearization at;
  std::string error;
  ASSERT_TRUE(model.Linearize(weights, data, parts, &at, &error));
  EXPECT_EQ(at.cost, 56.0);
  EXPECT_EQ(at.loss_gradient, Eigen::Vector4d(12.0, -8.0, 4.0, 0.0));
  // x_bar = A^T g = (16, 8), (8, 0).
  EXPECT_EQ(at.gradient, Eigen::Vector4d(8.0, 24.0, 8.0, 8.0));
  MatrixXd J;
  at.jacobian->ToDense(&J);
  MatrixXd expected(4, 4);
  expected << 2, 2, 0, 0, 1, 1, -1, -1, -2, 2, 0, 0, -1, 1, 1, -1;
  EXPECT_EQ(J, expected);
}

TEST(Model, ThreadsMayShareIt) {
  const Model model = PendulumModel(
      std::make_shared<AutoDiffLoss<RobustLoss, 2>>(), Reduction::kMean);
  const VectorXd weights = RandomMatrix(model.num_weights(), 1, 1);
  const DataSet data = RandomData(5);
  LinearizationParts all;
  all.gradient = all.jacobian = all.hessian = true;
  Linearization results[3];
  std::vector<std::thread> threads;
  for (Linearization& at : results) {
    threads.emplace_back([&] {
      for (int repeat = 0; repeat < 20; ++repeat) {
        std::string error;
        EXPECT_TRUE(model.Linearize(weights, data, all, &at, &error));
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const Linearization& at : results) {
    EXPECT_EQ(at.cost, results[0].cost);
    EXPECT_EQ(at.gradient, results[0].gradient);
    EXPECT_EQ(at.hessian, results[0].hessian);
  }
}

TEST(ModelDeathTest, RefusesPartsThatDoNotFit) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const auto simulator = std::make_shared<IdentitySimulator>(2);
  const auto loss = std::make_shared<SquaredNormLoss>(2, 1.0);
  EXPECT_DEATH(Model(DenseNetwork({1, 3}, Activation::kTanh),
                     simulator,
                     loss,
                     Reduction::kSum),
               "network's outputs are the simulator's inputs");
  EXPECT_DEATH(Model(DenseNetwork({1, 2}, Activation::kTanh),
                     simulator,
                     std::make_shared<SquaredNormLoss>(3, 1.0),
                     Reduction::kSum),
               "simulator's outputs are the loss's argument");
}

TEST(ModelDeathTest, RefusesDataOfWrongSizes) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const Model model = PendulumModel(std::make_shared<SquaredNormLoss>(2, 0.5),
                                    Reduction::kMean);
  const VectorXd weights = VectorXd::Zero(model.num_weights());
  const auto cost = [&](MatrixXd DataSet::*part, Eigen::Index rows, int cols) {
    DataSet data = RandomData(4);
    (data.*part).setZero(rows, cols);
    double cost = 0.0;
    std::string error;
    model.Cost(weights, data, &cost, &error);
  };
  EXPECT_DEATH(cost(&DataSet::inputs, 1, 4), "input of the network");
  EXPECT_DEATH(cost(&DataSet::contexts, 0, 4), "the simulator's num_context");
  EXPECT_DEATH(cost(&DataSet::contexts, 2, 3), "column for each sample");
  EXPECT_DEATH(cost(&DataSet::targets, 1, 4), "the simulator's outputs");
  EXPECT_DEATH(cost(&DataSet::targets, 2, 3), "column for each sample");
}

}  // namespace model_test
}  // namespace invgrad
