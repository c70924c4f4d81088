#include "invgrad/chain/counted_simulator.h"

#include <memory>

#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/dense_network.h"
#include "invgrad/loss.h"

namespace invgrad {
namespace counted_simulator_test {

// y = (x_0 x_1, x_2^2)
struct Products {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    y[0] = x[0] * x[1];
    y[1] = x[2] * x[2];
    return true;
  }
};

class Counted : public testing::Test {
 protected:
  using Functor = AutoDiffSimulator<Products, 3, 2>;
  const std::shared_ptr<const Simulator> simulator_ =
      std::make_shared<Functor>();
  const CountedSimulator counted_{simulator_};
  const Eigen::MatrixXd x_ = Eigen::MatrixXd::Random(3, 5);
};

// One a value, and min(3, 2) products for its Jacobian.
TEST_F(Counted, ValuesAndJacobiansOfBatches) {
  Eigen::MatrixXd y(2, 5), same_y(2, 5), J(6, 5), same_J(6, 5);
  ASSERT_EQ(counted_.EvaluateBatch(5, x_.data(), nullptr, y.data(), nullptr),
            5);
  EXPECT_EQ(counted_.num_calls(), 5);
  ASSERT_EQ(counted_.EvaluateBatch(5, x_.data(), nullptr, y.data(), J.data()),
            5);
  EXPECT_EQ(counted_.num_calls(), 5 + 5 * (1 + 2));
  simulator_->EvaluateBatch(
      5, x_.data(), nullptr, same_y.data(), same_J.data());
  EXPECT_EQ(y, same_y);
  EXPECT_EQ(J, same_J);
}

TEST_F(Counted, AnAdjointIsTwo) {
  const auto covector = [](int /*sample*/, const double* y, double* w) {
    w[0] = y[0];
    w[1] = 1.0;
    return true;
  };
  Eigen::MatrixXd x_bar(3, 5), same(3, 5);
  ASSERT_EQ(
      counted_.AdjointBatch(5, x_.data(), nullptr, covector, x_bar.data()), 5);
  EXPECT_EQ(counted_.num_calls(), 10);
  simulator_->AdjointBatch(5, x_.data(), nullptr, covector, same.data());
  EXPECT_EQ(x_bar, same);
}

// The functor computes its Jacobian at once, which counts as the products.
TEST_F(Counted, LinearizeOfAFormedJacobian) {
  Eigen::Vector2d y;
  ASSERT_NE(counted_.Linearize(x_.data(), nullptr, y.data()), nullptr);
  EXPECT_EQ(counted_.num_calls(), 3);
}

TEST_F(Counted, IsWhatTheSimulatorIs) {
  EXPECT_TRUE(counted_.forms_jacobian());
  EXPECT_EQ(counted_.WhyNoLanes(), simulator_->WhyNoLanes());
  EXPECT_EQ(counted_.has_weighted_hessian(),
            simulator_->has_weighted_hessian());
  EXPECT_EQ(counted_.is_linear(), simulator_->is_linear());
}

TEST_F(Counted, AModelThroughItIsTheSameChain) {
  const Model model(DenseNetwork({2, 4, 3}, Activation::kTanh),
                    simulator_,
                    std::make_shared<SquaredNormLoss>(2, 0.5),
                    Reduction::kMean);
  const auto counted = std::make_shared<CountedSimulator>(simulator_);
  const Model same = WithSimulator(model.WithThreads(2), counted);
  EXPECT_EQ(same.num_threads(), 2);
  EXPECT_EQ(same.reduction(), Reduction::kMean);
  EXPECT_EQ(same.feedback(), nullptr);
  DataSet batch;
  batch.inputs = Eigen::MatrixXd::Random(2, 6);
  batch.contexts.resize(0, 6);
  batch.targets = Eigen::MatrixXd::Random(2, 6);
  const Eigen::VectorXd weights =
      Eigen::VectorXd::LinSpaced(model.num_weights(), -1.0, 1.0);
  LinearizationParts parts;
  parts.gradient = true;
  Linearization a, b;
  std::string error;
  ASSERT_TRUE(model.Linearize(weights, batch, parts, &a, &error)) << error;
  ASSERT_TRUE(same.Linearize(weights, batch, parts, &b, &error)) << error;
  EXPECT_EQ(a.gradient, b.gradient);
  EXPECT_EQ(a.cost, b.cost);
  EXPECT_EQ(counted->num_calls(), 2 * 6);
}

}  // namespace counted_simulator_test
}  // namespace invgrad
