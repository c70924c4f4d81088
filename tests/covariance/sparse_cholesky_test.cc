#include "invgrad/covariance/sparse_cholesky.h"

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/LU"
#include "gtest/gtest.h"
#include "invgrad/random.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using SparseMatrix = Eigen::SparseMatrix<double>;

// Rows that couple columns of a chain, and a few pairs far from each other.
SparseMatrix Chain(int n) {
  NumpyRandom random(4);
  std::vector<Eigen::Triplet<double>> entries;
  for (int i = 0; i < 2 * n; ++i) {
    const int other = i < n ? (i + 1) % n : (7 * i) % n;
    entries.emplace_back(i, i % n, random.Uniform(1.0, 2.0));
    if (other != i % n) {
      entries.emplace_back(i, other, random.Uniform(-1.0, 0.0));
    }
  }
  SparseMatrix A(2 * n, n);
  A.setFromTriplets(entries.begin(), entries.end());
  return A;
}

TEST(SparseCholesky, SolutionsAndSelectedEntriesAreThoseOfTheInverse) {
  // Large enough for supernodes.
  for (const int n : {1, 2, 40, 300}) {
    const SparseMatrix A = Chain(n);
    const MatrixXd inverse = MatrixXd(A.transpose() * A).inverse();
    SparseCholesky cholesky;
    std::string error;
    ASSERT_TRUE(cholesky.Factorize(A, &error)) << error;
    const MatrixXd Z = cholesky.Solve(MatrixXd::Identity(n, n));
    EXPECT_LE((Z - inverse).cwiseAbs().maxCoeff(), 1e-12);
    std::vector<std::pair<int, int>> entries;
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) entries.emplace_back(i, j);
    }
    const std::vector<std::optional<double>> values = cholesky.Entries(entries);
    const SparseMatrix normal = A.transpose() * A;
    for (std::size_t e = 0; e < entries.size(); ++e) {
      const auto [i, j] = entries[e];
      if (normal.coeff(i, j) != 0.0) {
        ASSERT_TRUE(values[e].has_value());
      }
      if (values[e]) {
        EXPECT_NEAR(*values[e], inverse(i, j), 1e-12);
      }
    }
  }
}

TEST(SparseCholesky, TheRecurrenceEndsAtTheFirstColumnThatIsNeeded) {
  const SparseMatrix A = Chain(200);
  const MatrixXd inverse = MatrixXd(A.transpose() * A).inverse();
  SparseCholesky cholesky;
  std::string error;
  ASSERT_TRUE(cholesky.Factorize(A, &error)) << error;
  for (const int i : {0, 77, 199}) {
    const auto values = cholesky.Entries({{i, i}});
    ASSERT_TRUE(values[0].has_value());
    EXPECT_NEAR(*values[0], inverse(i, i), 1e-12);
  }
}

TEST(SparseCholesky, DependentColumnsAreAMessage) {
  SparseMatrix A(3, 2);
  A.insert(0, 0) = 1.0;
  A.insert(0, 1) = 2.0;
  A.makeCompressed();
  SparseCholesky cholesky;
  std::string error;
  EXPECT_FALSE(cholesky.Factorize(A, &error));
  EXPECT_EQ(error, "J^T J is not positive definite to rounding");
}

}  // namespace
}  // namespace invgrad
