#include "invgrad/chain/network_jacobian.h"

#include <cmath>
#include <string>
#include <tuple>
#include <vector>

#include "Eigen/Core"
#include "ceres/jet.h"
#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/dense_network.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace network_jacobian_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Widths, batch size, outputs per sample and calls per sample: tiles of one
// sample and of many, with and without a remainder.
class NetworkJacobianTest : public testing::TestWithParam<
                                std::tuple<std::vector<int>, int, int, int>> {
 protected:
  NetworkJacobianTest()
      : network_(std::get<0>(GetParam()), Activation::kTanh),
        weights_(RandomMatrix(network_.num_weights(), 1, 1)),
        jacobian_(Make()) {
    jacobian_.ToDense(&dense_);
  }

  NetworkJacobian Make() const {
    const auto& [widths, batch_size, num_outputs, num_calls] = GetParam();
    DenseNetwork::Activations activations;
    network_.Forward(weights_,
                     RandomMatrix(widths.front(), batch_size * num_calls, 2),
                     false,
                     &activations);
    return NetworkJacobian(
        network_,
        weights_,
        std::move(activations),
        RandomMatrix(widths.back() * num_calls, batch_size * num_outputs, 3));
  }

  const DenseNetwork network_;
  const VectorXd weights_;
  const NetworkJacobian jacobian_;
  MatrixXd dense_;
};

TEST_P(NetworkJacobianTest, GramIsTheDenseOne) {
  MatrixXd gram;
  jacobian_.Gram(&gram);
  gram = MatrixXd(gram.selfadjointView<Eigen::Lower>());
  const MatrixXd expected = dense_ * dense_.transpose();
  ASSERT_EQ(gram.rows(), dense_.rows());
  ASSERT_EQ(gram.cols(), dense_.rows());
  EXPECT_LT((gram - expected).norm(), 1e-14 * expected.norm());
}

TEST_P(NetworkJacobianTest, ParameterGramIsTheDenseOne) {
  MatrixXd gram;
  jacobian_.ParameterGram(&gram);
  gram = MatrixXd(gram.selfadjointView<Eigen::Lower>());
  const MatrixXd expected = dense_.transpose() * dense_;
  EXPECT_LT((gram - expected).norm(), 1e-14 * expected.norm());
}

TEST_P(NetworkJacobianTest, ProductsAreTheDenseOnes) {
  const VectorXd v = RandomMatrix(jacobian_.cols(), 1, 4);
  const VectorXd w = RandomMatrix(jacobian_.rows(), 1, 5);
  VectorXd Jv;
  VectorXd Jtw;
  jacobian_.Times(v, &Jv);
  jacobian_.TransposeTimes(w, &Jtw);
  EXPECT_LT((Jv - dense_ * v).norm(), 1e-14 * dense_.norm() * v.norm());
  EXPECT_LT((Jtw - dense_.transpose() * w).norm(),
            1e-14 * dense_.norm() * w.norm());
  // w . J v = J^T w . v
  EXPECT_NEAR(
      w.dot(Jv), Jtw.dot(v), 1e-14 * dense_.norm() * v.norm() * w.norm());
}

// A row of the sum over calls is the sum of the rows of the calls as samples.
TEST_P(NetworkJacobianTest, RowsAreTheSumsOverTheCalls) {
  const auto& [widths, batch_size, num_outputs, num_calls] = GetParam();
  const int num_x = widths.back();
  const MatrixXd inputs =
      RandomMatrix(widths.front(), batch_size * num_calls, 2);
  const MatrixXd simulator_jacobians =
      RandomMatrix(num_x * num_calls, batch_size * num_outputs, 3);
  MatrixXd expected = MatrixXd::Zero(dense_.rows(), dense_.cols());
  for (int t = 0; t < num_calls; ++t) {
    MatrixXd inputs_of_call(widths.front(), batch_size);
    for (int s = 0; s < batch_size; ++s) {
      inputs_of_call.col(s) = inputs.col(s * num_calls + t);
    }
    DenseNetwork::Activations activations;
    network_.Forward(weights_, inputs_of_call, false, &activations);
    MatrixXd J;
    NetworkJacobian(network_,
                    weights_,
                    std::move(activations),
                    simulator_jacobians.middleRows(t * num_x, num_x))
        .ToDense(&J);
    expected += J;
  }
  EXPECT_LT((dense_ - expected).norm(), 1e-14 * expected.norm());
  EXPECT_EQ(jacobian_.RowName(jacobian_.rows() - 1),
            "row " + std::to_string(jacobian_.rows() - 1) + " (sample " +
                std::to_string(batch_size - 1) + ", output " +
                std::to_string(num_outputs - 1) + ")");
}

