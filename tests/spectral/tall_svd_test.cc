#include "invgrad/spectral/routes/tall_svd.h"

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "bin/support/spectral_reference.h"
#include "gtest/gtest.h"

namespace invgrad {
namespace tall_svd_test {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// Some roundings in each of many sums.
double Tolerance(const MatrixXd& A) {
  return 10.0 * kEpsilon * std::sqrt(static_cast<double>(A.rows() + A.cols()));
}

// The products with W and Z, column by column.
struct Factors {
  MatrixXd W;
  MatrixXd Z;
};

Factors FactorsOf(const TallSvd& svd, Index p, Index q) {
  Factors factors{MatrixXd(p, q), MatrixXd(q, q)};
  VectorXd y;
  for (Index j = 0; j < q; ++j) {
    const VectorXd unit = VectorXd::Unit(q, j);
    svd.LeftTimes(unit, &y);
    factors.W.col(j) = y;
    svd.RightTimes(unit, &y);
    factors.Z.col(j) = y;
  }
  return factors;
}

// Just below and above p / q = 11 / 6, where A is reduced to a triangle first;
// the smallest sizes; square.
const std::vector<std::pair<int, int>> kShapes = {
    {1, 1}, {5, 1}, {2, 2}, {30, 30}, {36, 20}, {37, 20}, {200, 20}, {300, 80}};

TEST(TallSvd, FactorsAreThoseOfTheMatrix) {
  RandomMatrices random(1);
  TallSvd svd;  // the same for all: sizes may change
  for (const auto& [p, q] : kShapes) {
    SCOPED_TRACE(std::to_string(p) + " x " + std::to_string(q));
    const VectorXd s = LogUniform(q, 1e-9);
    const MatrixXd A = random.WithSpectrum(p, q, s);
    MatrixXd destroyed = A;
    ASSERT_TRUE(svd.Compute(&destroyed));
    ASSERT_EQ(svd.s().size(), q);
    // To a few roundings of the largest: the smallest have lost digits.
    EXPECT_LE((svd.s() - s).lpNorm<Eigen::Infinity>(), Tolerance(A));
    for (int i = 1; i < q; ++i) EXPECT_LE(svd.s()[i], svd.s()[i - 1]);
    EXPECT_GE(svd.s()[q - 1], 0.0);

    const auto [W, Z] = FactorsOf(svd, p, q);
    const MatrixXd identity = MatrixXd::Identity(q, q);
    EXPECT_LE((W.transpose() * W - identity).norm(), q * Tolerance(A));
    EXPECT_LE((Z.transpose() * Z - identity).norm(), q * Tolerance(A));
    EXPECT_LE((W * svd.s().asDiagonal() * Z.transpose() - A).norm(),
              Tolerance(A) * A.norm());

    const VectorXd x = random.Vector(p);
    const VectorXd z = random.Vector(q);
    VectorXd y;
    svd.LeftTransposeTimes(x, &y);
    EXPECT_LE((y - W.transpose() * x).norm(), Tolerance(A) * x.norm());
    svd.LeftTimes(z, &y);
    EXPECT_LE((y - W * z).norm(), Tolerance(A) * z.norm());
    svd.RightTransposeTimes(z, &y);
    EXPECT_LE((y - Z.transpose() * z).norm(), Tolerance(A) * z.norm());
    svd.RightTimes(z, &y);
    EXPECT_LE((y - Z * z).norm(), Tolerance(A) * z.norm());
  }
}

TEST(TallSvd, ZeroAndRankDeficientMatrices) {
  for (const auto& [p, q] : kShapes) {
    TallSvd svd;
    MatrixXd A = MatrixXd::Zero(p, q);
    ASSERT_TRUE(svd.Compute(&A));
    EXPECT_EQ(svd.s(), VectorXd::Zero(q));
    A = MatrixXd::Ones(p, q);
    ASSERT_TRUE(svd.Compute(&A));
    EXPECT_NEAR(
        svd.s()[0], std::sqrt(1.0 * p * q), 100 * kEpsilon * std::sqrt(p * q));
    EXPECT_LE(svd.s().tail(q - 1).norm(), 100 * kEpsilon * std::sqrt(p * q));
  }
}

// LAPACK iterates on numbers that are not: it says so, or its factors are not
// finite either. It ends.
TEST(TallSvd, NaNIsNoDecomposition) {
  for (const auto& [p, q] : {std::pair(30, 20), std::pair(90, 20)}) {
    MatrixXd A = MatrixXd::Identity(p, q);
    A(3, 2) = std::numeric_limits<double>::quiet_NaN();
    TallSvd svd;
    EXPECT_FALSE(svd.Compute(&A) && svd.s().allFinite());
  }
}

TEST(TallSvdDeathTest, ChecksTheShape) {
  // OpenBLAS has threads of its own.
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  MatrixXd A = MatrixXd::Ones(3, 4);
  TallSvd svd;
  EXPECT_DEATH(svd.Compute(&A), "p >= q");
}

}  // namespace tall_svd_test
}  // namespace invgrad
