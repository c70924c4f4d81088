#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "Eigen/Dense"
#include "gtest/gtest.h"
#include "invgrad/rules/block_gram.h"
#include "invgrad/rules/damped_normal_equations.h"
#include "invgrad/stored_jacobian.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace sparse_normal_equations_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Residual blocks of `rows` rows, each with the given column blocks.
MatrixXd BlockMatrix(const std::vector<int>& sizes,
                     const std::vector<std::vector<int>>& residual_blocks,
                     int rows) {
  std::vector<int> columns = {0};
  for (const int size : sizes) columns.push_back(columns.back() + size);
  MatrixXd J = MatrixXd::Zero(rows * static_cast<int>(residual_blocks.size()),
                              columns.back());
  int seed = 1;
  for (std::size_t k = 0; k < residual_blocks.size(); ++k) {
    for (const int block : residual_blocks[k]) {
      J.block(rows * static_cast<int>(k), columns[block], rows, sizes[block]) =
          RandomMatrix(rows, sizes[block], seed++);
    }
  }
  return J;
}

SparseJacobian Sparse(const MatrixXd& J, std::vector<int> sizes) {
  return SparseJacobian(SparseJacobian::Matrix(J.sparseView()),
                        std::move(sizes));
}

VectorXd Reference(const MatrixXd& J,
                   double c,
                   double lambda,
                   const VectorXd& w) {
  MatrixXd A = c * J.transpose() * J;
  for (int i = 0; i < A.rows(); ++i) {
    A(i, i) = A(i, i) > 0.0 ? (1.0 + lambda) * A(i, i) : 1.0;
  }
  return A.llt().solve(J.transpose() * w);
}

void ExpectSolves(const MatrixXd& J,
                  const SparseJacobian& sparse,
                  DampedNormalEquations* equations) {
  std::string error;
  const double c = 0.7;
  ASSERT_TRUE(equations->SetJacobian(sparse, c, &error)) << error;
  EXPECT_NEAR(equations->Norm(), J.norm(), 1e-13 * J.norm());
  for (const double lambda : {1e-6, 0.3, 1e3}) {
    ASSERT_TRUE(equations->Factorize(lambda));
    for (int seed = 1; seed < 3; ++seed) {
      const VectorXd w = RandomMatrix(static_cast<int>(J.rows()), 1, seed);
      const VectorXd expected = Reference(J, c, lambda, w);
      // The condition of A is at most about 1e3 / lambda there.
      EXPECT_LT((equations->Solve(w) - expected).norm(),
                1e-8 * expected.norm());
    }
  }
}

// Poses in a ring with a chord: no four fifths are independent.
const std::vector<int> kPoses = {3, 3, 2, 3, 3, 3};
const std::vector<std::vector<int>> kEdges = {
    {0, 1}, {1, 2}, {2, 3}, {3, 4}, {4, 5}, {0, 5}, {1, 4}};

// Two cameras, nine points, one of them seen once; blocks in another order.
const std::vector<int> kScene = {3, 5, 3, 3, 3, 3, 5, 3, 3, 3, 3};
const std::vector<std::vector<int>> kObservations = {{0, 1},
                                                     {0, 6},
                                                     {1, 2},
                                                     {2, 6},
                                                     {1, 3},
                                                     {3, 6},
                                                     {1, 4},
                                                     {4, 6},
                                                     {1, 5},
                                                     {5, 6},
                                                     {6, 7},
                                                     {1, 7},
                                                     {6, 8},
                                                     {1, 8},
                                                     {1, 9},
                                                     {6, 9},
                                                     {6, 10}};

TEST(SparseNormalEquations, SolveAsADenseDecomposition) {
  const MatrixXd poses = BlockMatrix(kPoses, kEdges, 3);
  const MatrixXd scene = BlockMatrix(kScene, kObservations, 2);
  const auto equations = MakeSparseNormalEquations();
  ExpectSolves(poses, Sparse(poses, kPoses), equations.get());
  ExpectSolves(scene, Sparse(scene, kScene), equations.get());
  // Without blocks, and again with the first pattern.
  ExpectSolves(scene, Sparse(scene, {}), equations.get());
  ExpectSolves(poses, Sparse(poses, kPoses), equations.get());
}

TEST(SparseNormalEquations, PointsOfASceneAreIndependent) {
  std::string error;
  BlockGram gram;
  const MatrixXd scene = BlockMatrix(kScene, kObservations, 2);
  ASSERT_TRUE(gram.Analyze(Sparse(scene, kScene), &error)) << error;
  // 27 of 37 columns are points: too few.
  EXPECT_EQ(gram.num_independent(), 0);

  std::vector<int> sizes(30, 3);
  sizes[4] = 5;
  std::vector<std::vector<int>> observations;
  for (int p = 0; p < 30; ++p) {
    if (p != 4) observations.push_back({4, p});
  }
  const MatrixXd larger = BlockMatrix(sizes, observations, 2);
  ASSERT_TRUE(gram.Analyze(Sparse(larger, sizes), &error)) << error;
  EXPECT_EQ(gram.num_independent(), 29);
  EXPECT_EQ(gram.blocks().back().column, 12);
  EXPECT_EQ(gram.blocks().back().height, 5);
  EXPECT_EQ(gram.blocks().front().height, 8);

  const auto equations = MakeSparseNormalEquations();
  ExpectSolves(larger, Sparse(larger, sizes), equations.get());
}

