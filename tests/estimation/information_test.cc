#include "problems/estimation/information.h"

#include <cmath>
#include <limits>

#include "gtest/gtest.h"

namespace invgrad {
namespace information_test {

using Eigen::MatrixXd;
using Eigen::Vector3d;

// Relative to the units of rows and columns.
double RelativeError(const MatrixXd& information) {
  MatrixXd root;
  EXPECT_TRUE(UpperRoot(information, &root)) << information;
  const MatrixXd product = root.transpose() * root;
  double largest = 0.0;
  for (Eigen::Index i = 0; i < product.rows(); ++i) {
    for (Eigen::Index j = 0; j < product.cols(); ++j) {
      const double unit = std::sqrt(information(i, i) * information(j, j));
      const double error = std::abs(product(i, j) - information(i, j));
      if (error > 0.0) largest = std::max(largest, error / unit);
    }
  }
  return largest;
}

MatrixXd OfRank(int rank, const Vector3d& units) {
  MatrixXd A(3, rank);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < rank; ++j)
      A(i, j) = std::sin(1.0 + j + 2.3 * i * (j + 1));
  }
  A = units.asDiagonal() * A;
  return A * A.transpose();
}

TEST(Information, TheRootOfEveryRankGivesItBackInAllUnits) {
  for (const double scale : {1e-8, 1.0, 1e8}) {
    for (int rank = 0; rank <= 3; ++rank) {
      MatrixXd information = OfRank(rank, {1.0, scale, 3.0});
      information = 0.5 * (information + information.transpose()).eval();
      EXPECT_LT(RelativeError(information), 1e-14) << rank << " " << scale;
      EXPECT_EQ(IsDefinite(information), rank == 3);
    }
  }
}

TEST(Information, ADefiniteMatrixHasItsUpperCholeskyFactor) {
  MatrixXd root;
  ASSERT_TRUE(UpperRoot((MatrixXd(2, 2) << 4, 2, 2, 10).finished(), &root));
  EXPECT_EQ(root, (MatrixXd(2, 2) << 2, 1, 0, 3).finished());
}

// Otherwise rounding errors would know what the measurement does not.
TEST(Information, UnknownDirectionsHaveNoWeight) {
  const Vector3d known(0.1, 0.7, -0.3);
  const Vector3d unknown(0.7, -0.1, 0.0);
  MatrixXd root;
  ASSERT_TRUE(UpperRoot(known * known.transpose(), &root));
  EXPECT_LT((root * unknown).norm(), 1e-15);
  EXPECT_NEAR((root * known).norm(), known.squaredNorm(), 1e-15);
}

TEST(Information, AMatrixOfSixDigitsMayBeSlightlyIndefinite) {
  // [1 1/3; 1/3 1/9], rounded up.
  MatrixXd root;
  EXPECT_TRUE(UpperRoot(
      (MatrixXd(2, 2) << 1, 0.333334, 0.333334, 0.111111).finished(), &root));
  EXPECT_FALSE(UpperRoot(
      (MatrixXd(2, 2) << 1, 0.3334, 0.3334, 0.111111).finished(), &root));
}

TEST(Information, RefusesWhatIsNotSemidefinite) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  MatrixXd root;
  for (const MatrixXd& bad :
       {(MatrixXd(2, 2) << 1, 2, 2, 1).finished(),
        (MatrixXd(2, 2) << 0, 1, 1, 1).finished(),
        (MatrixXd(2, 2) << -1, 0, 0, 1).finished(),
        (MatrixXd(2, 2) << 1, 0.5, 0, 1).finished(),
        (MatrixXd(2, 2) << kNaN, 0, 0, 1).finished(),
        (MatrixXd(2, 2) << 1, 1e300, 1e300, 1).finished(),
        (MatrixXd(2, 2) << 1e-300, 1e300, 1e300, 1).finished()}) {
    EXPECT_FALSE(UpperRoot(bad, &root)) << bad;
  }
}

}  // namespace information_test
}  // namespace invgrad
