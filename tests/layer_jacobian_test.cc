#include "invgrad/linalg/layer_jacobian.h"

#include <random>
#include <tuple>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd RandomMatrix(int rows, int cols, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  return MatrixXd::NullaryExpr(
      rows, cols, [&](Eigen::Index) { return uniform(generator); });
}

// By the definition, entry by entry.
MatrixXd Dense(const MatrixXd& inputs, const MatrixXd& deltas) {
  const Eigen::Index r = deltas.cols() / inputs.cols();
  MatrixXd J(deltas.cols(), inputs.rows() * deltas.rows());
  for (Eigen::Index row = 0; row < J.rows(); ++row) {
    for (Eigen::Index col = 0; col < J.cols(); ++col) {
      J(row, col) = deltas(col / inputs.rows(), row) *
                    inputs(col % inputs.rows(), row / r);
    }
  }
  return J;
}

// fan_in, fan_out, B, r: tiles of the Gram matrix with and without a remainder.
class LayerJacobianTest
    : public testing::TestWithParam<std::tuple<int, int, int, int>> {
 protected:
  LayerJacobianTest()
      : inputs_(
            RandomMatrix(std::get<0>(GetParam()), std::get<2>(GetParam()), 1)),
        deltas_(RandomMatrix(std::get<1>(GetParam()),
                             std::get<2>(GetParam()) * std::get<3>(GetParam()),
                             2)),
        layer_(&inputs_, &deltas_),
        dense_(Dense(inputs_, deltas_)) {}

  const MatrixXd inputs_;
  const MatrixXd deltas_;
  const LayerJacobian layer_;
  const MatrixXd dense_;
};

TEST_P(LayerJacobianTest, IsItsDefinition) {
  MatrixXd J = MatrixXd::Constant(2, 3, 5.0);
  layer_.ToDense(&J);
  EXPECT_EQ(J, dense_);
  EXPECT_EQ(layer_.outputs_per_sample(), std::get<3>(GetParam()));
  EXPECT_TRUE(layer_.ColumnBlocks().empty());
}

TEST_P(LayerJacobianTest, ProductsAreTheDenseOnes) {
  const VectorXd v = RandomMatrix(layer_.cols(), 1, 3);
  const VectorXd w = RandomMatrix(layer_.rows(), 1, 4);
  VectorXd Jv;
  VectorXd Jtw;
  layer_.Times(v, &Jv);
  layer_.TransposeTimes(w, &Jtw);
  EXPECT_LE((Jv - dense_ * v).norm(), 1e-15 * dense_.norm() * v.norm());
  EXPECT_LE((Jtw - dense_.transpose() * w).norm(),
            1e-15 * dense_.norm() * w.norm());
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
                         testing::Values(std::make_tuple(1, 1, 1, 1),
                                         std::make_tuple(3, 2, 1, 4),
                                         std::make_tuple(2, 5, 7, 1),
                                         std::make_tuple(6, 4, 35, 4),
                                         std::make_tuple(3, 8, 3, 70)));

TEST(GramOfLayers, IsTheSumOfTheirs) {
  const MatrixXd inputs[] = {RandomMatrix(3, 9, 1), RandomMatrix(5, 9, 2)};
  const MatrixXd deltas[] = {RandomMatrix(4, 18, 3), RandomMatrix(2, 18, 4)};
  const std::vector<LayerJacobian> layers = {{&inputs[0], &deltas[0]},
                                             {&inputs[1], &deltas[1]}};
  MatrixXd gram;
  MatrixXd first;
  MatrixXd second;
  GramOfLayers(layers, &gram);
  gram = MatrixXd(gram.selfadjointView<Eigen::Lower>());
  layers[0].Gram(&first);
  layers[1].Gram(&second);
  first = MatrixXd(first.selfadjointView<Eigen::Lower>());
  second = MatrixXd(second.selfadjointView<Eigen::Lower>());
  EXPECT_LE((gram - first - second).norm(), 1e-15 * gram.norm());
}

TEST(LayerJacobianDeathTest, SizesThatDoNotFitAreChecked) {
  const MatrixXd inputs = RandomMatrix(3, 2, 1);
  const MatrixXd deltas = RandomMatrix(4, 6, 2);
  const MatrixXd uneven = RandomMatrix(4, 5, 3);
  const MatrixXd empty(3, 0);
  EXPECT_DEATH(LayerJacobian(&inputs, &uneven), "same number of outputs");
  EXPECT_DEATH(LayerJacobian(&empty, &deltas), "batch is empty");
  const LayerJacobian layer(&inputs, &deltas);
  VectorXd result;
  EXPECT_DEATH(layer.Times(VectorXd::Ones(6), &result), "size");
  EXPECT_DEATH(layer.TransposeTimes(VectorXd::Ones(12), &result), "size");
}

}  // namespace
}  // namespace invgrad