// All blocks are independent: nothing is left for CHOLMOD.
TEST(SparseNormalEquations, SeparateProblems) {
  const std::vector<int> sizes = {2, 3, 1};
  const MatrixXd J = BlockMatrix(sizes, {{0}, {1}, {2}, {1}}, 4);
  const auto equations = MakeSparseNormalEquations();
  ExpectSolves(J, Sparse(J, sizes), equations.get());
}

// A row with entries in a part of a block: columns are blocks then.
TEST(SparseNormalEquations, PartsOfBlocks) {
  MatrixXd J = BlockMatrix(kPoses, kEdges, 3);
  J(4, 3) = 0.0;
  const auto equations = MakeSparseNormalEquations();
  ExpectSolves(J, Sparse(J, kPoses), equations.get());
}

// A parameter without effect stays where it is.
TEST(SparseNormalEquations, AColumnOfZerosHasNoStep) {
  MatrixXd J = BlockMatrix(kPoses, kEdges, 3);
  SparseJacobian sparse = Sparse(J, kPoses);
  for (int row = 0; row < J.rows(); ++row) {
    if (J(row, 7) != 0.0) sparse.mutable_matrix()->coeffRef(row, 7) = 0.0;
  }
  J.col(7).setZero();
  const auto equations = MakeSparseNormalEquations();
  ExpectSolves(J, sparse, equations.get());
  EXPECT_EQ(equations->Solve(VectorXd::Ones(J.rows()))[7], 0.0);
}

// x_i -> s_i x_i leaves the step as it is in the old units.
TEST(SparseNormalEquations, StepsDoNotDependOnUnits) {
  const MatrixXd J = BlockMatrix(kPoses, kEdges, 3);
  MatrixXd scaled = J;
  VectorXd units(J.cols());
  for (int i = 0; i < J.cols(); ++i) {
    units[i] = std::pow(10.0, i % 9 - 4);
    scaled.col(i) *= units[i];
  }
  const VectorXd w = RandomMatrix(static_cast<int>(J.rows()), 1, 3);
  std::string error;
  const auto equations = MakeSparseNormalEquations();
  const SparseJacobian sparse = Sparse(J, kPoses);
  ASSERT_TRUE(equations->SetJacobian(sparse, 1.0, &error));
  ASSERT_TRUE(equations->Factorize(1e-2));
  const VectorXd x = equations->Solve(w);
  const SparseJacobian sparse_scaled = Sparse(scaled, kPoses);
  ASSERT_TRUE(equations->SetJacobian(sparse_scaled, 1.0, &error));
  ASSERT_TRUE(equations->Factorize(1e-2));
  const VectorXd y = units.cwiseProduct(equations->Solve(w));
  EXPECT_LT((y - x).norm(), 1e-11 * x.norm());
}

TEST(SparseNormalEquations, BendsAreShortenedBlockByBlock) {
  const MatrixXd J = BlockMatrix(kPoses, kEdges, 3);
  const SparseJacobian sparse = Sparse(J, kPoses);
  std::string error;
  const auto equations = MakeSparseNormalEquations();
  ASSERT_TRUE(equations->SetJacobian(sparse, 1.0, &error));
  const VectorXd v = VectorXd::Ones(J.cols());
  VectorXd bend = VectorXd::Constant(J.cols(), 0.1);
  bend.segment(3, 3).setConstant(75.0);
  ASSERT_TRUE(equations->LimitBend(v, &bend));
  for (int i = 0; i < bend.size(); ++i) {
    EXPECT_NEAR(bend[i], i >= 3 && i < 6 ? 0.375 : 0.1, 1e-14);
  }
}

TEST(SparseNormalEquations, AnEntryThatIsNotFiniteIsAnError) {
  const MatrixXd J = BlockMatrix(kPoses, kEdges, 3);
  SparseJacobian sparse = Sparse(J, kPoses);
  sparse.mutable_matrix()->valuePtr()[5] =
      std::numeric_limits<double>::quiet_NaN();
  std::string error;
  const auto equations = MakeSparseNormalEquations();
  EXPECT_FALSE(equations->SetJacobian(sparse, 1.0, &error));
  EXPECT_EQ(error, "the Jacobian is not finite");
  ExpectSolves(J, Sparse(J, kPoses), equations.get());
}

}  // namespace sparse_normal_equations_test
}  // namespace invgrad
