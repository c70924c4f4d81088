#include "invgrad/inverse/pull_back_counts.h"

#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"

namespace invgrad {
namespace pull_back_counts_test {

using Eigen::VectorXd;

TEST(PullBackCountsTest, ReportsSourcesAndTheFirstFailure) {
  PullBackCounts counts;
  EXPECT_EQ(counts.Report(), "");
  SimulatorPullBack::Result result;
  result.source = PullBackSource::kInverse;
  counts.BeginStep();
  counts.Add(result, 0);
  counts.Add(result, 1);
  EXPECT_EQ(counts.Report(), "2 inverse");
  counts.BeginStep();
  result.source = PullBackSource::kNumericalInverse;
  result.why = "y_0 <= 0";
  counts.Add(result, 17);
  result.source = PullBackSource::kNone;
  result.why = "another";
  counts.Add(result, 18);
  EXPECT_EQ(counts.Report(),
            "2 inverse, 1 numerical inverse, 1 not moved "
            "(first at step 2, sample 17: y_0 <= 0)");
  EXPECT_EQ(counts.of(PullBackSource::kInverse), 2);
  EXPECT_EQ(counts.of(PullBackSource::kInverseGradient), 0);
}

TEST(PullBackCountsTest, GoOnFromTheirState) {
  PullBackCounts counts;
  SimulatorPullBack::Result result;
  for (int i = 0; i < 3; ++i) {
    counts.BeginStep();
    for (int source = 1; source < kNumPullBackSources; ++source) {
      result.source = static_cast<PullBackSource>(source);
      for (int k = 0; k < source; ++k) counts.Add(result, k);
    }
  }
  PullBackCounts restored;
  ASSERT_TRUE(restored.SetState(counts.State()));
  EXPECT_EQ(restored.State(), counts.State());
  EXPECT_EQ(restored.Report(), counts.Report());
  result.why = "late";
  for (PullBackCounts* of : {&counts, &restored}) {
    of->BeginStep();
    of->Add(result, 5);
  }
  EXPECT_EQ(restored.Report(), counts.Report());
  EXPECT_NE(restored.Report().find("first at step 4, sample 5: late"),
            std::string::npos);
}

TEST(PullBackCountsTest, TheStateHasTheFirstFailure) {
  PullBackCounts counts;
  SimulatorPullBack::Result result;
  result.source = PullBackSource::kGradient;
  result.why = "x\xc2\xb2 < 0";
  counts.BeginStep();
  counts.Add(result, 2);
  PullBackCounts restored;
  ASSERT_TRUE(restored.SetState(counts.State()));
  result.why = "another";
  for (PullBackCounts* of : {&counts, &restored}) {
    of->BeginStep();
    of->Add(result, 5);
  }
  EXPECT_EQ(restored.Report(), counts.Report());
  EXPECT_NE(restored.Report().find("first at step 1, sample 2: x\xc2\xb2 < 0"),
            std::string::npos)
      << restored.Report();

  const VectorXd before = restored.State();
  VectorXd damaged = before;
  damaged[before.size() - 1] = 256.0;
  EXPECT_FALSE(restored.SetState(damaged));
  EXPECT_FALSE(restored.SetState(before.head(3)));
  EXPECT_FALSE(restored.SetState(VectorXd()));
  EXPECT_EQ(restored.State(), before);
}

}  // namespace pull_back_counts_test
}  // namespace invgrad
