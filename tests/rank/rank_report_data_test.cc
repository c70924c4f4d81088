// The rank report of published pose graphs without an anchor: large sparse
// problems, of which the answer is known.
#include <string>
#include <vector>

#include "ceres/problem.h"
#include "gtest/gtest.h"
#include "invgrad/rank_report.h"
#include "problems/estimation/g2o_file.h"
#include "problems/estimation/pose_graph.h"
#include "tests/rank/rank_problems.h"
#include "tests/support/published_data.h"

namespace invgrad {
namespace rank_report_data_test {

enum class Held { kNothing, kFirstPosition, kFirstPose };

RankReport ReportOf(PoseGraph* graph, Held held) {
  ceres::Problem problem;
  AddPoseGraph(
      EdgeError::kCeres, [] { return nullptr; }, graph, &problem);
  std::vector<double*> blocks;
  problem.GetParameterBlocks(&blocks);
  for (double* values : blocks) {
    if (held != Held::kFirstPose) problem.SetParameterBlockVariable(values);
  }
  if (held == Held::kFirstPosition) {
    problem.AddResidualBlock(
        new Linear({Eigen::MatrixXd::Identity(graph->dimension, 3)}),
        nullptr,
        graph->poses.data());
  }
  RankReport report;
  std::string error;
  EXPECT_TRUE(ComputeRankReport({}, problem, &report, &error)) << error;
  return report;
}

TEST(RankReportData, PoseGraphsAreFreeToMoveAsAWhole) {
  struct Case {
    const char* file;
    int num_directions;
    const char* gauge;
    Names held;
  };
  for (const auto& [file, num_directions, gauge, names] :
       {Case{"g2o/M3500.g2o",
             3,
             "rigid motion in the plane",
             {"rotation about `block 0`"}},
        Case{"g2o/sphere2500.g2o",
             6,
             "rigid motion in space",
             {"rotation about x through `block 0`",
              "rotation about y through `block 0`",
              "rotation about z through `block 0`"}}}) {
    const std::string path = PublishedData(file);
    if (path.empty()) {
      GTEST_SKIP() << file << " is not here; it is published at "
                   << "https://lucacarlone.mit.edu/datasets/";
    }
    PoseGraph graph;
    std::string error;
    ASSERT_TRUE(ReadG2oFile(path, &graph, &error)) << error;
    const RankReport free = ReportOf(&graph, Held::kNothing);
    EXPECT_TRUE(free.is_complete);
    EXPECT_EQ(free.num_undetermined(), num_directions) << free.ToText();
    ASSERT_EQ(free.gauges.size(), 1u) << free.ToText();
    EXPECT_EQ(free.gauges[0].name, gauge);
    EXPECT_EQ(free.gauges[0].num_generators, num_directions);
    const RankReport held = ReportOf(&graph, Held::kFirstPosition);
    ASSERT_EQ(held.undetermined.size(), names.size()) << held.ToText();
    for (std::size_t i = 0; i < names.size(); ++i) {
      EXPECT_EQ(held.undetermined[i].generator, names[i]);
    }
    EXPECT_EQ(ReportOf(&graph, Held::kFirstPose).num_undetermined(), 0);
  }
}

}  // namespace rank_report_data_test
}  // namespace invgrad
