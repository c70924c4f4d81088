// The rank report of published pose graphs without an anchor: large sparse
// problems, of which the answer is known.
#include <string>
#include <vector>

#include "ceres/problem.h"
#include "gtest/gtest.h"
#include "invgrad/rank/rank_report.h"
#include "problems/estimation/g2o_file.h"
#include "problems/estimation/pose_graph.h"
#include "tests/support/published_data.h"

namespace invgrad {
namespace rank_report_data_test {

// With all poses free, or with the first one constant.
RankReport ReportOf(PoseGraph* graph, bool is_anchored) {
  ceres::Problem problem;
  AddPoseGraph(
      InformationRoot::kLower, [] { return nullptr; }, graph, &problem);
  std::vector<double*> blocks;
  problem.GetParameterBlocks(&blocks);
  for (double* values : blocks) {
    if (!is_anchored) problem.SetParameterBlockVariable(values);
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
  };
  for (const auto& [file, num_directions, gauge] :
       {Case{"g2o/M3500.g2o", 3, "rigid motion in the plane"},
        Case{"g2o/sphere2500.g2o", 6, "rigid motion in space"}}) {
    const std::string path = PublishedData(file);
    if (path.empty()) {
      GTEST_SKIP() << file << " is not here; it is published at "
                   << "https://lucacarlone.mit.edu/datasets/";
    }
    PoseGraph graph;
    std::string error;
    ASSERT_TRUE(ReadG2oFile(path, &graph, &error)) << error;
    const RankReport free = ReportOf(&graph, false);
    EXPECT_TRUE(free.is_complete);
    EXPECT_EQ(free.num_undetermined(), num_directions) << free.ToText();
    ASSERT_EQ(free.gauges.size(), 1u) << free.ToText();
    EXPECT_EQ(free.gauges[0].name, gauge);
    EXPECT_EQ(free.gauges[0].num_generators, num_directions);
    EXPECT_EQ(ReportOf(&graph, true).num_undetermined(), 0);
  }
}

}  // namespace rank_report_data_test
}  // namespace invgrad
