#include <cmath>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/equation_points.h"

namespace invgrad {
namespace points_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;

TEST(GaussRule, IntegratesPolynomialsExactly) {
  for (const int count : {1, 2, 5, 64}) {
    const QuadraturePoints rule = GaussRule(count);
    EXPECT_GT(rule.weights.minCoeff(), 0.0);
    for (const int degree : {0, 1, 2 * count - 1}) {
      const double integral =
          rule.points.row(0).array().pow(degree).matrix().dot(rule.weights);
      EXPECT_NEAR(integral, 1.0 / (degree + 1), 1e-14) << count;
    }
  }
}

const Box kBox = {Vector2d(0.0, -1.0), Vector2d(2.0, 1.0)};

TEST(Points, LieInTheBoxAndIntegrate) {
  // The mean of t x^2 is 1/3.
  for (const QuadraturePoints& points :
       {GaussPoints(kBox, {2, 3}), SequencePoints(kBox, 4096, 0)}) {
    EXPECT_NEAR(points.weights.sum(), 1.0, 1e-13);
    const auto t = points.points.row(0).array();
    const auto x = points.points.row(1).array();
    EXPECT_TRUE((t > 0.0).all() && (t < 2.0).all());
    EXPECT_TRUE((x > -1.0).all() && (x < 1.0).all());
    const double mean = (t * x.square()).matrix().dot(points.weights);
    // Of random points the error would be 7e-3.
    EXPECT_NEAR(mean, 1.0 / 3.0, points.weights.size() > 6 ? 1e-3 : 1e-14);
  }
}

TEST(SequencePoints, ContinuesTheSequence) {
  const MatrixXd all = SequencePoints(kBox, 10, 0).points;
  EXPECT_EQ(SequencePoints(kBox, 4, 6).points, MatrixXd(all.rightCols(4)));
}

TEST(GridPoints, HasTheCorners) {
  const MatrixXd grid = GridPoints(kBox, {2, 3});
  MatrixXd expected(2, 6);
  expected << 0, 0, 0, 2, 2, 2, -1, 0, 1, -1, 0, 1;
  EXPECT_EQ(grid, expected);
}

TEST(GaussTimesPeriodic, IntegratesWaves) {
  const QuadraturePoints points =
      GaussTimesPeriodic({Vector2d(0.0, -1.0), Vector2d(1.0, 1.0)}, 3, 8);
  const auto t = points.points.row(0).array();
  const auto x = points.points.row(1).array();
  EXPECT_NEAR(points.weights.sum(), 1.0, 1e-14);
  EXPECT_NEAR(
      (t * (3.0 * M_PI * x).cos().square()).matrix().dot(points.weights),
      0.25,
      1e-14);
}

TEST(GaussPanels, IntegratePiecewisePolynomialsExactly) {
  // |x|^3 has a kink in its third derivative at an end of a panel.
  const QuadraturePoints rule = GaussPanels({-1.0, 0.0, 3.0}, {2, 4});
  EXPECT_NEAR(rule.weights.sum(), 1.0, 1e-15);
  const double mean =
      rule.points.row(0).array().abs().cube().matrix().dot(rule.weights);
  EXPECT_NEAR(mean, (0.25 + 81.0 / 4.0) / 4.0, 1e-14);
}

TEST(FacePoints, LieOnTheFacesOfTheirCoordinates) {
  const Box box = {Eigen::Vector3d(0.0, -1.0, 2.0),
                   Eigen::Vector3d(1.0, 1.0, 3.0)};
  const QuadraturePoints faces = FacePoints(box, 1, 5);
  ASSERT_EQ(faces.points.cols(), 4 * 5);
  EXPECT_NEAR(faces.weights.sum(), 1.0, 1e-14);
  for (Eigen::Index s = 0; s < faces.points.cols(); ++s) {
    int num_on_face = 0;
    for (int i = 0; i < 3; ++i) {
      const double value = faces.points(i, s);
      EXPECT_GE(value, box.lower[i]);
      EXPECT_LE(value, box.upper[i]);
      num_on_face += value == box.lower[i] || value == box.upper[i] ? 1 : 0;
    }
    EXPECT_EQ(num_on_face, 1);
  }
}

TEST(PointsDeathTest, NeedACountForEachCoordinate) {
  EXPECT_DEATH(GaussPoints(kBox, {2}), "GaussPoints: one count a coordinate");
  EXPECT_DEATH(GridPoints(kBox, {2}), "GridPoints: one count a coordinate");
  EXPECT_DEATH(FacePoints(kBox, -1, 2), "first = -1; allowed: 0 to 1");
}

}  // namespace points_test
}  // namespace invgrad
