#include "invgrad/output_layer/normal_equations.h"

#include <cmath>
#include <limits>

#include "Eigen/Dense"
#include "gtest/gtest.h"
#include "invgrad/internal/qr.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace normal_equations_test {

using Eigen::MatrixXd;

constexpr int kP = 4;
constexpr int kQ = 3;
constexpr int kM = 30;

NormalEquations::Solution SolutionOf(const MatrixXd& H, const MatrixXd& D) {
  NormalEquations equations(static_cast<int>(H.rows()),
                            static_cast<int>(D.rows()));
  equations.Add(H, D);
  NormalEquations::Solution solution;
  EXPECT_TRUE(equations.Solve(0.0, &solution));
  return solution;
}

// (H H^T + ridge)^-1 H D^T.
MatrixXd RidgeSolution(const MatrixXd& H, const MatrixXd& D, double ridge) {
  MatrixXd G = H * H.transpose();
  G.diagonal().array() += ridge;
  return G.llt().solve(H * D.transpose());
}

// The definition: |residual|^2 / trace(I - hat matrix)^2.
double Gcv(const MatrixXd& H, const MatrixXd& D, double ridge) {
  MatrixXd G = H * H.transpose();
  G.diagonal().array() += ridge;
  const MatrixXd hat = H.transpose() * G.llt().solve(H);
  const double freedom = static_cast<double>(H.cols()) - hat.trace();
  return (D - D * hat).squaredNorm() / (freedom * freedom);
}

// With targets that the features explain but for noise of this size.
struct Noisy {
  explicit Noisy(double noise)
      : H(RandomMatrix(kP, kM, 1)),
        C(RandomMatrix(kP, kQ, 2)),
        D(C.transpose() * H + noise * RandomMatrix(kQ, kM, 3)) {}
  MatrixXd H;
  MatrixXd C;
  MatrixXd D;
};

TEST(NormalEquations, SolveTheRidgeProblemOfTheirRidge) {
  const Noisy data(0.5);
  const NormalEquations::Solution solution = SolutionOf(data.H, data.D);
  ASSERT_GT(solution.ridge, 0.0);
  const MatrixXd Z = RidgeSolution(data.H, data.D, solution.ridge);
  // Rounding of sums of 30 products of numbers of order 1.
  EXPECT_LT((solution.Z - Z).norm(), 1e-12 * Z.norm());
  EXPECT_NEAR(solution.squared_norm, data.D.squaredNorm(), 1e-12);
  EXPECT_NEAR(solution.squared_residual,
              (Z.transpose() * data.H - data.D).squaredNorm(),
              1e-11);
}

TEST(NormalEquations, TheRidgeHasTheLowestGcvOfItsNeighbours) {
  for (const double noise : {0.1, 1.0, 3.0}) {
    const Noisy data(noise);
    const double ridge = SolutionOf(data.H, data.D).ridge;
    const double gcv = Gcv(data.H, data.D, ridge);
    for (const double factor : {0.125, 0.25, 0.5, 2.0, 4.0, 8.0}) {
      // But for rounding where GCV is flat.
      EXPECT_LE(gcv, Gcv(data.H, data.D, factor * ridge) * (1.0 + 1e-12))
          << "noise " << noise << ", factor " << factor;
    }
  }
}

TEST(NormalEquations, ExactTargetsAreFitted) {
  const Noisy data(0.0);
  const NormalEquations::Solution solution = SolutionOf(data.H, data.D);
  // The square root of the resolution 4 eps, times the condition, at most 10.
  EXPECT_LT((solution.Z - data.C).norm(), 1e-7 * data.C.norm());
}

TEST(NormalEquations, TargetsWithoutASignalAreNotFitted) {
  const MatrixXd H = RandomMatrix(kP, 400, 4);
  const MatrixXd D = RandomMatrix(kQ, 400, 5);
  const NormalEquations::Solution solution = SolutionOf(H, D);
  const MatrixXd without_ridge = RidgeSolution(H, D, 0.0);
  EXPECT_LT(solution.Z.norm(), 0.5 * without_ridge.norm());
}

TEST(NormalEquations, BlocksAreTheWhole) {
  const Noisy data(0.3);
  NormalEquations equations(kP, kQ);
  equations.Add(data.H.leftCols(7), data.D.leftCols(7));
  equations.Add(data.H.rightCols(kM - 7), data.D.rightCols(kM - 7));
  NormalEquations::Solution solution;
  ASSERT_TRUE(equations.Solve(0.0, &solution));
  const NormalEquations::Solution whole = SolutionOf(data.H, data.D);
  EXPECT_NEAR(solution.ridge, whole.ridge, 1e-12);
  EXPECT_LT((solution.Z - whole.Z).norm(), 1e-12 * whole.Z.norm());
}

