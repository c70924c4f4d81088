#include "invgrad/jacobian_operator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/stored_jacobian.h"

namespace invgrad {
namespace jacobian_operator_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// Two thirds of the entries are zero.
MatrixXd RandomMatrix(int rows, int cols) {
  std::mt19937 generator(17 * rows + cols);
  std::normal_distribution<double> normal;
  return MatrixXd::NullaryExpr(rows, cols, [&]() {
    const double value = normal(generator);
    return generator() % 3 == 0 ? value : 0.0;
  });
}

// Any form of J has to agree with the matrix. A sum of k products of numbers of
// order one is off by at most about k epsilon.
void ExpectActsLike(const JacobianOperator& J, const MatrixXd& matrix) {
  ASSERT_EQ(J.rows(), matrix.rows());
  ASSERT_EQ(J.cols(), matrix.cols());
  const double tolerance =
      16.0 * kEpsilon * std::max(matrix.rows(), matrix.cols());
  const VectorXd v = VectorXd::LinSpaced(matrix.cols(), -1.0, 1.0);
  const VectorXd w = VectorXd::LinSpaced(matrix.rows(), -1.0, 1.0);
  // Results of another size must be overwritten.
  VectorXd Jv = VectorXd::Constant(3, 5.0);
  VectorXd Jtw = VectorXd::Constant(3, 5.0);
  MatrixXd JJt = MatrixXd::Constant(2, 3, 5.0);
  MatrixXd JtJ = MatrixXd::Constant(2, 3, 5.0);
  MatrixXd dense;
  J.Times(v, &Jv);
  J.TransposeTimes(w, &Jtw);
  J.Gram(&JJt);
  J.ParameterGram(&JtJ);
  J.ToDense(&dense);
  EXPECT_TRUE(dense == matrix);
  ASSERT_EQ(Jv.size(), matrix.rows());
  ASSERT_EQ(Jtw.size(), matrix.cols());
  ASSERT_EQ(JJt.rows(), matrix.rows());
  ASSERT_EQ(JtJ.rows(), matrix.cols());
  // The lower triangles are what is promised.
  JJt = MatrixXd(JJt.selfadjointView<Eigen::Lower>());
  JtJ = MatrixXd(JtJ.selfadjointView<Eigen::Lower>());
  if (matrix.size() == 0) {
    EXPECT_TRUE(Jv.isZero(0.0) && Jtw.isZero(0.0));
    EXPECT_TRUE(JJt.isZero(0.0) && JtJ.isZero(0.0));
    return;
  }
  EXPECT_LE((Jv - matrix * v).cwiseAbs().maxCoeff(), tolerance);
  EXPECT_LE((Jtw - matrix.transpose() * w).cwiseAbs().maxCoeff(), tolerance);
  EXPECT_LE((JJt - matrix * matrix.transpose()).cwiseAbs().maxCoeff(),
            tolerance);
  EXPECT_LE((JtJ - matrix.transpose() * matrix).cwiseAbs().maxCoeff(),
            tolerance);
}

// Sizes around the block of 32 in which Gram matrices are mirrored.
const std::vector<std::pair<int, int>> kShapes = {{1, 1},
                                                  {1, 7},
                                                  {7, 1},
                                                  {5, 9},
                                                  {32, 33},
                                                  {33, 32},
                                                  {70, 41},
                                                  {0, 4},
                                                  {4, 0}};

TEST(DenseJacobian, ActsLikeTheMatrix) {
  for (const auto& [rows, cols] : kShapes) {
    SCOPED_TRACE(testing::Message() << rows << " x " << cols);
    const MatrixXd matrix = RandomMatrix(rows, cols);
    ExpectActsLike(DenseJacobian(matrix), matrix);
  }
}

TEST(SparseJacobian, ActsLikeTheMatrix) {
  for (const auto& [rows, cols] : kShapes) {
    SCOPED_TRACE(testing::Message() << rows << " x " << cols);
    const MatrixXd matrix = RandomMatrix(rows, cols);
    ExpectActsLike(SparseJacobian(matrix.sparseView()), matrix);
  }
}

TEST(FunctionJacobian, ActsLikeTheMatrix) {
  for (const auto& [rows, cols] : kShapes) {
    SCOPED_TRACE(testing::Message() << rows << " x " << cols);
    const MatrixXd matrix = RandomMatrix(rows, cols);
    const DenseJacobian J(matrix);
    ExpectActsLike(
        FunctionJacobian(
            rows,
            cols,
            [&J](const VectorXd& v, VectorXd* Jv) { J.Times(v, Jv); },
            [&J](const VectorXd& w, VectorXd* Jtw) {
              J.TransposeTimes(w, Jtw);
            }),
        matrix);
  }
}

TEST(JacobianOperator, ColumnBlocksAreTheColumns) {
  const MatrixXd matrix = RandomMatrix(6, 11);
  const std::vector<int> sizes = {4, 0, 6, 1};
  const DenseJacobian dense(matrix, sizes);
  const SparseJacobian sparse(matrix.sparseView(), sizes);
  for (const JacobianOperator* J :
       {static_cast<const JacobianOperator*>(&dense),
        static_cast<const JacobianOperator*>(&sparse)}) {
    const auto blocks = ColumnBlocksOf(*J);
    ASSERT_EQ(blocks.size(), sizes.size());
    int column = 0;
    for (size_t i = 0; i < sizes.size(); ++i) {
      ExpectActsLike(*blocks[i], matrix.middleCols(column, sizes[i]));
      EXPECT_TRUE(ColumnBlocksOf(*blocks[i]).empty());
      column += sizes[i];
    }
  }
  EXPECT_TRUE(
      ColumnBlocksOf(FunctionJacobian(6, 11, nullptr, nullptr)).empty());
  EXPECT_DEATH(DenseJacobian(matrix, {4, 6}), "Blocks of columns");
  EXPECT_DEATH(SparseJacobian(matrix.sparseView(), {12}), "Blocks of columns");
}

TEST(JacobianOperator, NonFiniteEntriesTravelThrough) {
  MatrixXd matrix = MatrixXd::Ones(3, 4);
  matrix(1, 2) = std::numeric_limits<double>::quiet_NaN();
  const DenseJacobian dense(matrix);
  const SparseJacobian sparse(matrix.sparseView());
  for (const JacobianOperator* J :
       {static_cast<const JacobianOperator*>(&dense),
        static_cast<const JacobianOperator*>(&sparse)}) {
    VectorXd Jv, Jtw;
    MatrixXd JJt, JtJ;
    J->Times(VectorXd::Ones(4), &Jv);
    J->TransposeTimes(VectorXd::Ones(3), &Jtw);
    J->Gram(&JJt);
    J->ParameterGram(&JtJ);
    EXPECT_TRUE(std::isnan(Jv[1]) && std::isfinite(Jv[0]));
    EXPECT_TRUE(std::isnan(Jtw[2]) && std::isfinite(Jtw[0]));
    EXPECT_TRUE(std::isnan(JJt(1, 1)) && std::isfinite(JJt(2, 0)));
    EXPECT_TRUE(std::isnan(JtJ(2, 2)) && std::isfinite(JtJ(1, 0)));
  }
}

TEST(JacobianOperatorDeathTest, SizesThatDoNotFitAreChecked) {
  const DenseJacobian dense(MatrixXd::Ones(3, 4));
  const SparseJacobian sparse(MatrixXd::Ones(3, 4).sparseView());
  VectorXd result;
  EXPECT_DEATH(dense.Times(VectorXd::Ones(3), &result), "J v with J 3 x 4");
  EXPECT_DEATH(dense.TransposeTimes(VectorXd::Ones(4), &result), "J\\^T w");
  EXPECT_DEATH(sparse.Times(VectorXd::Ones(3), &result), "J v");
  EXPECT_DEATH(sparse.TransposeTimes(VectorXd::Ones(4), &result), "J\\^T w");
}

}  // namespace jacobian_operator_test
}  // namespace invgrad