TEST_P(NetworkJacobianTest, ColumnBlocksAreTheLayers) {
  const std::vector<int>& widths = std::get<0>(GetParam());
  const auto blocks = jacobian_.ColumnBlocks();
  ASSERT_EQ(blocks.size(), widths.size() - 1);
  int column = 0;
  for (size_t l = 0; l < blocks.size(); ++l) {
    MatrixXd block;
    blocks[l]->ToDense(&block);
    ASSERT_EQ(block.cols(), (widths[l] + 1) * widths[l + 1]);
    EXPECT_EQ(block, dense_.middleCols(column, block.cols()));
    column += blocks[l]->cols();
  }
  EXPECT_EQ(column, jacobian_.cols());
}

INSTANTIATE_TEST_SUITE_P(
    Sizes,
    NetworkJacobianTest,
    testing::Values(
        std::make_tuple(std::vector<int>{3, 2}, 1, 1, 1),
        std::make_tuple(std::vector<int>{2, 5, 3}, 4, 3, 1),
        std::make_tuple(std::vector<int>{4, 20, 20, 20, 24}, 35, 4, 1),
        std::make_tuple(std::vector<int>{3, 6, 4, 5}, 11, 7, 1),
        std::make_tuple(std::vector<int>{2, 8, 9}, 3, 70, 1),
        std::make_tuple(std::vector<int>{3, 2}, 1, 1, 2),
        std::make_tuple(std::vector<int>{3, 6, 4, 2}, 5, 3, 4)));

// P(x) = (x0 x1, sin x2, exp x0).
struct Curved {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::exp;
    using std::sin;
    y[0] = x[0] * x[1];
    y[1] = sin(x[2]);
    y[2] = exp(x[0]);
    return true;
  }
};

// Network and simulator on Jets, one weight at a time, and by central
// differences.
TEST(NetworkJacobian, IsTheDerivativeOfTheChain) {
  const DenseNetwork network({2, 4, 3}, Activation::kSigmoid);
  const AutoDiffSimulator<Curved, 3, 3> simulator;
  const int batch_size = 3;
  const VectorXd weights = RandomMatrix(network.num_weights(), 1, 1);
  const MatrixXd inputs = RandomMatrix(2, batch_size, 2);
  DenseNetwork::Activations activations;
  network.Forward(weights, inputs, false, &activations);
  MatrixXd simulator_jacobians(3, 3 * batch_size);
  Eigen::Vector3d y;
  for (Eigen::Index s = 0; s < batch_size; ++s) {
    ASSERT_TRUE(simulator.Evaluate(activations.outputs.col(s).data(),
                                   nullptr,
                                   y.data(),
                                   simulator_jacobians.col(3 * s).data()));
  }
  const NetworkJacobian jacobian(
      network, weights, activations, simulator_jacobians);
  MatrixXd J;
  jacobian.ToDense(&J);

  using Jet = ceres::Jet<double, 1>;
  const NetworkFunctor functor(network);
  for (int k = 0; k < network.num_weights(); ++k) {
    for (int s = 0; s < batch_size; ++s) {
      std::vector<Jet> theta;
      for (const double weight : weights) theta.emplace_back(weight);
      theta[k].v[0] = 1.0;
      const Jet a[] = {Jet(inputs(0, s)), Jet(inputs(1, s))};
      Jet x[3];
      Jet y_jets[3];
      functor(theta.data(), a, x);
      Curved()(x, y_jets);

      const double h = 1e-5;
      Eigen::Vector3d shifted[2];
      for (const int side : {0, 1}) {
        VectorXd moved = weights;
        moved[k] += side == 0 ? -h : h;
        Eigen::Vector3d x_moved;
        const Eigen::Vector2d a_moved = inputs.col(s);
        functor(moved.data(), a_moved.data(), x_moved.data());
        Curved()(x_moved.data(), shifted[side].data());
      }
      for (int j = 0; j < 3; ++j) {
        EXPECT_NEAR(J(3 * s + j, k), y_jets[j].v[0], 1e-14);
        // h^2 / 6 times a third derivative of order one, and eps / h.
        EXPECT_NEAR(
            J(3 * s + j, k), (shifted[1][j] - shifted[0][j]) / (2.0 * h), 1e-9);
      }
    }
  }
}

}  // namespace network_jacobian_test
}  // namespace invgrad
