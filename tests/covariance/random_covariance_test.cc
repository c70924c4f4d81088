// The covariance of random problems against a dense pseudo-inverse of J.
#include <algorithm>
#include <cmath>
#include <string>

#include "Eigen/SVD"
#include "gtest/gtest.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/covariance.h"
#include "tests/covariance/random_covariance_problem.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Oracle {
  MatrixXd C;
  int rank = 0;
  VectorXd shares;         // of the null space of J with columns of length one
  double condition = 1.0;  // s_max / the smallest s that is not zero
  double largest_inverse_square = 0.0;  // of the lengths of columns of J
};

Oracle DenseOracle(const ProblemLinearizer& linearizer) {
  Linearization at_x;
  std::string error;
  EXPECT_TRUE(
      linearizer.Linearize(LinearizationParts::Jacobian(), &at_x, &error))
      << error;
  MatrixXd J;
  at_x.jacobian->ToDense(&J);
  Oracle oracle;
  oracle.C = MatrixXd::Zero(J.cols(), J.cols());
  oracle.shares = VectorXd::Ones(J.cols());
  if (J.size() == 0) return oracle;
  const Eigen::JacobiSVD<MatrixXd> svd(J, Eigen::ComputeFullV);
  const VectorXd& s = svd.singularValues();
  const Index rank = (s.array() > 1e-10 * s[0]).count();
  const MatrixXd F =
      svd.matrixV().leftCols(rank) * s.head(rank).cwiseInverse().asDiagonal();
  oracle.C = F * F.transpose();
  for (const double square : J.colwise().squaredNorm()) {
    if (square > 0.0) {
      oracle.largest_inverse_square =
          std::max(oracle.largest_inverse_square, 1.0 / square);
    }
  }
  oracle.rank = static_cast<int>(rank);
  for (auto column : J.colwise()) column.normalize();
  const Eigen::JacobiSVD<MatrixXd> scaled(J, Eigen::ComputeFullV);
  oracle.shares =
      scaled.matrixV().rightCols(J.cols() - rank).rowwise().squaredNorm();
  if (rank > 0) oracle.condition = s[0] / s[rank - 1];
  return oracle;
}

// Every block and every share, by one of the two algorithms.
void ExpectOracle(std::uint32_t seed, int max_dense_size) {
  SCOPED_TRACE("seed " + std::to_string(seed));
  RandomCovarianceProblem random(seed);
  const ceres::Problem& problem = random.problem();
  const ProblemLinearizer linearizer(&problem, {});
  const Oracle oracle = DenseOracle(linearizer);
  // Rank decisions of scaled and unscaled columns differ.
  if (oracle.condition > 1e5) return;

  Covariance::Options options;
  options.rank.max_dense_size = max_dense_size;
  Covariance covariance;
  std::string error;
  ASSERT_TRUE(ComputeCovariance(
      options, problem, AllPairs(random.blocks()), &covariance, &error))
      << error;
  const auto& blocks = linearizer.structure().parameter_blocks;
  EXPECT_EQ(covariance.rank(), oracle.rank);
  // J^T J of the sparse algorithm squares the condition. C is a difference of
  // matrices as large as the squared inverse of the shortest column.
  const double tolerance =
      1e-13 * std::pow(oracle.condition, 2) * (1.0 + oracle.C.norm()) +
      1e-13 * oracle.largest_inverse_square;
  for (const auto& a : blocks) {
    const VectorXd& shares = covariance.block(a.values).undetermined_shares;
    for (int i = 0; i < a.tangent_size; ++i) {
      EXPECT_NEAR(shares[i], oracle.shares[a.column + i], tolerance);
    }
    for (const auto& b : blocks) {
      const MatrixXd C = covariance.TangentBlock(a.values, b.values);
      const MatrixXd expected =
          oracle.C.block(a.column, b.column, a.tangent_size, b.tangent_size);
      EXPECT_LE((C - expected).norm(), tolerance) << C << "\n\n" << expected;
    }
  }
}

TEST(RandomCovariance, DenseAlgorithmEqualsThePseudoInverse) {
  for (std::uint32_t seed = 0; seed < 5000 && !::testing::Test::HasFailure();
       ++seed) {
    ExpectOracle(seed, 300);
  }
}

TEST(RandomCovariance, SparseAlgorithmEqualsThePseudoInverse) {
  for (std::uint32_t seed = 5000;
       seed < 10000 && !::testing::Test::HasFailure();
       ++seed) {
    ExpectOracle(seed, 0);
  }
}

}  // namespace
}  // namespace invgrad
