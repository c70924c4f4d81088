// Hand-eye calibration A X = X B of a vehicle that moves in a plane, such as a
// slope: the height of the camera is open, whatever rounding errors and noise
// the motions have.
#include <cmath>
#include <string>
#include <vector>

#include "Eigen/Geometry"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/rotation.h"
#include "gtest/gtest.h"
#include "invgrad/covariance.h"
#include "invgrad/random.h"
#include "invgrad/rank_report.h"
#include "tests/rank/rank_problems.h"

namespace invgrad {
namespace hand_eye_test {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kHeight = 2;

// R_A R_X - R_X R_B, and R_A t_X + t_A - R_X t_B - t_X. The component kHeight of
// t is counted in `unit`.
struct HandEye {
  template <typename T>
  bool operator()(const T* q, const T* t, T* r) const {
    T matrix[9];
    ceres::AngleAxisToRotationMatrix(q, matrix);
    const Eigen::Map<const Eigen::Matrix<T, 3, 3>> R(matrix);
    Eigen::Matrix<T, 3, 1> t_X(t[0], t[1], t[2]);
    t_X[kHeight] *= unit;
    const Matrix3d R_A = A.linear();
    const Matrix3d R_B = B.linear();
    Eigen::Map<Eigen::Matrix<T, 3, 3>> rotation(r);
    rotation = R_A.cast<T>() * R - R * R_B.cast<T>();
    Eigen::Map<Eigen::Matrix<T, 3, 1>> translation(r + 9);
    const Vector3d t_A = A.translation();
    const Vector3d t_B = B.translation();
    translation = R_A.cast<T>() * t_X + t_A.cast<T>() - R * t_B.cast<T>() - t_X;
    return true;
  }
  Isometry3d A;
  Isometry3d B;
  double unit;
};

class Calibration {
 public:
  Calibration(double noise, double height, double unit) {
    NumpyRandom random(3);
    const Isometry3d slope(AngleAxisd(0.3, Vector3d(0.6, 0.8, 0.0)));
    Isometry3d X(AngleAxisd(0.7, Vector3d(0.2, -0.4, 0.3).normalized()));
    X.translation() << 0.4, -0.2, height;
    std::vector<Isometry3d> poses;
    for (int i = 0; i <= 40; ++i) {
      Isometry3d in_plane(
          AngleAxisd(random.Uniform(-3.0, 3.0), Vector3d::UnitZ()));
      in_plane.translation() << random.Uniform(-50.0, 50.0),
          random.Uniform(-50.0, 50.0), 0.0;
      poses.push_back(slope * in_plane);
    }
    const auto with_noise = [&](const Isometry3d& T) {
      const Vector3d axis = noise * random.Normal(3);
      Isometry3d error = Isometry3d::Identity();
      if (noise > 0.0) {
        error.linear() =
            AngleAxisd(axis.norm(), axis.normalized()).toRotationMatrix();
        error.translation() = noise * random.Normal(3);
      }
      return Isometry3d(T * error);
    };
    angle_axis = 0.7 * Vector3d(0.2, -0.4, 0.3).normalized();
    translation = X.translation();
    translation[kHeight] /= unit;
    for (int i = 0; i < 40; ++i) {
      const Isometry3d A = poses[i].inverse() * poses[i + 1];
      const Isometry3d B = X.inverse() * A * X;
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<HandEye, 12, 3, 3>(
              new HandEye{with_noise(A), with_noise(B), unit}),
          nullptr,
          angle_axis.data(),
          translation.data());
    }
  }

  RankReport::Options Options() const {
    RankReport::Options options;
    options.block_name = [this](const double* block) {
      return block == translation.data() ? "t" : "q";
    };
    return options;
  }

