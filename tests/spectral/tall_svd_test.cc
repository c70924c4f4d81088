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
  SpectralWorkspace workspace;  // the same for all: sizes may change
  for (const auto& [p, q] : kShapes) {
    SCOPED_TRACE(std::to_string(p) + " x " + std::to_string(q));
    const VectorXd s = LogUniform(q, 1e-9);
    const MatrixXd A = random.WithSpectrum(p, q, s);
    workspace.dense = A;
    TallSvd svd(&workspace);
    std::string error;
    ASSERT_TRUE(svd.Compute(&error)) << error;
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
    SpectralWorkspace workspace;
    std::string error;
    TallSvd svd(&workspace);
    workspace.dense = MatrixXd::Zero(p, q);
    ASSERT_TRUE(svd.Compute(&error)) << error;
    EXPECT_EQ(svd.s(), VectorXd::Zero(q));
    workspace.dense = MatrixXd::Ones(p, q);
    ASSERT_TRUE(svd.Compute(&error)) << error;
    EXPECT_NEAR(
        svd.s()[0], std::sqrt(1.0 * p * q), 100 * kEpsilon * std::sqrt(p * q));
    EXPECT_LE(svd.s().tail(q - 1).norm(), 100 * kEpsilon * std::sqrt(p * q));
  }
}

TEST(TallSvd, RepeatsBitForBit) {
  RandomMatrices random(2);
  for (const auto& [p, q] : kShapes) {
    const MatrixXd A = random.WithSpectrum(p, q, LogUniform(q, 1e-3));
    const VectorXd x = random.Vector(p);
    SpectralWorkspace workspace;
    TallSvd svd(&workspace);
    std::string error;
    VectorXd s[2];
    VectorXd y[2];
    for (int repeat = 0; repeat < 2; ++repeat) {
      workspace.dense = A;
      ASSERT_TRUE(svd.Compute(&error));
      s[repeat] = svd.s();
      svd.LeftTransposeTimes(x, &y[repeat]);
    }
    EXPECT_EQ(s[0], s[1]);
    EXPECT_EQ(y[0], y[1]);
  }
}

// LAPACK iterates on numbers that are not: it says so, or its factors are not
// finite either. It ends.
TEST(TallSvd, NaNIsNoDecomposition) {
  for (const auto& [p, q] : {std::pair(30, 20), std::pair(90, 20)}) {
    SpectralWorkspace workspace;
    workspace.dense = MatrixXd::Identity(p, q);
    workspace.dense(3, 2) = std::numeric_limits<double>::quiet_NaN();
    TallSvd svd(&workspace);
    std::string error;
    if (svd.Compute(&error)) {
      EXPECT_FALSE(svd.s().allFinite());
    } else {
      EXPECT_NE(error, "");
    }
  }
}

TEST(TallSvdDeathTest, ChecksTheShape) {
  SpectralWorkspace workspace;
  workspace.dense = MatrixXd::Ones(3, 4);
  TallSvd svd(&workspace);
  std::string error;
  EXPECT_DEATH(svd.Compute(&error), "p >= q");
}

}  // namespace tall_svd_test
}  // namespace invgrad
