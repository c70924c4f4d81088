#include "invgrad/rank/localized_basis.h"

#include <cmath>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/internal/qr.h"
#include "invgrad/random.h"
#include "invgrad/rank/decompositions.h"

namespace invgrad {
namespace localized_basis_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Blocks of 2, 3, 1, 1, 3 and 4 rows. The space: one direction within block 1,
// one of blocks 2 and 3, one of all blocks; mixed by a random rotation.
TEST(LocalizedBasis, TakesARotatedSpaceApart) {
  const std::vector<int> offsets = {0, 2, 5, 6, 7, 10, 14};
  MatrixXd A = MatrixXd::Zero(14, 3);
  A.block(2, 0, 3, 1) << 1.0, -2.0, 0.5;
  A(5, 1) = 1.0;
  A(6, 1) = -3.0;
  A.col(2) = NumpyRandom(4).Rand(14, 1).array() + 0.5;
  const MatrixXd rotation = Orthonormalized(NumpyRandom(5).Rand(3, 3));
  const MatrixXd V = Orthonormalized(A) * rotation;
  const LocalizedBasis basis = Localize(V, offsets);
  ASSERT_EQ(basis.single.cols(), 1);
  EXPECT_EQ(basis.single_blocks, std::vector<int>{1});
  const VectorXd within = A.col(0).normalized();
  EXPECT_NEAR(std::abs(basis.single.col(0).dot(within)), 1.0, 1e-14);
  ASSERT_EQ(basis.localized_rest.cols(), 2);
  EXPECT_EQ(NumParts(basis.localized_rest.col(0), offsets), 2);
  const VectorXd pair = A.col(1).normalized();
  EXPECT_NEAR(std::abs(basis.localized_rest.col(0).dot(pair)), 1.0, 1e-14);
  EXPECT_GE(NumParts(basis.localized_rest.col(1), offsets), 5);
  // Together they span the space.
  MatrixXd all(14, 3);
  all << basis.single, basis.localized_rest;
  EXPECT_GT(ComputeRightSvd(all).s.minCoeff(), 1e-3);
  EXPECT_LE((all - V * (V.transpose() * all)).norm(), 1e-13);
  EXPECT_LE((basis.rest.transpose() * basis.single).norm(), 1e-13);
}

// The null space of a random 3 x 240 matrix: one direction within each block of
// four rows, and a space of far more dimensions than a block has.
TEST(LocalizedBasis, FindsTheDirectionsWithinSmallBlocks) {
  const int n = 240;
  const MatrixXd random = NumpyRandom(8).Rand(n, n).array() - 0.5;
  const MatrixXd A = random.leftCols(3).transpose();
  const MatrixXd Q = Orthonormalized(random);
  std::vector<int> offsets;
  for (int b = 0; b <= n; b += 4) offsets.push_back(b);
  const LocalizedBasis basis = Localize(Q.rightCols(n - 3), offsets);
  ASSERT_EQ(basis.single.cols(), n / 4);
  EXPECT_LE((A * basis.single).cwiseAbs().maxCoeff(), 1e-12);
  for (int b = 0; b < n / 4; ++b) {
    EXPECT_EQ(basis.single_blocks[b], b);
    EXPECT_NEAR(basis.single.col(b).segment(4 * b, 4).norm(), 1.0, 1e-12);
  }
  EXPECT_EQ(basis.rest.cols(), n - 3 - n / 4);
}

TEST(LocalizedBasis, OrthogonalRestIsInTheSpan) {
  const MatrixXd V = Orthonormalized(NumpyRandom(6).Rand(9, 4));
  const MatrixXd U = V * NumpyRandom(7).Rand(4, 2);
  const MatrixXd rest = OrthogonalRest(V, U);
  ASSERT_EQ(rest.cols(), 2);
  EXPECT_LE((rest.transpose() * U).norm(), 1e-13);
  EXPECT_LE((rest - V * (V.transpose() * rest)).norm(), 1e-13);
  EXPECT_EQ(OrthogonalRest(V, V).cols(), 0);
  EXPECT_EQ(OrthogonalRest(V, MatrixXd(9, 0)), V);
}

}  // namespace localized_basis_test
}  // namespace invgrad
