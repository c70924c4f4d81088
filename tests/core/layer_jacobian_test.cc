#include "invgrad/core/layer_jacobian.h"

#include <tuple>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/internal/layered_jacobian.h"
#include "tests/support/one_rank.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace layer_jacobian_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// By the definition, entry by entry.
MatrixXd Dense(const MatrixXd& inputs, const MatrixXd& deltas, int num_calls) {
  const Eigen::Index r = deltas.cols() / inputs.cols();
  MatrixXd J =
      MatrixXd::Zero(deltas.cols() / num_calls, inputs.rows() * deltas.rows());
  for (Eigen::Index row = 0; row < J.rows(); ++row) {
    for (Eigen::Index col = 0; col < J.cols(); ++col) {
      for (int t = 0; t < num_calls; ++t) {
        J(row, col) += deltas(col / inputs.rows(), row * num_calls + t) *
                       inputs(col % inputs.rows(), row / r * num_calls + t);
      }
    }
  }
  return J;
}

// fan_in, fan_out, B, r, T: tiles of the Gram matrix with and without a
// remainder; one call a sample and several.
class LayerJacobianTest
    : public testing::TestWithParam<std::tuple<int, int, int, int, int>> {
 protected:
  LayerJacobianTest()
      : num_columns_(std::get<2>(GetParam()) * std::get<4>(GetParam())),
        inputs_(RandomMatrix(std::get<0>(GetParam()), num_columns_, 1)),
        deltas_(RandomMatrix(std::get<1>(GetParam()),
                             num_columns_ * std::get<3>(GetParam()),
                             2)),
        layer_(&inputs_, &deltas_, std::get<4>(GetParam())),
        dense_(Dense(inputs_, deltas_, std::get<4>(GetParam()))) {}

  const int num_columns_;
  const MatrixXd inputs_;
  const MatrixXd deltas_;
  const LayerJacobian layer_;
  const MatrixXd dense_;
};

TEST_P(LayerJacobianTest, IsItsDefinition) {
  MatrixXd J = MatrixXd::Constant(2, 3, 5.0);
  layer_.ToDense(&J);
  ASSERT_EQ(J.rows(), dense_.rows());
  ASSERT_EQ(J.cols(), dense_.cols());
  // A single product is exact; sums over calls may be in any order.
  EXPECT_LE((J - dense_).norm(),
            layer_.num_calls() == 1 ? 0.0 : 1e-15 * dense_.norm());
  EXPECT_EQ(layer_.outputs_per_sample(), std::get<3>(GetParam()));
  EXPECT_TRUE(ColumnBlocksOf(layer_).empty());
}

TEST_P(LayerJacobianTest, ProductsAreTheDenseOnes) {
  const VectorXd v = RandomMatrix(layer_.cols(), 1, 3);
  const VectorXd w = RandomMatrix(layer_.rows(), 1, 4);
  VectorXd Jv;
  VectorXd Jtw;
  layer_.Times(v, &Jv);
  layer_.TransposeTimes(w, &Jtw);
  // The terms of a row's sum over its calls may cancel.
  const double size = inputs_.norm() * deltas_.norm();
  EXPECT_LE((Jv - dense_ * v).norm(), 1e-15 * size * v.norm());
  EXPECT_LE((Jtw - dense_.transpose() * w).norm(), 1e-15 * size * w.norm());
}

TEST_P(LayerJacobianTest, GramMatricesAreTheDenseOnes) {
  MatrixXd gram = MatrixXd::Constant(2, 3, 5.0);
  layer_.Gram(&gram);
  gram = MatrixXd(gram.selfadjointView<Eigen::Lower>());
  const MatrixXd JJt = dense_ * dense_.transpose();
  EXPECT_LE((gram - JJt).norm(), 1e-15 * dense_.squaredNorm());
  layer_.ParameterGram(&gram);
  gram = MatrixXd(gram.selfadjointView<Eigen::Lower>());
  const MatrixXd JtJ = dense_.transpose() * dense_;
  EXPECT_LE((gram - JtJ).norm(), 1e-15 * dense_.squaredNorm());
}