TEST(NormalEquations, AnOrthogonalRecombinationOfFeaturesKeepsTheFit) {
  const Noisy data(0.3);
  const MatrixXd Q = Orthonormalized(RandomMatrix(kP, kP, 6));
  const NormalEquations::Solution solution = SolutionOf(data.H, data.D);
  const NormalEquations::Solution turned = SolutionOf(Q * data.H, data.D);
  EXPECT_LT((turned.Z - Q * solution.Z).norm(), 1e-12);
}

TEST(NormalEquations, FeaturesThatDependOnEachOtherGiveTheLeastNorm) {
  MatrixXd H = RandomMatrix(kP, kM, 7);
  H.row(3) = H.row(0) + H.row(1);
  const MatrixXd D = RandomMatrix(kP, kQ, 8).transpose() * H;
  const NormalEquations::Solution solution = SolutionOf(H, D);
  EXPECT_LT((solution.Z.transpose() * H - D).norm(), 1e-6 * D.norm());
  // Orthogonal to the null space (1, 1, 0, -1).
  const Eigen::RowVectorXd along =
      solution.Z.row(0) + solution.Z.row(1) - solution.Z.row(3);
  EXPECT_LT(along.norm(), 1e-6 * solution.Z.norm());
}

TEST(NormalEquations, MoreFeaturesThanEquations) {
  const MatrixXd H = RandomMatrix(12, 5, 9);
  const MatrixXd D = RandomMatrix(kQ, 5, 10);
  const NormalEquations::Solution solution = SolutionOf(H, D);
  EXPECT_TRUE(solution.Z.allFinite());
  EXPECT_LE(solution.squared_residual, solution.squared_norm);
  EXPECT_NEAR(solution.squared_residual,
              (solution.Z.transpose() * H - D).squaredNorm(),
              1e-9);
}

TEST(NormalEquations, TheLeastRidgeIsAFractionOfTheLargestEigenvalue) {
  const Noisy data(0.0);
  NormalEquations equations(kP, kQ);
  equations.Add(data.H, data.D);
  NormalEquations::Solution solution;
  ASSERT_TRUE(equations.Solve(0.25, &solution));
  const MatrixXd G = data.H * data.H.transpose();
  const double l_max =
      Eigen::SelfAdjointEigenSolver<MatrixXd>(G).eigenvalues()[kP - 1];
  // The grid has the factor 2.
  EXPECT_GE(solution.ridge, 0.25 * l_max * (1.0 - 1e-12));
  EXPECT_LE(solution.ridge, 0.5 * l_max * (1.0 + 1e-12));
}

TEST(NormalEquations, AnotherOriginIsAnotherTarget) {
  const Noisy data(0.3);
  const MatrixXd C = RandomMatrix(kP, kQ, 13);
  NormalEquations moved(kP, kQ);
  moved.Add(data.H, data.D - C.transpose() * data.H);
  moved.MoveOrigin(C);
  NormalEquations::Solution solution;
  ASSERT_TRUE(moved.Solve(0.0, &solution));
  const NormalEquations::Solution expected = SolutionOf(data.H, data.D);
  EXPECT_LT((solution.Z - expected.Z).norm(), 1e-12);
  EXPECT_NEAR(solution.squared_norm, expected.squared_norm, 1e-11);
}

TEST(NormalEquations, NothingToFit) {
  const MatrixXd D = RandomMatrix(kQ, kM, 11);
  EXPECT_EQ(SolutionOf(MatrixXd::Zero(kP, kM), D).Z.norm(), 0.0);
  EXPECT_EQ(
      SolutionOf(RandomMatrix(kP, kM, 12), MatrixXd::Zero(kQ, kM)).Z.norm(),
      0.0);
  NormalEquations equations(kP, kQ);
  NormalEquations::Solution solution;
  EXPECT_TRUE(equations.Solve(0.0, &solution));
  EXPECT_EQ(solution.Z.norm(), 0.0);
}

TEST(NormalEquations, ValuesThatAreNotFiniteFail) {
  for (const double bad : {std::nan(""),
                           std::numeric_limits<double>::infinity(),
                           std::numeric_limits<double>::max()}) {
    for (const bool in_features : {true, false}) {
      Noisy data(0.1);
      (in_features ? data.H : data.D)(1, 2) = bad;
      NormalEquations equations(kP, kQ);
      equations.Add(data.H, data.D);
      NormalEquations::Solution solution;
      EXPECT_FALSE(equations.Solve(0.0, &solution)) << bad;
    }
  }
}

}  // namespace normal_equations_test
}  // namespace invgrad
