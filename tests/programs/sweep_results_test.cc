// Values of runs, and which alternative is the best.

#include <cmath>
#include <limits>
#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "bin/sweep/plots.h"
#include "bin/sweep/results.h"
#include "gtest/gtest.h"

namespace invgrad {
namespace sweep_results_test {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

SweepPlan Plan(const std::string& text) {
  Grid grid;
  SweepPlan plan;
  std::string error;
  EXPECT_TRUE(ParseGrid(text, &grid, &error)) << error;
  EXPECT_TRUE(MakeSweepPlan({"toy_network", {}, -1}, grid, &plan, &error))
      << error;
  return plan;
}

// Runs of one step that end at these losses; NaN: a run that failed there.
std::vector<SweepRun> Runs(const std::vector<double>& losses) {
  std::vector<SweepRun> runs;
  for (const double loss : losses) {
    LearningRunResult result;
    HistoryRow row;
    result.history.push_back(row);
    row.step = 1;
    row.seconds = 0.5;
    row.train_loss = loss;
    result.history.push_back(row);
    result.summary.termination_type =
        std::isnan(loss) ? ceres::FAILURE : ceres::NO_CONVERGENCE;
    result.summary.num_steps = 1;
    result.summary.train_time_in_seconds = 0.5;
    runs.push_back({result, "done"});
  }
  return runs;
}

const SweepValue& TrainLoss() {
  static const auto& value =
      *new SweepValue{"train loss", &HistoryRow::train_loss, 0.0};
  return value;
}

TEST(TailMean, AveragesTheRowsOfTheLastPart) {
  History history(5);
  for (int i = 0; i < 5; ++i) {
    history[i].seconds = i;  // the last at 4
    history[i].train_loss = i * i;
  }
  const auto mean = [&history](double tail) {
    return TailMean(history, &HistoryRow::train_loss, tail);
  };
  EXPECT_EQ(mean(0.0), 16.0);
  EXPECT_EQ(mean(0.2), 16.0);  // from 3.2 s on
  EXPECT_EQ(mean(0.25), (16.0 + 9.0) / 2.0);
  EXPECT_EQ(mean(0.9), (16.0 + 9.0 + 4.0 + 1.0) / 4.0);
  // The last value alone, whatever the clock says.
  for (HistoryRow& row : history) row.seconds = 0.0;
  EXPECT_EQ(mean(0.0), 16.0);
  history.resize(1);
  EXPECT_EQ(mean(0.5), 0.0);
}

TEST(FindSweepValue, TakesTheMetricThenTheTestLoss) {
  SweepPlan plan = Plan("rule=adam");
  const auto find = [&plan](const std::string& name) {
    SweepValue value;
    std::string error;
    return FindSweepValue(plan, name, 0.1, &value, &error) ? value.name : error;
  };
  EXPECT_EQ(find("auto"), "train loss");
  EXPECT_EQ(find("metric"),
            "--value=metric is not there; allowed: auto, train_loss");
  PhysicsProblem problem = *plan.jobs[0].problem;
  problem.learning->test = problem.learning->train;
  plan.jobs[0].problem = std::make_shared<PhysicsProblem>(problem);
  EXPECT_EQ(find("auto"), "test loss");
  EXPECT_EQ(find("train_loss"), "train loss");
  problem.learning->metric = {"x_distance", nullptr};
  plan.jobs[0].problem = std::make_shared<PhysicsProblem>(problem);
  EXPECT_EQ(find("auto"), "x_distance");
  EXPECT_EQ(find("test_loss"), "test loss");
  SweepValue value;
  std::string error;
  ASSERT_TRUE(FindSweepValue(plan, "metric", 0.1, &value, &error)) << error;
  EXPECT_EQ(value.field, &HistoryRow::metric);
  EXPECT_EQ(value.tail, 0.1);
}

TEST(FindBest, TakesTheLowestMedianOverTheSeeds) {
  // Three seeds, three alternatives: seeds change slower than alternatives.
  const SweepPlan plan = Plan("rule=adam:step_size=1|2|3;seed=1,2,3");
  const std::vector<SweepRun> runs = Runs({1,
                                           3,
                                           9,  //
                                           8,
                                           4,
                                           0.1,  //
                                           9,
                                           5,
                                           0.2});  // seed 3
  const std::vector<SweepBest> best = FindBest(plan, runs, TrainLoss()).best;
  ASSERT_EQ(best.size(), 1u);
  EXPECT_EQ(best[0].alternative->chosen, "step_size=3");
  EXPECT_EQ(best[0].alternative->at_edge,
            std::vector<std::string>({"step_size"}));
  EXPECT_EQ(best[0].spread.median, 0.2);
  EXPECT_EQ(best[0].spread.low, 0.1);
  EXPECT_EQ(best[0].spread.high, 9.0);
  EXPECT_EQ(plan.jobs[plan.points[best[0].median_point()].job].seed, 3);
}

TEST(FindBest, AFailedRunIsWorseThanAnyOther) {
  const SweepPlan plan = Plan("rule=adam:step_size=1|2|3;seed=1,2,3");
  {
    // The first is the lowest where it does not fail.
    const std::vector<SweepBest> best =
        FindBest(plan, Runs({0.1, 3, 9, kNan, 4, 9, kNan, 5, 9}), TrainLoss())
            .best;
    EXPECT_EQ(best[0].alternative->chosen, "step_size=2");
    EXPECT_TRUE(best[0].alternative->at_edge.empty());
    EXPECT_EQ(best[0].spread.median, 4.0);
  }
  {
    const std::vector<SweepBest> best =
        FindBest(plan, Runs(std::vector<double>(9, kNan)), TrainLoss()).best;
    EXPECT_EQ(best[0].alternative->chosen, "step_size=1");
    EXPECT_TRUE(std::isnan(best[0].spread.median));
    EXPECT_EQ(best[0].spread.num_failed, 3);
  }
  {
    // So is one that was not run.
    std::vector<SweepRun> runs = Runs({0.1, 3, 9, 0.1, 4, 9, 0.1, 5, 9});
    runs[0] = runs[3] = {std::nullopt, "interrupted"};
    const std::vector<SweepBest> best = FindBest(plan, runs, TrainLoss()).best;
    EXPECT_EQ(best[0].alternative->chosen, "step_size=2");
  }
}

TEST(FindBest, EveryPointAndRuleHasItsOwn) {
  const SweepPlan plan =
      Plan("lambda=1,0.1;rule=adam:step_size=1|2,half_inverse");
  const std::vector<SweepBest> best =
      FindBest(plan, Runs({1, 2, 5, 4, 3, 6}), TrainLoss()).best;
  ASSERT_EQ(best.size(), 4u);
  EXPECT_EQ(best[0].alternative->chosen, "step_size=1");
  EXPECT_EQ(best[1].spread.median, 5.0);
  EXPECT_EQ(best[2].alternative->chosen, "step_size=2");
  EXPECT_EQ(best[2].at[0], 1);
  EXPECT_EQ(best[3].spread.median, 6.0);
}

TEST(SweepCsv, HasALineForEveryRun) {
  const SweepPlan plan = Plan("lambda=1,0.1;rule=adam:step_size=1|2|4");
  std::vector<SweepRun> runs = Runs({3, 1.0 / 3.0, 2, 1, 5, kNan});
  runs[4] = {std::nullopt, "not run: \"a\", b"};
  const std::string csv = SweepCsv(FindBest(plan, runs, TrainLoss()));
  EXPECT_EQ(csv,
            "lambda,rule,seed,alternative,train_loss,test_loss,metric,"
            "best_train_loss,steps,seconds,ms_per_step,best,at_edge,status\n"
            "1,adam:step_size=1|2|4,1,step_size=1,3,,,3,1,0.5,500,0,,done\n"
            "1,adam:step_size=1|2|4,1,step_size=2,0.33333333333333331,,,"
            "0.33333333333333331,1,0.5,500,1,,done\n"
            "1,adam:step_size=1|2|4,1,step_size=4,2,,,2,1,0.5,500,0,,done\n"
            "0.1,adam:step_size=1|2|4,1,step_size=1,1,,,1,1,0.5,500,1,"
            "step_size,done\n"
            "0.1,adam:step_size=1|2|4,1,step_size=2,,,,,,,,0,,"
            "\"not run: \"\"a\"\", b\"\n"
            "0.1,adam:step_size=1|2|4,1,step_size=4,,,,,1,0.5,500,0,,done\n");
}

TEST(SweepPlots, LinesAndHeatMapsShowTheMedians) {
  const SweepPlan plan =
      Plan("lambda=1,0.01;rule=adam,half_inverse;batch_size=8,4,0");
  const std::vector<SweepRun> runs =
      Runs({1, 2, 3, 4, 5, 6, 7, 8, 9, 10, kNan, 12});
  const SweepResults results = FindBest(plan, runs, TrainLoss());
  const std::vector<Plot> lines = SweepLines(results);
  ASSERT_EQ(lines.size(), 3u);  // one a batch size
  EXPECT_EQ(lines[1].title, "batch_size=4");
  EXPECT_TRUE(lines[1].log_x);
  EXPECT_TRUE(lines[1].log_y);
  EXPECT_DOUBLE_EQ(*lines[1].x_range.high, std::pow(100.0, 0.04));
  EXPECT_DOUBLE_EQ(*lines[1].y_range.low, std::pow(12.0, -0.04));
  ASSERT_EQ(lines[1].series.size(), 2u);
  EXPECT_EQ(lines[1].series[0].title, "adam");
  EXPECT_EQ(lines[1].series[0].x, (std::vector<double>{0.01, 1.0}));
  EXPECT_EQ(lines[1].series[0].y, (std::vector<double>{8.0, 2.0}));
  EXPECT_TRUE(std::isnan(lines[1].series[1].y[0]));

  const std::vector<Plot> maps = SweepHeatMaps(results);
  ASSERT_EQ(maps.size(), 2u);  // one a rule
  EXPECT_EQ(maps[1].title, "half_inverse");
  const HeatMap& map = *maps[1].heat_map;
  EXPECT_EQ(maps[1].x_ticks, (Ticks{{0.0, "0.01"}, {1.0, "1"}}));
  // A batch of 0 is one of all 256 samples.
  EXPECT_EQ(maps[1].y_ticks, (Ticks{{0.0, "4"}, {1.0, "8"}, {2.0, "0"}}));
  EXPECT_EQ(map.z(2, 0), 12.0);
  EXPECT_TRUE(std::isnan(map.z(0, 0)));
  EXPECT_EQ(map.z(1, 1), 4.0);
  EXPECT_EQ(map.z_range.low, 1.0);
  EXPECT_EQ(map.z_range.high, 12.0);

  const std::vector<Plot> curves = SweepCurves(results);
  ASSERT_EQ(curves.size(), 6u);
  EXPECT_EQ(curves[5].title, "lambda=0.01, batch_size=0");
  EXPECT_EQ(curves[5].series[1].y, (std::vector<double>{12.0}));
  EXPECT_TRUE(curves[5].log_y);
  EXPECT_DOUBLE_EQ(*curves[0].y_range.low, std::pow(12.0, -0.04));
  EXPECT_EQ(curves[5].y_range.high, curves[0].y_range.high);

  const SweepPlan single = Plan("rule=adam,half_inverse");
  const std::vector<SweepRun> two = Runs({1, 2});
  const SweepResults of_two = FindBest(single, two, TrainLoss());
  EXPECT_TRUE(SweepLines(of_two).empty());
  EXPECT_TRUE(SweepHeatMaps(of_two).empty());
  EXPECT_EQ(SweepCurves(of_two).size(), 1u);
}

TEST(SweepPlots, WithoutNumbersLinesFollowTheGrid) {
  const SweepPlan plan = Plan(
      "step_size=0.1,auto;hidden=9-9,9;rule=gauss_newton,half_inverse;seed=1");
  const std::vector<SweepRun> runs = Runs({1, 2, 3, 4, 5, 6, 7, 8});
  const SweepResults results = FindBest(plan, runs, TrainLoss());
  const std::vector<Plot> lines = SweepLines(results);
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[1].title, "hidden=9");
  EXPECT_EQ(lines[1].x_ticks,
            (std::vector<std::pair<double, std::string>>{{0.0, "0.1"},
                                                         {1.0, "auto"}}));
  EXPECT_EQ(lines[1].x_range.low, -0.5);
  EXPECT_EQ(lines[1].x_range.high, 1.5);
  EXPECT_FALSE(lines[1].log_x);
  EXPECT_EQ(lines[1].series[0].x, (std::vector<double>{0.0, 1.0}));
  EXPECT_EQ(lines[1].series[0].y, (std::vector<double>{3.0, 7.0}));
  EXPECT_EQ(lines[1].series[1].y, (std::vector<double>{4.0, 8.0}));
  EXPECT_TRUE(SweepHeatMaps(results).empty());

