#include "invgrad/internal/streaming_gram.h"

#include <cmath>

#include "Eigen/Core"
#include "Eigen/LU"
#include "gtest/gtest.h"
#include "invgrad/core/small_svd.h"
#include "invgrad/internal/small_covariance.h"
#include "invgrad/random.h"

namespace invgrad {
namespace streaming_gram_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// In [-1, 1).
MatrixXd Random(int rows, int cols, NumpyRandom* random) {
  return 2.0 * random->Rand(rows, cols).array() - 1.0;
}

template <int N>
GramRoot<N> RootOf(const MatrixXd& J, const VectorXd& r) {
  StreamingGram<N> gram;
  const MatrixXd rows = J.transpose();
  for (int i = 0; i < J.rows(); ++i) gram.AddRow(rows.col(i).data(), r[i]);
  return gram.Finish();
}

template <int N>
void ExpectRootOf(const MatrixXd& J,
                  const VectorXd& r,
                  const GramRoot<N>& root) {
  // m n epsilon, generously.
  const double tolerance = 1e-12 * (1.0 + J.squaredNorm() + r.squaredNorm());
  EXPECT_EQ(root.num_rows, J.rows());
  const MatrixXd R = root.R;
  EXPECT_EQ((R - MatrixXd(R.triangularView<Eigen::Upper>())).norm(), 0.0);
  EXPECT_LE((R.transpose() * R - J.transpose() * J).norm(), tolerance);
  EXPECT_LE((R.transpose() * root.c - J.transpose() * r).norm(), tolerance);
  EXPECT_NEAR(root.squared_norm(), r.squaredNorm(), tolerance);
  EXPECT_GE(root.rest, 0.0);
}

TEST(StreamingGram, IsTheRootOfTheProducts) {
  NumpyRandom random(1);
  // Around one block and one pack.
  for (const int m : {0, 1, 2, 3, 4, 5, 31, 32, 33, 127, 128, 129, 1000}) {
    const MatrixXd J = Random(m, 4, &random);
    const VectorXd r = Random(m, 1, &random);
    ExpectRootOf(J, r, RootOf<4>(J, r));
    const MatrixXd wide = Random(m, 11, &random);
    ExpectRootOf(wide, r, RootOf<11>(wide, r));
  }
}

// rest = min |r + J step|^2: for a constant, the squares around the mean.
TEST(StreamingGram, RestIsWhatNoStepTakesAway) {
  const VectorXd r = VectorXd::LinSpaced(101, 0.0, 100.0);
  const GramRoot<1> root = RootOf<1>(MatrixXd::Ones(101, 1), r);
  // n (n^2 - 1) / 12 for n = 101 consecutive integers.
  EXPECT_NEAR(root.rest, 101.0 * (101.0 * 101.0 - 1.0) / 12.0, 1e-8);
  EXPECT_NEAR(root.c[0] / root.R(0, 0), 50.0, 1e-12);
}

TEST(StreamingGram, PartsJoin) {
  NumpyRandom random(2);
  const MatrixXd J = Random(300, 5, &random);
  const VectorXd r = Random(300, 1, &random);
  StreamingGram<5> sum;
  sum.Merge(RootOf<5>(J.topRows(170), r.head(170)));
  sum.Merge(RootOf<5>(J.middleRows(170, 2), r.segment(170, 2)));
  const MatrixXd rows = J.transpose();
  for (int i = 172; i < 300; ++i) sum.AddRow(rows.col(i).data(), r[i]);
  ExpectRootOf(J, r, sum.Finish());
  sum.Reset();
  ExpectRootOf<5>(J.topRows(0), r.head(0), sum.Finish());
}

// Columns (1, e, 0, ...) and (1, 0, e, ...): s_min = e, of which J^T J has
// 1 + e^2 = 1 in double precision.
TEST(StreamingGram, KeepsWhatTheProductsLose) {
  const double e = 1e-9;
  MatrixXd J = MatrixXd::Zero(3, 2);
  J << 1.0, 1.0, e, 0.0, 0.0, e;
  const GramRoot<2> root = RootOf<2>(J, VectorXd::Zero(3));
  SmallSvd svd;
  svd.Compute(root.R);
  EXPECT_NEAR(svd.s[1] / e, 1.0, 1e-6);  // epsilon / e
  EXPECT_EQ((J.transpose() * J).determinant(), 0.0);
}

TEST(StreamingGram, NotANumberIsSeen) {
  MatrixXd J = MatrixXd::Ones(40, 2);
  EXPECT_TRUE(RootOf<2>(J, VectorXd::Ones(40)).IsFinite());
  J(35, 1) = std::nan("");
  EXPECT_FALSE(RootOf<2>(J, VectorXd::Ones(40)).IsFinite());
  EXPECT_FALSE(
      RootOf<2>(MatrixXd::Ones(40, 2), VectorXd::Constant(40, std::nan("")))
          .IsFinite());
}

int Rank(const Eigen::Matrix2d& R, double threshold) {
  Eigen::Matrix2d covariance;
  Eigen::Vector2d undetermined;
  return ComputeSmallCovariance<2>(R, threshold, &covariance, &undetermined);
}

// Columns at an angle of t: s^2 = 1 +- cos t, so s_min / s_max = tan(t / 2).
TEST(SmallCovariance, RankAtTheThreshold) {
  for (const double t : {1.0, 1e-2, 1e-4, 1e-6}) {
    Eigen::Matrix2d R;
    R << 1.0, 1e7 * std::cos(t), 0.0, 1e7 * std::sin(t);
    // Rounding of cos t.
    const double relative = 1e-15 / (t * t) + 1e-12;
    EXPECT_EQ(Rank(R, std::tan(t / 2.0) * (1.0 - relative)), 2) << t;
    EXPECT_EQ(Rank(R, std::tan(t / 2.0) * (1.0 + relative)), 1) << t;
  }
}

// Rows (1, 2): the null space is (2, -1) / sqrt(5), and (1, -1) / sqrt(2) of the
// scaled columns.
TEST(SmallCovariance, OneDirectionIsOpen) {
  Eigen::Matrix2d covariance;
  Eigen::Vector2d undetermined;
  Eigen::Matrix2d R;
  R << 3.0, 6.0, 0.0, 0.0;  // of nine rows
  EXPECT_EQ(ComputeSmallCovariance<2>(R, 1e-7, &covariance, &undetermined), 1);
  Eigen::Matrix2d expected;
  expected << 1.0, 2.0, 2.0, 4.0;
  EXPECT_LE((covariance - expected / 225.0).norm(), 1e-16);
  EXPECT_NEAR(undetermined[0], 0.5, 1e-15);
  EXPECT_NEAR(undetermined[1], 0.5, 1e-15);
}

TEST(SmallCovariance, UnusedParameter) {
  Eigen::Matrix3d R;
  R << 2.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 5.0;
  Eigen::Matrix3d covariance;
  Eigen::Vector3d undetermined;
  EXPECT_EQ(ComputeSmallCovariance<3>(R, 1e-7, &covariance, &undetermined), 2);
  EXPECT_NEAR(undetermined[1], 1.0, 1e-15);
  EXPECT_NEAR(undetermined[0], 0.0, 1e-15);
  // The inverse of (4, 2; 2, 26).
  EXPECT_NEAR(covariance(0, 0), 0.26, 1e-15);
  EXPECT_NEAR(covariance(0, 2), -0.02, 1e-15);
  EXPECT_NEAR(covariance(2, 2), 0.04, 1e-15);
  EXPECT_EQ(covariance(1, 1), 0.0);
  R.setZero();
  EXPECT_EQ(ComputeSmallCovariance<3>(R, 1e-7, &covariance, &undetermined), 0);
  EXPECT_EQ(covariance.norm(), 0.0);
  EXPECT_NEAR(undetermined.sum(), 3.0, 1e-14);
}

// Against the definition, and in other units.
TEST(SmallCovariance, PseudoInverseInAnyUnits) {
  NumpyRandom random(3);
  const MatrixXd J = Random(20, 4, &random);
  const VectorXd r = VectorXd::Zero(20);
  const Eigen::Vector4d units(1e-6, 1.0, 1e3, 1e8);
  const auto covariance_of = [&](const MatrixXd& A, int* rank) {
    Eigen::Matrix4d covariance;
    Eigen::Vector4d undetermined;
    *rank = ComputeSmallCovariance<4>(
        RootOf<4>(A, r).R, 1e-7, &covariance, &undetermined);
    return covariance;
  };
  int rank;
  const Eigen::Matrix4d C = covariance_of(J, &rank);
  EXPECT_EQ(rank, 4);
  EXPECT_LE((C * (J.transpose() * J) - Eigen::Matrix4d::Identity()).norm(),
            1e-12);
  const Eigen::Matrix4d in_units = covariance_of(J * units.asDiagonal(), &rank);
  EXPECT_EQ(rank, 4);
  EXPECT_LE((units.asDiagonal() * in_units * units.asDiagonal() - C).norm(),
            1e-13);
  // Of rank 2: the four conditions of Moore and Penrose.
  const MatrixXd low = J.leftCols(2) * Random(2, 4, &random);
  const Eigen::Matrix4d H = low.transpose() * low;
  const Eigen::Matrix4d P = covariance_of(low, &rank);
  EXPECT_EQ(rank, 2);
  EXPECT_LE((H * P * H - H).norm(), 1e-11 * H.norm());
  EXPECT_LE((P * H * P - P).norm(), 1e-11 * P.norm());
  EXPECT_LE((H * P - (H * P).transpose()).norm(), 1e-11);
  covariance_of(low * units.asDiagonal(), &rank);
  EXPECT_EQ(rank, 2);
}

}  // namespace streaming_gram_test
}  // namespace invgrad
