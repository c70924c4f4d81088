#include "invgrad/internal/blas.h"

#include <limits>

#include "Eigen/Core"
#include "gtest/gtest.h"

namespace invgrad {
namespace blas_test {

using Eigen::MatrixXd;

// Small integers: the products are exact.
MatrixXd Integers(int rows, int cols, int seed) {
  return MatrixXd::NullaryExpr(
      rows, cols, [seed](Eigen::Index i, Eigen::Index j) {
        return static_cast<double>((seed + 7 * i + 5 * j) % 11 - 5);
      });
}

TEST(GemmTest, IsEigensProductForEveryTransposition) {
  const MatrixXd A = Integers(3, 4, 1);
  const MatrixXd B = Integers(4, 5, 2);
  const MatrixXd At = A.transpose();
  const MatrixXd Bt = B.transpose();
  const MatrixXd C = Integers(3, 5, 3);
  const MatrixXd expected = 2.0 * A * B - 3.0 * C;
  for (const Op op_A : {Op::kNone, Op::kTranspose}) {
    for (const Op op_B : {Op::kNone, Op::kTranspose}) {
      MatrixXd result = C;
      Gemm(op_A,
           op_B,
           2.0,
           op_A == Op::kNone ? A : At,
           op_B == Op::kNone ? B : Bt,
           -3.0,
           result);
      EXPECT_EQ(result, expected);
    }
  }
}

TEST(GemmTest, TakesBlocksInPlace) {
  MatrixXd A = Integers(6, 7, 1);
  MatrixXd C = MatrixXd::Constant(5, 5, 9.0);
  Gemm(Op::kNone,
       Op::kTranspose,
       1.0,
       A.block(1, 2, 3, 4),
       A.block(2, 1, 2, 4),
       0.0,
       C.block(1, 2, 3, 2));
  MatrixXd expected = MatrixXd::Constant(5, 5, 9.0);
  expected.block(1, 2, 3, 2) =
      A.block(1, 2, 3, 4) * A.block(2, 1, 2, 4).transpose();
  EXPECT_EQ(C, expected);
}

TEST(GemmTest, ZeroBetaOverwritesNan) {
  MatrixXd C =
      MatrixXd::Constant(2, 2, std::numeric_limits<double>::quiet_NaN());
  const MatrixXd A = Integers(2, 3, 4);
  Gemm(Op::kNone, Op::kTranspose, 1.0, A, A, 0.0, C);
  EXPECT_EQ(C, A * A.transpose());
}

TEST(GemmTest, EmptySumIsZero) {
  MatrixXd C = MatrixXd::Ones(2, 3);
  Gemm(Op::kNone, Op::kNone, 1.0, MatrixXd(2, 0), MatrixXd(0, 3), 0.0, C);
  EXPECT_EQ(C, MatrixXd::Zero(2, 3));
}

TEST(GemvTest, IsEigensProductForEveryTransposition) {
  const MatrixXd A = Integers(3, 4, 1);
  const MatrixXd At = A.transpose();
  const Eigen::VectorXd x = Integers(4, 1, 2);
  const Eigen::VectorXd y = Integers(3, 1, 3);
  const Eigen::VectorXd expected = 2.0 * A * x - 3.0 * y;
  Eigen::VectorXd result = y;
  Gemv(Op::kNone, 2.0, A, x, -3.0, result);
  EXPECT_EQ(result, expected);
  result = y;
  Gemv(Op::kTranspose, 2.0, At, x, -3.0, result);
  EXPECT_EQ(result, expected);
}

TEST(GemvTest, ZeroBetaOverwritesNanAlsoWithBlocks) {
  const MatrixXd A = Integers(6, 7, 4);
  Eigen::VectorXd y =
      Eigen::VectorXd::Constant(2, std::numeric_limits<double>::quiet_NaN());
  Gemv(Op::kNone, 1.0, A.block(1, 2, 2, 3), A.col(0).head(3), 0.0, y);
  EXPECT_EQ(y, A.block(1, 2, 2, 3) * A.col(0).head(3));
}

TEST(GemmDeathTest, RefusesSizesThatDoNotFit) {
  // OpenBLAS has threads of its own.
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  MatrixXd C(2, 2);
  EXPECT_DEATH(Gemm(Op::kNone,
                    Op::kNone,
                    1.0,
                    MatrixXd::Zero(2, 3),
                    MatrixXd::Zero(2, 2),
                    0.0,
                    C),
               "Check failed");
}

TEST(SyrkTest, WritesTheLowerTriangleOnly) {
  const MatrixXd A = Integers(4, 3, 5);
  MatrixXd C = MatrixXd::Constant(3, 3, 7.0);
  Syrk(Op::kTranspose, 1.0, A, 0.0, C);
  const MatrixXd expected = A.transpose() * A;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      EXPECT_EQ(C(i, j), j > i ? 7.0 : expected(i, j));
    }
  }
}

}  // namespace blas_test
}  // namespace invgrad
