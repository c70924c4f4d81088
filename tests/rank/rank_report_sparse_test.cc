// Groups that are decomposed by the sparse method.
#include <memory>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/rank_report.h"
#include "tests/rank/rank_problems.h"

namespace invgrad {
namespace rank_report_sparse_test {

TEST(RankReport, SparseAndDenseWaysAgree) {
  RankReport::Options sparse;
  sparse.max_dense_size = 0;
  for (const bool plane : {true, false}) {
    SCOPED_TRACE(plane);
    ceres::Problem problem;
    std::unique_ptr<Graph2> graph;
    std::unique_ptr<Scene> scene;
    if (plane) {
      graph = std::make_unique<Graph2>(60, 1.0, &problem);
    } else {
      scene = std::make_unique<Scene>(5, 40);
      scene->AddAllImages(&problem);
    }
    const RankReport a = Report(problem);
    const RankReport b = Report(problem, sparse);
    ExpectConsistent(problem, b);
    EXPECT_EQ(a.rank, b.rank);
    EXPECT_FALSE(b.has_all_singular_values);
    EXPECT_TRUE(b.is_complete);
    // Power iteration is good to a percent.
    EXPECT_NEAR(a.s_max, b.s_max, 0.02 * a.s_max);
    ASSERT_EQ(a.gauges.size(), b.gauges.size());
    for (std::size_t g = 0; g < a.gauges.size(); ++g) {
      EXPECT_EQ(a.gauges[g].name, b.gauges[g].name);
      EXPECT_EQ(a.gauges[g].directions, b.gauges[g].directions);
    }
    ASSERT_EQ(a.suggestions.size(), b.suggestions.size());
    for (std::size_t i = 0; i < a.suggestions.size(); ++i) {
      EXPECT_EQ(a.suggestions[i].block, b.suggestions[i].block);
      EXPECT_EQ(a.suggestions[i].tangent, b.suggestions[i].tangent);
    }
    ASSERT_EQ(a.weak.size(), b.weak.size());
    const double ratio = a.s_max / b.s_max;
    for (std::size_t i = 0; i < a.weak.size(); ++i) {
      EXPECT_NEAR(a.weak[i].singular_value * ratio,
                  b.weak[i].singular_value,
                  0.02 * b.weak[i].singular_value);
    }
  }
}

TEST(RankReport, SparseWaySaysWhenThereMayBeMore) {
  // 30 pairs of which only the sums are seen, in one group by one more block.
  std::vector<double> x(60, 1.0);
  double shared = 1.0;
  ceres::Problem problem;
  for (int i = 0; i < 30; ++i) {
    problem.AddResidualBlock(new Linear({Row({1.0}), Row({1.0}), Row({0.1})}),
                             nullptr,
                             &x[2 * i],
                             &x[2 * i + 1],
                             &shared);
  }
  problem.AddResidualBlock(new Linear({Row({1.0})}), nullptr, &shared);
  RankReport::Options options;
  options.max_dense_size = 0;
  options.max_directions = 5;
  const RankReport some = Report(problem, options);
  EXPECT_FALSE(some.is_complete);
  EXPECT_LT(some.num_undetermined(), 30);
  EXPECT_NE(some.ToText().find("max_directions"), std::string::npos);
  options.max_directions = 40;
  const RankReport all = Report(problem, options);
  ExpectConsistent(problem, all);
  EXPECT_TRUE(all.is_complete);
  EXPECT_EQ(all.num_undetermined(), 30);
  for (const auto& direction : all.undetermined) {
    EXPECT_EQ(direction.parts.size(), 2u);
  }
}

TEST(RankReport, TwoRunsAreTheSame) {
  RankReport::Options options;
  options.max_dense_size = 0;
  ceres::Problem problem;
  Graph2 graph(30, 1.0, &problem);
  const RankReport a = Report(problem, options);
  const RankReport b = Report(problem, options);
  EXPECT_EQ(a.ToText(), b.ToText());
  EXPECT_EQ(a.singular_values, b.singular_values);
}

}  // namespace rank_report_sparse_test
}  // namespace invgrad
