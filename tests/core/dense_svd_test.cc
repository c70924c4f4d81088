#include "invgrad/core/dense_svd.h"

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace dense_svd_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// Just below and above the ratio 11 / 6, from which a QR factorization comes
// first; wide, square, and a single number.
const std::vector<std::pair<int, int>> kShapes = {
    {1, 1}, {12, 12}, {21, 12}, {22, 12}, {200, 12}, {12, 21}, {12, 200}};

DenseSvd SvdOf(MatrixXd A) {
  DenseSvd svd;
  *svd.mutable_matrix() = std::move(A);
  EXPECT_TRUE(svd.Compute());
  return svd;
}

TEST(DenseSvd, FactorsAreOrthonormalAndGiveTheMatrix) {
  for (const auto& [m, n] : kShapes) {
    SCOPED_TRACE(std::to_string(m) + " x " + std::to_string(n));
    const MatrixXd A = RandomMatrix(m, n, 1);
    const DenseSvd svd = SvdOf(A);
    const MatrixXd U = svd.U();
    const auto k = svd.s().size();
    ASSERT_EQ(k, std::min(m, n));
    const double bound = 10.0 * (m + n) * kEpsilon;
    EXPECT_LE((U * svd.s().asDiagonal() * svd.Vt() - A).norm(),
              bound * A.norm());
    EXPECT_LE((U.transpose() * U - MatrixXd::Identity(k, k)).norm(), bound);
    EXPECT_LE(
        (svd.Vt() * svd.Vt().transpose() - MatrixXd::Identity(k, k)).norm(),
        bound);
    for (int i = 1; i < k; ++i) EXPECT_GE(svd.s()[i - 1], svd.s()[i]);
    const MatrixXd D = RandomMatrix(m, 3, 2);
    EXPECT_LE((svd.UTransposeTimes(D) - U.transpose() * D).norm(),
              bound * D.norm());
    EXPECT_LE((SingularValues(A) - svd.s()).norm(), bound * A.norm());
  }
}

TEST(DenseSvd, OneObjectServesMatricesOfAnySize) {
  DenseSvd svd;
  for (const auto& [m, n] : kShapes) {
    const MatrixXd A = RandomMatrix(m, n, 3);
    *svd.mutable_matrix() = A;
    ASSERT_TRUE(svd.Compute());
    EXPECT_EQ(svd.s(), SvdOf(A).s());
    EXPECT_EQ(svd.U(), SvdOf(A).U());
  }
}

TEST(DenseSvd, MatricesWithoutEntriesAreDecomposed) {
  EXPECT_EQ(SvdOf(MatrixXd(4, 0)).s().size(), 0);
  EXPECT_EQ(SvdOf(MatrixXd(0, 4)).s().size(), 0);
  EXPECT_EQ(SingularValues(MatrixXd(4, 0)).size(), 0);
}

TEST(DenseSvd, WhatIsNotFiniteFails) {
  for (const auto& [m, n] : kShapes) {
    for (const double value : {std::nan(""), HUGE_VAL}) {
      MatrixXd A = RandomMatrix(m, n, 1);
      A(m - 1, n - 1) = value;
      DenseSvd svd;
      *svd.mutable_matrix() = A;
      EXPECT_FALSE(svd.Compute()) << m << " x " << n << ": " << value;
      EXPECT_TRUE(SingularValues(A).array().isNaN().all());
    }
  }
}

TEST(DenseSvd, SingularValuesThatOverflowFail) {
  for (const auto& [m, n] : kShapes) {
    if (m * n < 4) continue;  // s = 1.7e308 is finite
    const MatrixXd A = MatrixXd::Constant(m, n, 1.7e308);
    DenseSvd svd;
    *svd.mutable_matrix() = A;
    EXPECT_FALSE(svd.Compute()) << m << " x " << n;
    EXPECT_TRUE(SingularValues(A).array().isNaN().all()) << m << " x " << n;
  }
}

}  // namespace dense_svd_test
}  // namespace invgrad
