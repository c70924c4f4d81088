// Gauge freedoms of pose graphs, reconstructions and of a user's own.
#include <array>
#include <string>
#include <utility>
#include <vector>

#include "ceres/covariance.h"
#include "gtest/gtest.h"
#include "invgrad/rank_report.h"
#include "tests/rank/rank_problems.h"

namespace invgrad {
namespace rank_report_gauge_test {

using Eigen::MatrixXd;

TEST(RankReport, PoseGraphInThePlaneHasThreeFreedoms) {
  ceres::Problem problem;
  Graph2 graph(40, 1.0, &problem);
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.num_undetermined(), 3);
  ASSERT_EQ(report.gauges.size(), 1u);
  EXPECT_EQ(report.gauges[0].name, "rigid motion in the plane");
  EXPECT_EQ(report.gauges[0].num_generators, 3);
  EXPECT_EQ(report.undetermined[0].generator, "translation x");
  EXPECT_EQ(report.undetermined[2].generator, "rotation");
  EXPECT_EQ(report.undetermined[2].parts.size(), 40u);
  ASSERT_EQ(report.suggestions.size(), 1u);
  EXPECT_EQ(report.suggestions[0].block, 0);
  EXPECT_TRUE(report.suggestions[0].whole_block);
  EXPECT_EQ(report.suggestions[0].num_removed, 3);

  problem.SetParameterBlockConstant(graph.poses[0].data());
  EXPECT_EQ(Report(problem).num_undetermined(), 0);
}

// The angle in nanoradians: the same conclusions, although J itself has columns
// that differ by a factor of 1e9.
TEST(RankReport, UnitsOfAParameterDoNotMatter) {
  ceres::Problem problem;
  ceres::Problem scaled_problem;
  Graph2 graph(20, 1.0, &problem);
  Graph2 scaled_graph(20, 1e9, &scaled_problem);
  const RankReport report = Report(problem);
  const RankReport scaled = Report(scaled_problem);
  EXPECT_EQ(scaled.num_undetermined(), 3);
  // The same matrix but for rounding.
  EXPECT_LE((report.singular_values - scaled.singular_values)
                .lpNorm<Eigen::Infinity>(),
            1e-12);
  // What ceres::Covariance does not see.
  EXPECT_GT((scaled.unscaled_singular_values.array() <= 1e-7).count(), 3);
  // Only names of rotations in other units are lost: the built-in gauge takes
  // angles for radians.
  EXPECT_EQ(scaled.undetermined.size(), 3u);
}

TEST(RankReport, CovarianceIsDeficientWhereTheReportSaysSo) {
  for (const bool anchored : {false, true}) {
    ceres::Problem problem;
    Graph2 graph(10, 1.0, &problem);
    if (anchored) problem.SetParameterBlockConstant(graph.poses[0].data());
    const RankReport report = Report(problem);
    ceres::Covariance::Options options;
    options.algorithm_type = ceres::DENSE_SVD;
    ceres::Covariance covariance(options);
    const double* last = graph.poses[9].data();
    const bool works = covariance.Compute(
        std::vector<std::pair<const double*, const double*>>{{last, last}},
        &problem);
    EXPECT_EQ(works, anchored);
    EXPECT_EQ(report.ToText().find("rank deficient") == std::string::npos,
              works);
  }
}

TEST(RankReport, PosesOfThreeBlocksAreRecognised) {
  std::vector<std::array<double, 3>> poses;
  ceres::Problem unused_problem;
  Graph2 graph(9, 1.0, &unused_problem);
  ceres::Problem problem;
  for (int i = 0; i < 9; ++i) {
    for (const int j : {i + 1, i + 2}) {
      if (j >= 9) continue;
      double* a = graph.poses[i].data();
      double* b = graph.poses[j].data();
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<SplitBetween2, 3, 1, 1, 1, 1, 1, 1>(
              new SplitBetween2),
          nullptr,
          a,
          a + 1,
          a + 2,
          b,
          b + 1,
          b + 2);
    }
  }
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.num_undetermined(), 3);
  ASSERT_EQ(report.gauges.size(), 1u);
  EXPECT_EQ(report.gauges[0].name, "rigid motion in the plane");
  // The heading's block, and two places: one block each.
  int num_removed = 0;
  for (const auto& suggestion : report.suggestions) {
    num_removed += suggestion.num_removed;
  }
  EXPECT_EQ(num_removed, 3);
}