INSTANTIATE_TEST_SUITE_P(Sizes,
                         LayerJacobianTest,
                         testing::Values(std::make_tuple(1, 1, 1, 1, 1),
                                         std::make_tuple(3, 2, 1, 4, 1),
                                         std::make_tuple(2, 5, 7, 1, 1),
                                         std::make_tuple(6, 4, 35, 4, 1),
                                         std::make_tuple(3, 8, 3, 70, 1),
                                         std::make_tuple(1, 1, 1, 1, 2),
                                         std::make_tuple(3, 4, 1, 2, 5),
                                         std::make_tuple(6, 4, 7, 3, 4)));

void ExpectGramIsTheSum(int num_calls) {
  const MatrixXd inputs[] = {RandomMatrix(3, 9, 1), RandomMatrix(5, 9, 2)};
  const MatrixXd deltas[] = {RandomMatrix(4, 18, 3), RandomMatrix(2, 18, 4)};
  const std::vector<LayerJacobian> layers = {
      {&inputs[0], &deltas[0], num_calls}, {&inputs[1], &deltas[1], num_calls}};
  MatrixXd gram;
  MatrixXd first;
  MatrixXd second;
  GramOfLayers(layers, ColumnStrips(layers[0].rows(), nullptr), &gram);
  gram = MatrixXd(gram.selfadjointView<Eigen::Lower>());
  layers[0].Gram(&first);
  layers[1].Gram(&second);
  first = MatrixXd(first.selfadjointView<Eigen::Lower>());
  second = MatrixXd(second.selfadjointView<Eigen::Lower>());
  EXPECT_LE((gram - first - second).norm(), 1e-15 * gram.norm());
}

TEST(GramOfLayers, IsTheSumOfTheirs) {
  ExpectGramIsTheSum(1);
  ExpectGramIsTheSum(3);
}

// Strips begin and end within a sample.
TEST(GramOfLayers, StripsAreColumnsOfTheWhole) {
  constexpr int kOutputs = 7, kSamples = 90, kRanks = 2;
  for (const int num_calls : {1, 2}) {
    const MatrixXd inputs = RandomMatrix(3, kSamples * num_calls, 1);
    const MatrixXd deltas = RandomMatrix(4, kSamples * kOutputs * num_calls, 2);
    const std::vector<LayerJacobian> layers = {{&inputs, &deltas, num_calls}};
    const int rows = layers[0].rows();
    MatrixXd whole;
    GramOfLayers(layers, ColumnStrips(rows, nullptr), &whole);
    for (int r = 0; r < kRanks; ++r) {
      const OneRank rank(r, kRanks);
      const ColumnStrips strips(rows, &rank);
      MatrixXd own;
      GramOfLayers(layers, strips, &own);
      ASSERT_EQ(own.cols(), strips.num_local());
      for (int column = 0; column < rows; ++column) {
        if (!strips.Owns(column)) continue;
        const int height = rows - column;
        EXPECT_LE((own.col(strips.Local(column)).tail(height) -
                   whole.col(column).tail(height))
                      .norm(),
                  1e-14 * whole.diagonal().maxCoeff())
            << column;
      }
    }
  }
}

TEST(LayerJacobianDeathTest, SizesThatDoNotFitAreChecked) {
  const MatrixXd inputs = RandomMatrix(3, 2, 1);
  const MatrixXd deltas = RandomMatrix(4, 6, 2);
  const MatrixXd uneven = RandomMatrix(4, 5, 3);
  const MatrixXd empty(3, 0);
  EXPECT_DEATH(LayerJacobian(&inputs, &uneven), "same number of outputs");
  EXPECT_DEATH(LayerJacobian(&empty, &deltas), "batch is empty");
  EXPECT_DEATH(LayerJacobian(&inputs, &deltas, 3), "same number of calls");
  const LayerJacobian layer(&inputs, &deltas);
  VectorXd result;
  EXPECT_DEATH(layer.Times(VectorXd::Ones(6), &result), "size");
  EXPECT_DEATH(layer.TransposeTimes(VectorXd::Ones(12), &result), "size");
}

}  // namespace layer_jacobian_test
}  // namespace invgrad
