#include "invgrad/covariance/schur_complement.h"

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/LU"
#include "gtest/gtest.h"
#include "invgrad/covariance/sparse_cholesky.h"
#include "invgrad/random.h"

namespace invgrad {
namespace schur_complement_test {

using Eigen::MatrixXd;
using SparseMatrix = Eigen::SparseMatrix<double>;

// Cameras of size 4 come first, then points of size 3. Each point is seen by
// three cameras, two rows each.
struct Bundle {
  explicit Bundle(int num_points, int num_cameras = 5) {
    NumpyRandom random(9);
    std::vector<Eigen::Triplet<double>> entries;
    int row = 0;
    for (int j = 0; j < num_points; ++j) {
      for (int k = 0; k < 3; ++k) {
        const int camera = (j + 2 * k) % num_cameras;
        for (int i = 0; i < 2; ++i, ++row) {
          const int point = 4 * num_cameras + 3 * j;
          for (int c = 0; c < 4; ++c) {
            entries.emplace_back(row, 4 * camera + c, random.Normal(1)[0]);
          }
          for (int c = 0; c < 3; ++c) {
            entries.emplace_back(row, point + c, random.Normal(1)[0]);
          }
        }
      }
    }
    A = SparseMatrix(row, 4 * num_cameras + 3 * num_points);
    A.setFromTriplets(entries.begin(), entries.end());
    for (int i = 0; i < num_cameras; ++i) offsets.push_back(4 * i);
    for (int j = 0; j <= num_points; ++j) {
      offsets.push_back(4 * num_cameras + 3 * j);
    }
  }

  SparseMatrix A;
  std::vector<int> offsets;
};

TEST(SchurComplement, SolutionsAndEntriesAreThoseOfTheInverse) {
  const Bundle bundle(40);
  const int n = static_cast<int>(bundle.A.cols());
  const MatrixXd inverse = MatrixXd(bundle.A.transpose() * bundle.A).inverse();
  SchurComplement complement(bundle.A, bundle.offsets);
  EXPECT_TRUE(complement.IsSmall());
  std::string error;
  ASSERT_TRUE(complement.Factorize(bundle.A, &error)) << error;
  const MatrixXd Z = complement.Solve(MatrixXd::Identity(n, n));
  const double tolerance = 1e-12 * inverse.norm();
  EXPECT_LE((Z - inverse).cwiseAbs().maxCoeff(), tolerance);
  std::vector<std::pair<int, int>> entries;
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) entries.emplace_back(i, j);
  }
  const std::vector<std::optional<double>> values = complement.Entries(entries);
  for (std::size_t e = 0; e < entries.size(); ++e) {
    ASSERT_TRUE(values[e].has_value());
    EXPECT_NEAR(
        *values[e], inverse(entries[e].first, entries[e].second), tolerance);
  }
}

// A block without columns, as where all of them are anchors.
TEST(SchurComplement, BlocksMayBeEmpty) {
  Bundle bundle(40);
  bundle.offsets.insert(bundle.offsets.begin() + 6, bundle.offsets[5]);
  SchurComplement complement(bundle.A, bundle.offsets);
  std::string error;
  ASSERT_TRUE(complement.Factorize(bundle.A, &error)) << error;
  const Eigen::VectorXd b =
      Eigen::VectorXd::LinSpaced(bundle.A.cols(), -1.0, 1.0);
  const Eigen::VectorXd x = complement.Solve(b);
  EXPECT_LE((bundle.A.transpose() * (bundle.A * x) - b).norm(), 1e-9);
}

// A point that no camera sees, but for a prior, as where the cameras' columns
// are anchors.
TEST(SchurComplement, BlocksMayBeAlone) {
  Bundle bundle(40);
  const int n = static_cast<int>(bundle.A.cols());
  const int m = static_cast<int>(bundle.A.rows());
  MatrixXd dense = MatrixXd::Zero(m + 3, n + 3);
  dense.topLeftCorner(m, n) = bundle.A;
  dense.bottomRightCorner(3, 3).diagonal() << 1.0, 2.0, 4.0;
  const SparseMatrix A = dense.sparseView();
  bundle.offsets.push_back(n + 3);
  SchurComplement complement(A, bundle.offsets);
  std::string error;
  ASSERT_TRUE(complement.Factorize(A, &error)) << error;
  const Eigen::VectorXd x =
      complement.Solve(Eigen::VectorXd::Ones(n + 3)).bottomRows(3);
  EXPECT_NEAR(x[1], 1.0 / 4.0, 1e-15);
  const auto values = complement.Entries({{n + 2, n + 2}, {n, n + 1}, {0, n}});
  EXPECT_NEAR(*values[0], 1.0 / 16.0, 1e-15);
  EXPECT_EQ(*values[1], 0.0);
  EXPECT_EQ(*values[2], 0.0);
}

TEST(SchurComplement, IsSmallWhereFewColumnsCoupleTheOthers) {
  const Bundle few_points(10);
  EXPECT_FALSE(SchurComplement(few_points.A, few_points.offsets).IsSmall());
  // A chain of poses.
  const int n = 90;
  SparseMatrix A(n - 3, n);
  std::vector<int> offsets;
  for (int j = 0; j < n - 3; ++j) {
    A.insert(j, j) = 1.0;
    A.insert(j, j + 3) = -1.0;
  }
  A.makeCompressed();
  for (int j = 0; j <= n; j += 3) offsets.push_back(j);
  EXPECT_FALSE(SchurComplement(A, offsets).IsSmall());
}

TEST(SchurComplement, DependentColumnsAreAMessage) {
  Bundle bundle(40);
  // A column of zeros.
  SparseMatrix A = bundle.A;
  MatrixXd dense = A;
  dense.col(21).setZero();
  A = dense.sparseView();
  SchurComplement complement(A, bundle.offsets);
  std::string error;
  EXPECT_FALSE(complement.Factorize(A, &error));
  EXPECT_EQ(error, "J^T J is not positive definite to rounding");
}

}  // namespace schur_complement_test
}  // namespace invgrad
