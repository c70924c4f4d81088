// Which job is next, and how much of a sweep is done.

#include <limits>
#include <string>
#include <vector>

#include "bin/sweep/schedule.h"
#include "gtest/gtest.h"

namespace invgrad {
namespace sweep_schedule_test {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

std::vector<int> Order(Schedule* schedule) {
  std::vector<int> order;
  for (int job = schedule->Next(); job >= 0; job = schedule->Next()) {
    order.push_back(job);
  }
  return order;
}

TEST(Schedule, TheLongestIsFirstAndTheFirstOfSeveral) {
  Schedule schedule({{"a", 1e9}, {"a", 3e9}, {"b", 2e9}, {"b", 3e9}});
  EXPECT_EQ(Order(&schedule), (std::vector<int>{1, 3, 2, 0}));
  Schedule none({});
  EXPECT_EQ(none.Next(), -1);
}

TEST(Schedule, FinishedJobsAreLeftOut) {
  Schedule schedule({{"a", 1e9}, {"a", 3e9}, {"a", 2e9}});
  schedule.Finish(1, 0.0);
  EXPECT_EQ(Order(&schedule), (std::vector<int>{2, 0}));
}

TEST(Schedule, ALimitOfSecondsIsExpected) {
  const Schedule schedule(
      {{"a", 1e30, 5.0}, {"a", 1e30, 7.0}, {"a", 1.0, 5.0}});
  EXPECT_EQ(schedule.ExpectedSeconds(0), 5.0);
  EXPECT_EQ(schedule.ExpectedSeconds(1), 7.0);
  EXPECT_LT(schedule.ExpectedSeconds(2), 1.0);
}

TEST(Schedule, LearnsFromFinishedJobsOfTheKindOrElseOfAll) {
  Schedule schedule(
      {{"a", 10.0}, {"a", 20.0}, {"b", 20.0}, {"b", 30.0}, {"a", 10.0}});
  schedule.Finish(0, 5.0);  // 0.5 s per work
  EXPECT_EQ(schedule.ExpectedSeconds(1), 10.0);
  EXPECT_EQ(schedule.ExpectedSeconds(3), 15.0);
  schedule.Finish(2, 2.0);  // 0.1
  EXPECT_EQ(schedule.ExpectedSeconds(1), 10.0);
  EXPECT_EQ(schedule.ExpectedSeconds(3), 3.0);
  schedule.Finish(4, 0.01);  // it diverged
  EXPECT_EQ(schedule.ExpectedSeconds(1), 10.0);
  EXPECT_EQ(schedule.Next(), 1);
}

TEST(Schedule, TheShareDoneIsInExpectedSeconds) {
  Schedule schedule({{"a", 10.0}, {"a", 30.0}, {"a", 60.0}});
  const std::vector<double> running = {0.0, 12.0, 0.0};
  EXPECT_EQ(schedule.FractionDone(running), 0.0);  // nothing is known
  schedule.Finish(0, 10.0);
  EXPECT_DOUBLE_EQ(schedule.FractionDone(running), 0.22);
  // A job that takes longer than expected is not over.
  EXPECT_DOUBLE_EQ(schedule.FractionDone({0.0, 1e3, 0.0}), 0.4);
  schedule.Finish(1, kUnknown);
  schedule.Finish(2, kUnknown);
  EXPECT_EQ(schedule.FractionDone({0.0, 0.0, 0.0}), 1.0);
  EXPECT_EQ(Schedule({}).FractionDone({}), 1.0);
  // Limits of seconds are known from the start.
  EXPECT_DOUBLE_EQ(Schedule({{"a", 1e30, 4.0}}).FractionDone({1.0}), 0.25);
}

class ScheduledJobTest : public ::testing::Test {
 protected:
  static double Work(const std::string& grid_text, int num_epochs) {
    Grid grid;
    SweepPlan plan;
    std::string error;
    EXPECT_TRUE(ParseGrid(grid_text, &grid, &error)) << error;
    EXPECT_TRUE(MakeSweepPlan(
        {"toy_network:num_samples=64", {}, 8}, grid, &plan, &error))
        << error;
    TrainOptions options;
    options.max_num_epochs = num_epochs;
    return ScheduledJob(plan.jobs[0], options).work;
  }
};

TEST_F(ScheduledJobTest, WorkGrowsWithBudgetNetworkBatchAndRule) {
  const double adam = Work("rule=adam", 2);
  EXPECT_GT(adam, 0.0);
  EXPECT_DOUBLE_EQ(Work("rule=adam", 4), 2.0 * adam);
  EXPECT_GT(Work("rule=adam;hidden=100-100", 2), adam);
  EXPECT_GT(Work("rule=half_inverse", 2), adam);
  EXPECT_GT(Work("rule=half_inverse;batch_size=32", 2),
            Work("rule=half_inverse", 2));
}

}  // namespace sweep_schedule_test
}  // namespace invgrad