  // Numbers go first, wherever they stand.
  const SweepPlan mixed = Plan("activation=tanh,relu;batch_size=8,4;rule=adam");
  const std::vector<SweepRun> four = Runs({1, 2, 3, 4});
  const std::vector<Plot> of_mixed =
      SweepLines(FindBest(mixed, four, TrainLoss()));
  ASSERT_EQ(of_mixed.size(), 2u);
  EXPECT_EQ(of_mixed[1].title, "activation=relu");
  EXPECT_EQ(
      of_mixed[1].x_ticks,
      (std::vector<std::pair<double, std::string>>{{4.0, "4"}, {8.0, "8"}}));
  EXPECT_DOUBLE_EQ(*of_mixed[1].x_range.low, 4.0 - 0.04 * 4.0);
  // The panels compare.
  EXPECT_DOUBLE_EQ(*of_mixed[0].y_range.low, 1.0 - 0.04 * 3.0);
  EXPECT_DOUBLE_EQ(*of_mixed[0].y_range.high, 4.0 + 0.04 * 3.0);
  EXPECT_EQ(of_mixed[1].y_range.low, of_mixed[0].y_range.low);
  EXPECT_EQ(of_mixed[1].series[0].x, (std::vector<double>{4.0, 8.0}));
}

TEST(SweepPlots, ZeroAndDecadesStandSideBySide) {
  const auto lines = [](const std::string& values) {
    const SweepPlan plan =
        Plan("truncation=" + values + ";rule=half_inverse;seed=1");
    const std::vector<SweepRun> runs = Runs({1, 2, 3});
    return SweepLines(FindBest(plan, runs, TrainLoss()))[0];
  };
  const Plot with_zero = lines("1e-3,0,1e-6");
  EXPECT_FALSE(with_zero.log_x);
  EXPECT_EQ(with_zero.x_ticks,
            (std::vector<std::pair<double, std::string>>{
                {0.0, "0"}, {1.0, "1e-6"}, {2.0, "1e-3"}}));
  EXPECT_EQ(with_zero.series[0].x, (std::vector<double>{0.0, 1.0, 2.0}));
  EXPECT_EQ(with_zero.series[0].y, (std::vector<double>{2.0, 3.0, 1.0}));
  EXPECT_TRUE(lines("1e-3,1e-1,1e-6").log_x);
  const Plot near = lines("0,0.25,0.5");
  EXPECT_FALSE(near.log_x);
  EXPECT_EQ(near.series[0].x, (std::vector<double>{0.0, 0.25, 0.5}));
}

TEST(SweepPlots, LeaveOutPanelsBeyondTheSixteenthWithAWarning) {
  for (const int num_panels : {16, 17}) {
    std::string grid = "rule=adam;batch_size=";
    for (int i = 1; i <= num_panels; ++i) {
      grid += (i > 1 ? "," : "") + std::to_string(i);
    }
    const SweepPlan plan = Plan(grid);
    const std::vector<SweepRun> runs =
        Runs(std::vector<double>(num_panels, 1.0));
    testing::internal::CaptureStderr();
    const std::vector<Plot> curves =
        SweepCurves(FindBest(plan, runs, TrainLoss()));
    const std::string warning = testing::internal::GetCapturedStderr();
    EXPECT_EQ(curves.size(), 16u);
    EXPECT_EQ(warning.find("curves.png shows the first 16 of 17 panels") !=
                  std::string::npos,
              num_panels == 17)
        << warning;
  }
}

}  // namespace sweep_results_test
}  // namespace invgrad