// An anchor so weak that the threshold does not see it leaves the gauge; one
// that it does see leaves weak directions, by the gauge's name.
TEST(RankReport, WeakAnchorIsAWeakGauge) {
  for (const double weight : {1e-9, 1e-5}) {
    SCOPED_TRACE(weight);
    ceres::Problem problem;
    Graph2 graph(6, 1.0, &problem);
    problem.AddResidualBlock(new Linear({weight * MatrixXd::Identity(3, 3)}),
                             nullptr,
                             graph.poses[0].data());
    const RankReport report = Report(problem);
    if (weight < 1e-7) {
      EXPECT_EQ(report.num_undetermined(), 3);
      EXPECT_EQ(report.gauges.size(), 1u);
    } else {
      EXPECT_EQ(report.num_undetermined(), 0);
      ASSERT_EQ(report.weak.size(), 3u);
      for (const auto& direction : report.weak) {
        EXPECT_EQ(direction.gauge, "rigid motion in the plane");
      }
    }
  }
}

TEST(RankReport, TwoGraphsAreTwoGroups) {
  ceres::Problem problem;
  Graph2 first(5, 1.0, &problem);
  Graph2 second(6, 1.0, &problem);
  double bias = 0.0;
  problem.AddParameterBlock(&bias, 1);
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.num_groups, 2);
  EXPECT_EQ(report.num_undetermined(), 7);
  EXPECT_EQ(report.gauges.size(), 2u);
  ASSERT_EQ(report.suggestions.size(), 2u);
  EXPECT_EQ(report.blocks[report.suggestions[1].block].values,
            second.poses[0].data());
}

TEST(RankReport, PoseGraphInSpaceHasSixFreedoms) {
  ceres::Problem problem;
  Graph3 graph(15, &problem);
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.num_undetermined(), 6);
  ASSERT_EQ(report.gauges.size(), 1u);
  EXPECT_EQ(report.gauges[0].name, "rigid motion in space");
  EXPECT_EQ(report.gauges[0].num_generators, 6);
  EXPECT_EQ(report.undetermined[5].generator, "rotation about z");
  ASSERT_EQ(report.suggestions.size(), 2u);
  EXPECT_TRUE(report.suggestions[0].whole_block);

  problem.SetParameterBlockConstant(graph.p[0].data());
  // The rotation about the first position remains.
  const RankReport turned = Report(problem);
  ExpectConsistent(problem, turned);
  EXPECT_EQ(turned.num_undetermined(), 3);
  ASSERT_EQ(turned.gauges.size(), 1u);
  EXPECT_EQ(turned.gauges[0].name, "rigid motion in space");
  EXPECT_EQ(turned.undetermined[0].generator.find("rotation about x through"),
            0u);
  problem.SetParameterBlockConstant(graph.q[0].data());
  EXPECT_EQ(Report(problem).num_undetermined(), 0);
}

TEST(RankReport, SuggestionsTakeAwayWhatTheySay) {
  ceres::Problem problem;
  Graph3 graph(8, &problem);
  const RankReport before = Report(problem);
  int undetermined = before.num_undetermined();
  for (const RankReport::Suggestion& suggestion : before.suggestions) {
    ASSERT_TRUE(suggestion.whole_block);
    problem.SetParameterBlockConstant(
        const_cast<double*>(before.blocks[suggestion.block].values));
    undetermined -= suggestion.num_removed;
    EXPECT_EQ(Report(problem).num_undetermined(), undetermined);
  }
  EXPECT_EQ(undetermined, 0);
}

