#include "invgrad/rank/sparse_cholesky.h"

#include <cmath>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "gtest/gtest.h"

namespace invgrad {
namespace sparse_cholesky_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// A path of n nodes with springs between neighbours, a few long ones, and a
// weak anchor: m = n + n / 10 rows, and a wide spectrum.
SparseJacobian Springs(int n, double anchor) {
  std::vector<Eigen::Triplet<double>> entries;
  int row = 0;
  const auto spring = [&](int a, int b, double stiffness) {
    entries.emplace_back(row, a, -stiffness);
    entries.emplace_back(row, b, stiffness);
    ++row;
  };
  for (int i = 0; i + 1 < n; ++i) spring(i, i + 1, 1.0 + 0.5 * std::sin(i));
  for (int i = 0; i + 7 < n; i += 10) spring(i, i + 7, 0.1);
  entries.emplace_back(row++, 0, anchor);
  SparseJacobian::Matrix J(row, n);
  J.setFromTriplets(entries.begin(), entries.end());
  return SparseJacobian(J);
}

TEST(SparseCholesky, SolvesForEveryShiftAndAnotherJ) {
  SparseCholesky cholesky;
  std::string error;
  for (const double anchor : {1.0, 0.5}) {
    const SparseJacobian J = Springs(50, anchor);
    MatrixXd A;
    J.ToDense(&A);
    ASSERT_TRUE(cholesky.Analyze(J, 0.0, &error)) << error;
    for (const double shift : {1e-3, 1.0, 1e3}) {
      ASSERT_TRUE(cholesky.Factorize(shift, &error)) << error;
      const VectorXd expected = VectorXd::LinSpaced(50, -1.0, 1.0);
      VectorXd x = A.transpose() * (A * expected) + shift * expected;
      cholesky.Solve(x);
      // A condition number of at most 1e4 times some roundings.
      EXPECT_LE((x - expected).norm(), 1e-11 * expected.norm());
    }
  }
  // A path is factorized without fill, but for the long springs.
  EXPECT_LE(cholesky.num_entries(), 6.0 * 50.0);
}

TEST(SparseCholesky, Failures) {
  SparseCholesky cholesky;
  std::string error;
  const SparseJacobian J = Springs(50, 0.0);
  EXPECT_FALSE(cholesky.Analyze(J, 100.0, &error));
  EXPECT_NE(error.find("the limit is"), std::string::npos) << error;
  ASSERT_TRUE(cholesky.Analyze(J, 0.0, &error)) << error;
  // J^T J is singular, and not by rounding alone: a column of zeros.
  SparseJacobian::Matrix zero(3, 2);
  zero.insert(0, 0) = 1.0;
  zero.makeCompressed();
  const SparseJacobian singular(zero);
  ASSERT_TRUE(cholesky.Analyze(singular, 0.0, &error)) << error;
  EXPECT_FALSE(cholesky.Factorize(0.0, &error));
  EXPECT_NE(error.find("not positive definite"), std::string::npos) << error;
  EXPECT_TRUE(cholesky.Factorize(1.0, &error)) << error;
}

}  // namespace sparse_cholesky_test
}  // namespace invgrad
