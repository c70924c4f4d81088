#include "invgrad/rank/smallest_singular.h"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "gtest/gtest.h"
#include "invgrad/internal/qr.h"
#include "invgrad/random.h"

namespace invgrad {
namespace smallest_singular_test {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using SparseMatrix = Eigen::SparseMatrix<double>;

MatrixXd RandomOrthonormal(int rows, int cols, int seed) {
  const MatrixXd A = NumpyRandom(seed).Rand(rows, cols).array() - 0.5;
  return Orthonormalized(A);
}

// U diag(s) V^T: m x s.size().
SparseMatrix WithSingularValues(const VectorXd& s, int m, const MatrixXd& V) {
  const auto n = static_cast<int>(s.size());
  const MatrixXd A =
      RandomOrthonormal(m, n, 1) * s.asDiagonal() * V.transpose();
  return A.sparseView(1.0, 0.0);
}

// The sine of the largest angle between two subspaces of the same dimension.
double Distance(const MatrixXd& U, const MatrixXd& V) {
  return (U - V * (V.transpose() * U)).norm();
}

// Both ways find the zeros, the small ones and nothing else, in a tall matrix
// that is reduced by QR and in a nearly square one.
TEST(SmallestSingular, FindsWhatWasPutIn) {
  constexpr int kSize = 40;
  VectorXd s = VectorXd::LinSpaced(kSize, 1.0, 0.1);
  s.tail(5) << 3e-5, 1e-6, 2e-8, 0.0, 0.0;
  const MatrixXd V = RandomOrthonormal(kSize, kSize, 2);
  for (const int m : {44, 200}) {
    SCOPED_TRACE(m);
    const SparseMatrix A = WithSingularValues(s, m, V);
    SmallestSingular dense;
    SmallestSingular sparse;
    std::string error;
    ASSERT_TRUE(DenseSmallestSingular(A, 1e-4, &dense, &error)) << error;
    ASSERT_TRUE(SparseSmallestSingular(A, 1.0, 1e-4, 20, &sparse, &error))
        << error;
    ASSERT_EQ(dense.s.size(), kSize);
    // Roundings of s_max.
    EXPECT_LE((dense.s.reverse() - s).lpNorm<Eigen::Infinity>(), 1e-14);
    EXPECT_TRUE(sparse.complete);
    for (const SmallestSingular* result : {&dense, &sparse}) {
      ASSERT_EQ(result->V.cols(), 5);
      for (int i = 0; i < 5; ++i) {
        // What the header promises, and the iteration's 1e-3.
        EXPECT_NEAR(
            result->s[i], s[kSize - 1 - i], 1e-9 + 1e-3 * s[kSize - 1 - i]);
      }
      EXPECT_LE(
          (result->V.transpose() * result->V - MatrixXd::Identity(5, 5)).norm(),
          1e-13);
      // eps / gap for the SVD, 1e-16 / 0.1^2 for the normal equations.
      EXPECT_LE(Distance(result->V, V.rightCols(5)), 1e-12);
    }
  }
}

TEST(SmallestSingular, WideMatricesHaveTheirNullSpace) {
  SparseMatrix A(1, 4);
  for (int j = 0; j < 4; ++j) A.insert(0, j) = 2.0;
  SmallestSingular result;
  std::string error;
  ASSERT_TRUE(DenseSmallestSingular(A, 1e-4, &result, &error)) << error;
  EXPECT_EQ(result.V.cols(), 3);
  EXPECT_LE((A * result.V).norm(), 1e-14);
  EXPECT_NEAR(result.s[3], 4.0, 1e-14);
  ASSERT_TRUE(SparseSmallestSingular(A, 4.0, 1e-4, 20, &result, &error));
  EXPECT_EQ(result.V.cols(), 3);
  EXPECT_TRUE(result.complete);
  VectorXd s;
  ASSERT_TRUE(DenseSingularValues(A, &s, &error)) << error;
  ASSERT_EQ(s.size(), 1);
  EXPECT_NEAR(s[0], 4.0, 1e-14);
}

TEST(SmallestSingular, EmptyAndNotFiniteMatrices) {
  SmallestSingular result;
  std::string error;
  EXPECT_TRUE(DenseSmallestSingular(SparseMatrix(3, 0), 1.0, &result, &error));
  ASSERT_TRUE(DenseSmallestSingular(SparseMatrix(0, 3), 1.0, &result, &error));
  EXPECT_EQ(result.V.cols(), 3);
  SparseMatrix A(1, 1);
  A.insert(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(DenseSmallestSingular(A, 1.0, &result, &error));
  EXPECT_FALSE(SparseSmallestSingular(A, 1.0, 1.0, 5, &result, &error));
  EXPECT_NE(error.find("not finite"), std::string::npos);
}

}  // namespace smallest_singular_test
}  // namespace invgrad