TEST(RankReport, ReconstructionFromImagesHasSevenFreedoms) {
  Scene scene(4, 25);
  ceres::Problem problem;
  scene.AddAllImages(&problem);
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.num_undetermined(), 7);
  ASSERT_EQ(report.gauges.size(), 1u);
  EXPECT_EQ(report.gauges[0].name, "similarity in space");
  EXPECT_EQ(report.gauges[0].num_generators, 7);
  EXPECT_EQ(report.undetermined[6].generator, "scale");
  // Camera 0's pose, and no intrinsics; then one component.
  ASSERT_GE(report.suggestions.size(), 2u);
  EXPECT_EQ(report.suggestions[0].block, 0);
  EXPECT_EQ(report.suggestions[0].tangent,
            (std::vector<int>{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(report.suggestions[0].num_removed, 6);
  EXPECT_EQ(report.suggestions[1].num_removed, 1);
  EXPECT_EQ(report.suggestions[1].tangent.size(), 1u);

  // The scale about a camera that is held.
  problem.SetParameterBlockConstant(scene.cameras[0].data());
  const RankReport held = Report(problem);
  EXPECT_EQ(held.num_undetermined(), 1);
  ASSERT_EQ(held.gauges.size(), 1u);
  EXPECT_EQ(held.gauges[0].name, "similarity in space");
  EXPECT_EQ(held.undetermined[0].generator.find("scale about"), 0u);
}

TEST(RankReport, RotationAndTranslationInTheirOwnBlocks) {
  Scene scene(4, 20);
  ceres::Problem problem;
  scene.AddSplitCameras(&problem);
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.num_undetermined(), 7);
  ASSERT_EQ(report.gauges.size(), 1u);
  EXPECT_EQ(report.gauges[0].name, "similarity in space");
}

// A point in one image only: its place along the ray is open, beside the gauge.
TEST(RankReport, PointOfOneImageIsOpenAlongItsRay) {
  Scene scene(4, 25);
  scene.points.push_back({0.3, -0.4, 0.5});
  ceres::Problem problem;
  for (int c = 0; c < 4; ++c) {
    for (int p = 0; p < 25; ++p) scene.AddImages(c, p, &problem);
  }
  scene.AddImages(2, 25, &problem);
  const RankReport report = Report(problem);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.num_undetermined(), 8);
  ASSERT_EQ(report.undetermined.size(), 8u);
  const RankReport::Direction& ray = report.undetermined[0];
  ASSERT_EQ(ray.parts.size(), 1u);
  EXPECT_EQ(report.blocks[ray.parts[0].block].values, scene.points[25].data());
  // Camera 2's centre is -R^T t.
  const auto& camera = scene.cameras[2];
  const double inverse[3] = {-camera[0], -camera[1], -camera[2]};
  double center[3];
  ceres::AngleAxisRotatePoint(inverse, camera.data() + 3, center);
  Eigen::Vector3d to_point;
  for (int i = 0; i < 3; ++i) to_point[i] = scene.points[25][i] + center[i];
  const Eigen::Vector3d found = ray.parts[0].motion.head<3>();
  EXPECT_NEAR(
      found.normalized().cross(to_point.normalized()).norm(), 0.0, 1e-9);
  ASSERT_EQ(report.gauges.size(), 1u);
  EXPECT_EQ(report.gauges[0].directions.size(), 7u);
  // One component of the point, and the gauge's.
  int num_removed = 0;
  for (const auto& suggestion : report.suggestions) {
    num_removed += suggestion.num_removed;
  }
  EXPECT_EQ(num_removed, 8);
}

TEST(RankReport, GaugesOfOnesOwnHaveTheirNames) {
  // A clock's offset: every block is a time, and rates do not matter.
  std::vector<std::array<double, 4>> x(5, {1.0, 2.0, 3.0, 4.0});
  ceres::Problem problem;
  MatrixXd A = MatrixXd::Identity(4, 4);
  MatrixXd rest = MatrixXd::Identity(4, 4).bottomRows(3);
  for (int i = 0; i + 1 < 5; ++i) {
    problem.AddResidualBlock(
        new Linear({A, -A}), nullptr, x[i].data(), x[i + 1].data());
  }
  problem.AddResidualBlock(new Linear({rest}), nullptr, x[2].data());
  EXPECT_TRUE(Report(problem).gauges.empty());
  RankReport::Options options;
  Gauge clock;
  clock.name = "offset of all clocks";
  clock.generators = {"offset"};
  clock.motions = [](const GaugeComponent& component, MatrixXd* motions) {
    for (const GaugeBlock& block : component.blocks) {
      if (block.size != 4) return false;
      (*motions)(block.offset, 0) = 1.0;
    }
    return true;
  };
  options.gauges = {clock};
  const RankReport report = Report(problem, options);
  EXPECT_EQ(report.num_undetermined(), 1);
  ASSERT_EQ(report.gauges.size(), 1u);
  EXPECT_EQ(report.gauges[0].name, "offset of all clocks");
  EXPECT_NE(report.ToText().find("gauge freedom: offset of all clocks"),
            std::string::npos);
}

}  // namespace rank_report_gauge_test
}  // namespace invgrad