  Vector3d angle_axis;
  Vector3d translation;
  ceres::Problem problem;
};

TEST(HandEye, RoundingErrorsDetermineNoHeight) {
  for (const double height : {1.5, 0.0}) {
    for (const double unit : {1.0, 1e-3, 1e3}) {
      SCOPED_TRACE(testing::Message() << height << " in units of " << unit);
      const Calibration calibration(0.0, height, unit);
      const RankReport report =
          Report(calibration.problem, calibration.Options());
      EXPECT_GT(report.num_residuals, 400);
      EXPECT_EQ(report.rank, 5) << report.ToText();
      ASSERT_EQ(report.unused.size(), 1u);
      EXPECT_EQ(report.unused[0].tangent, std::vector<int>{kHeight});
      EXPECT_TRUE(report.unused[0].has_rounding);
      EXPECT_NE(report.ToText().find("`t`[2]  named by residual blocks, but "
                                     "their derivatives are rounding errors"),
                std::string::npos)
          << report.ToText();
      Covariance covariance;
      std::string error;
      ASSERT_TRUE(ComputeCovariance({},
                                    calibration.problem,
                                    MarginalPairs(calibration.problem),
                                    &covariance,
                                    &error))
          << error;
      EXPECT_EQ(covariance.rank(), 5);
      const auto& t = covariance.block(calibration.translation.data());
      EXPECT_TRUE(std::isinf(t.standard_deviations[kHeight]));
      EXPECT_LT(t.standard_deviations.head<2>().maxCoeff(), 1.0);
    }
  }
}

// A short column of another unit.
TEST(HandEye, AShortColumnOfAnotherUnitIsNoRoundingError) {
  double x[3] = {2.0, 3e9, 5e-9};
  ceres::Problem problem;
  for (int i = 0; i < 5; ++i) {
    AddPrior(Row({1.0 + i, 1e-9 * i * i, 1e9 * (i % 2)}), x, &problem);
  }
  EXPECT_EQ(Report(problem).rank, 3);
  EXPECT_TRUE(Report(problem).unused.empty());
}

TEST(HandEye, NoiseOfTheMotionsIsAShortColumnAndWeakInOneUnit) {
  for (const double noise : {1e-4, 1e-3, 1e-2}) {
    SCOPED_TRACE(noise);
    const Calibration calibration(noise, 1.5, 1.0);
    RankReport::Options options = calibration.Options();
    const RankReport report = Report(calibration.problem, options);
    EXPECT_EQ(report.rank, 6);
    EXPECT_TRUE(report.weak.empty());
    ASSERT_EQ(report.short_columns.size(), 1u);
    EXPECT_EQ(report.short_columns[0].tangent, kHeight);
    EXPECT_NEAR(
        std::log10(report.short_columns[0].relative_length / noise), 0.0, 0.5);
    EXPECT_NE(report.ToText().find("  `t`[2]: "), std::string::npos)
        << report.ToText();
    // With one scale for the position.
    options.group_sizes = [&](const double*) { return std::vector<int>{3}; };
    options.weak_threshold = 5.0 * noise;
    const RankReport in_groups = Report(calibration.problem, options);
    EXPECT_EQ(in_groups.rank, 6);
    EXPECT_TRUE(in_groups.short_columns.empty());
    ASSERT_EQ(in_groups.weak.size(), 1u) << in_groups.ToText();
    const RankReport::Part& part = in_groups.weak[0].parts[0];
    EXPECT_EQ(in_groups.blocks[part.block].name, "t");
    EXPECT_EQ(part.motion[kHeight], 1.0);
    EXPECT_GT(part.share, 0.99);
  }
}

TEST(HandEye, GroupSizesMustFit) {
  const Calibration calibration(0.0, 1.5, 1.0);
  RankReport::Options options = calibration.Options();
  options.group_sizes = [&](const double* block) {
    return block == calibration.translation.data() ? std::vector<int>{2}
                                                   : std::vector<int>();
  };
  RankReport report;
  std::string error;
  EXPECT_FALSE(
      ComputeRankReport(options, calibration.problem, &report, &error));
  EXPECT_EQ(error, "the group_sizes of `t` must be positive and add up to 3");
}

}  // namespace hand_eye_test
}  // namespace invgrad
