// Short columns of J: of rounding errors, and of parameters of other units.
#include <cmath>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "gtest/gtest.h"
#include "invgrad/covariance.h"
#include "invgrad/rank_report.h"
#include "tests/rank/rank_problems.h"

namespace invgrad {
namespace rounding_columns_test {

using Eigen::Vector4d;

// A cubic in seconds at x. Its J does not depend on x.
struct Cubic {
  Cubic(double begin, double end, bool is_one_block, const Vector4d& at)
      : x(at) {
    constexpr int kSize = 100;
    Eigen::MatrixXd rows(kSize, 4);
    for (int i = 0; i < kSize; ++i) {
      const double t = begin + (end - begin) * i / kSize;
      rows.row(i) << 1.0, t, t * t, t * t * t;
    }
    const int step = is_one_block ? kSize : 1;
    for (int i = 0; i < kSize; i += step) {
      AddPrior(rows.middleRows(i, step), x.data(), &problem);
    }
  }

  Vector4d x;
  ceres::Problem problem;
};

Vector4d Deviations(const Cubic& cubic) {
  Covariance covariance;
  std::string error;
  EXPECT_TRUE(ComputeCovariance(
      {}, cubic.problem, MarginalPairs(cubic.problem), &covariance, &error))
      << error;
  EXPECT_EQ(covariance.rank(), 4);
  return covariance.block(cubic.x.data()).standard_deviations;
}

constexpr double kDay = 86400.0;

// At ones, too, the effect of the constant is 1e-14 of another one.
TEST(RoundingColumns, TheConstantOfACubicIsNone) {
  for (const bool is_one_block : {false, true}) {
    const Vector4d expected = Deviations(
        Cubic(0.0, kDay, is_one_block, Vector4d(1.0, 1e-4, 1e-9, 1e-13)));
    for (const Vector4d& x : {Vector4d(0.0, 0.0, 0.0, 0.0),
                              Vector4d(0.0, 1e-5, 0.0, 0.0),
                              Vector4d(0.0, 1.0, 1.0, 1.0),
                              Vector4d(1.0, 1.0, 1.0, 1.0)}) {
      SCOPED_TRACE(testing::Message() << x.transpose() << " " << is_one_block);
      const Cubic cubic(0.0, kDay, is_one_block, x);
      const RankReport report = Report(cubic.problem);
      EXPECT_EQ(report.rank, 4) << report.ToText();
      EXPECT_TRUE(report.unused.empty()) << report.ToText();
      EXPECT_LE((Deviations(cubic) - expected).cwiseQuotient(expected).norm(),
                1e-9);
    }
  }
}

// Every row has a constant that is 1e-27 of its largest entry.
TEST(RoundingColumns, OfAStartAtZeroThereAreNone) {
  const double begin = 1e9;
  const Cubic cubic(begin, 2.0 * begin, false, Vector4d::Zero());
  EXPECT_EQ(Report(cubic.problem).rank, 4);
}

TEST(RoundingColumns, TheCovarianceSaysWhatItDoesNotCount) {
  Eigen::Vector3d x(0.0, 1.0, 2.0);
  ceres::Problem problem;
  for (int i = 0; i < 5; ++i) {
    AddPrior(Row({1e-16 * (1 + i % 2), 1.0, 1.0 * i}), x.data(), &problem);
  }
  Covariance covariance;
  std::string error;
  ASSERT_TRUE(ComputeCovariance(
      {}, problem, MarginalPairs(problem), &covariance, &error))
      << error;
  EXPECT_EQ(covariance.rank(), 2);
  EXPECT_EQ(covariance.block(x.data()).rounding, std::vector<int>{0});
  EXPECT_NE(covariance.ToText().find(
                "not determined (derivatives are 0 or rounding errors)"),
            std::string::npos)
      << covariance.ToText();
}

// Directions of a rotation have no values, but one unit.
TEST(RoundingColumns, ARotationHasThem) {
  const double angle = 0.1;
  double q[] = {std::cos(angle), 0.0, 0.0, std::sin(angle)};
  const ceres::QuaternionManifold manifold;
  Eigen::Matrix<double, 4, 3, Eigen::RowMajor> P;
  ASSERT_TRUE(manifold.PlusJacobian(q, P.data()));
  ceres::Problem problem;
  // P has orthogonal columns of length one.
  const Eigen::Vector3d tangent[] = {{1.0, 2.0, 1e-16}, {2.0, -1.0, 3e-16}};
  for (const Eigen::Vector3d& row : tangent) {
    AddPrior((P * row).transpose(), q, &problem);
  }
  problem.SetManifold(q, new ceres::QuaternionManifold);
  const RankReport report = Report(problem);
  EXPECT_EQ(report.blocks[0].components, std::vector<int>(3, -1));
  EXPECT_EQ(report.rank, 2);
  ASSERT_EQ(report.unused.size(), 1u) << report.ToText();
  EXPECT_EQ(report.unused[0].tangent, std::vector<int>{2});
  EXPECT_TRUE(report.unused[0].has_rounding);
}

}  // namespace rounding_columns_test
}  // namespace invgrad
