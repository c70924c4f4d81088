#include "invgrad/internal/linear_projection.h"

#include "Eigen/Dense"
#include "gtest/gtest.h"
#include "invgrad/random.h"

namespace invgrad {
namespace linear_projection_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kRounding = 1e-12;  // 1e-16 times sizes and conditions < 1e3

MatrixXd Random(int rows, int cols) {
  NumpyRandom random(static_cast<std::uint32_t>(100 * rows + cols));
  return random.Rand(rows, cols).array() - 0.5;
}

// Four identities of a pseudo-inverse, and least norm in units of the columns.
void ExpectPseudoInverse(const MatrixXd& Phi, int rank) {
  const LinearProjection projection(Phi, 1e-10);
  EXPECT_EQ(projection.rank(), rank);
  const auto m = static_cast<int>(Phi.rows());
  const MatrixXd inverse = projection.Solve(MatrixXd::Identity(m, m));
  const VectorXd lengths = Phi.colwise().norm();
  const MatrixXd P = projection.Residual(MatrixXd::Identity(m, m));
  EXPECT_LE((Phi * inverse * Phi - Phi).norm(), kRounding);
  EXPECT_LE((inverse * Phi * inverse - inverse).norm(), kRounding);
  EXPECT_LE((P - MatrixXd::Identity(m, m) + Phi * inverse).norm(), kRounding);
  EXPECT_LE((P * P - P).norm() + (P - P.transpose()).norm(), kRounding);
  const MatrixXd scaled = lengths.asDiagonal() * inverse * Phi *
                          lengths.cwiseMax(1e-300).cwiseInverse().asDiagonal();
  EXPECT_LE((scaled - scaled.transpose()).norm(), kRounding);
  const MatrixXd M = Random(static_cast<int>(Phi.cols()), 3);
  EXPECT_LE((projection.SolveTransposed(M) - inverse.transpose() * M).norm(),
            kRounding);
}

TEST(LinearProjection, IsAPseudoInverse) {
  ExpectPseudoInverse(Random(9, 4), 4);
  ExpectPseudoInverse(Random(4, 4), 4);
  ExpectPseudoInverse(Random(3, 7), 3);  // more features than samples
  ExpectPseudoInverse(Random(9, 2) * Random(2, 5), 2);
  ExpectPseudoInverse(Random(1, 1), 1);
}

TEST(LinearProjection, DoesNotDependOnTheUnits) {
  const MatrixXd Phi = Random(9, 2) * Random(2, 4);
  const VectorXd units = Eigen::Vector4d(1e-9, 1.0, 1e9, 1e3);
  const VectorXd b = Random(9, 1);
  const LinearProjection projection(Phi, 1e-10);
  const LinearProjection other(Phi * units.asDiagonal(), 1e-10);
  EXPECT_EQ(other.rank(), 2);
  const VectorXd c = projection.Solve(b);
  EXPECT_LE((units.asDiagonal() * other.Solve(b) - c).norm(),
            kRounding * c.norm());
}

TEST(LinearProjection, OfNothingLeavesEverything) {
  const LinearProjection projection(MatrixXd::Zero(3, 2), 1e-10);
  EXPECT_EQ(projection.rank(), 0);
  const MatrixXd M = Random(3, 2);
  EXPECT_LE((projection.Residual(M) - M).norm(), kRounding);
  EXPECT_EQ(projection.Solve(M).norm(), 0.0);
}

// Columns at an angle of 1e-6 and 1e-14: above and below the threshold.
TEST(LinearProjection, RankAtTheThreshold) {
  MatrixXd Phi(3, 2);
  for (const auto& [angle, rank] : {std::pair(1e-6, 2), std::pair(1e-14, 1)}) {
    Phi << 1.0, 1.0, 0.0, angle, 0.0, 0.0;
    EXPECT_EQ(LinearProjection(Phi, 1e-10).rank(), rank);
  }
}

}  // namespace linear_projection_test
}  // namespace invgrad
