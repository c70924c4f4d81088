#include <cmath>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/trial_function.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace features_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

const Box kBox = {Vector2d(0.0, -1.0), Vector2d(4.0, 2.0)};

// Values of the features at points.
MatrixXd At(const Features& features, const MatrixXd& points) {
  return JetsOf(
      DerivativeSet("tx", {}), features.size, features.function, points);
}

TEST(Features, ScaleTheBoxToMinusOneAndOne) {
  const MatrixXd corners = GridPoints(kBox, {2, 2});
  MatrixXd expected(2, 4);
  expected << -1, -1, 1, 1, -1, 1, -1, 1;
  EXPECT_EQ(At(ScaledFeatures(kBox), corners), expected);
}

TEST(Features, ArePeriodicWithAllDerivatives) {
  const Features features = PeriodicFeatures(kBox, 1, 3.0, 2);
  ASSERT_EQ(features.size, 5);
  const DerivativeSet set("tx", {"xxxx"});
  const MatrixXd at =
      JetsOf(set, features.size, features.function, Vector2d(1.0, -0.7));
  const MatrixXd later =
      JetsOf(set, features.size, features.function, Vector2d(1.0, 2.3));
  EXPECT_LT((at - later).norm(), 1e-11 * at.norm());
  // t, then cos, sin of one and of two waves.
  const double angle = 2.0 * M_PI / 3.0 * 0.3;
  EXPECT_NEAR(at(0), -0.5, 1e-15);
  EXPECT_NEAR(at(1), std::cos(angle), 1e-15);
  EXPECT_NEAR(at(4), std::sin(2.0 * angle), 1e-15);
}

TEST(Features, FourierAreWavesAlongTheFrequencies) {
  const MatrixXd frequencies = RandomMatrix(3, 2, 1);
  const MatrixXd points = RandomMatrix(2, 4, 2);
  const MatrixXd features = At(FourierFeatures(frequencies), points);
  const MatrixXd angles = frequencies * points;
  EXPECT_LT((features.topRows(3) - MatrixXd(angles.array().cos())).norm(),
            1e-14);
  EXPECT_LT((features.bottomRows(3) - MatrixXd(angles.array().sin())).norm(),
            1e-14);
}

}  // namespace features_test
}  // namespace invgrad
