// Grids as text, and what they mean.

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "bin/sweep/plan.h"
#include "gtest/gtest.h"
#include "invgrad/compare/compare.h"

namespace invgrad {
namespace sweep_grid_test {

using Strings = std::vector<std::string>;

TEST(ParseGrid, ReadsAxesAndValues) {
  Grid grid;
  std::string error;
  ASSERT_TRUE(ParseGrid(
      " xi = 1, 3 ;rule=sip:a=1|2 , newton/inverse/adam,ceres_lm+adam;\nseed=7",
      &grid,
      &error))
      << error;
  ASSERT_EQ(grid.axes.size(), 3u);
  EXPECT_EQ(grid.axes[0].name, "xi");
  EXPECT_EQ(grid.axes[0].values, Strings({"1", "3"}));
  EXPECT_EQ(grid.axes[1].values,
            Strings({"sip:a=1|2", "newton/inverse/adam", "ceres_lm+adam"}));
  EXPECT_EQ(grid.axes[2].values, Strings({"7"}));
  EXPECT_EQ(grid.Find("seed"), 2);
  EXPECT_EQ(grid.Find("phi"), -1);
}

TEST(ParseGrid, NamesWhatIsMalformed) {
  for (const auto& [text, message] :
       std::vector<std::pair<std::string, std::string>>{
           {"", "expected an axis, name=value,value, found ''"},
           {"a=1;", "expected an axis, name=value,value, found ''"},
           {"a=1;;b=2", "expected an axis, name=value,value, found ''"},
           {"=1", "expected an axis, name=value,value, found '=1'"},
           {"a ;b=1", "expected an axis, name=value,value, found 'a'"},
           {"a=", "the axis 'a' has an empty value"},
           {"a=1,,2", "the axis 'a' has an empty value"},
           {"a=1, ;b=2", "the axis 'a' has an empty value"},
           {"a=1|2", "'1|2': '|' is for alternatives of a rule's setting"},
           {"a=1;a=2", "the axis 'a' is given twice"},
           {"a=1,2,1", "the value '1' of 'a' is given twice"}}) {
    SCOPED_TRACE(text);
    Grid grid;
    std::string error;
    EXPECT_FALSE(ParseGrid(text, &grid, &error));
    EXPECT_EQ(error.rfind("--grid: " + message, 0), 0u) << error;
  }
}

TEST(ExpandRule, CombinesAlternatives) {
  const std::vector<RuleAlternative> one = ExpandRule("adam:beta=0.9");
  ASSERT_EQ(one.size(), 1u);
  EXPECT_EQ(one[0].specification, "adam:beta=0.9");
  EXPECT_EQ(one[0].chosen, "");
  EXPECT_TRUE(one[0].at_edge.empty());

  const std::vector<RuleAlternative> six =
      ExpandRule("a+b : x = 1 | 1e-2|10:y=0:z=auto|3");
  ASSERT_EQ(six.size(), 6u);
  const Strings specifications = {"a+b:x=1:y=0:z=auto",
                                  "a+b:x=1:y=0:z=3",
                                  "a+b:x=1e-2:y=0:z=auto",
                                  "a+b:x=1e-2:y=0:z=3",
                                  "a+b:x=10:y=0:z=auto",
                                  "a+b:x=10:y=0:z=3"};
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(six[i].specification, specifications[i]);
    // By size, not by place; what is not a number has no edge.
    EXPECT_EQ(six[i].at_edge, i < 2 ? Strings() : Strings({"x"}));
  }
  EXPECT_EQ(six[3].chosen, "x=1e-2:z=3");
}

TEST(ExpandRule, KeepsPhases) {
  const std::string rule =
      "adam:step_size=1e-3|1e-2:epochs=5 > half_inverse:kappa=0.5|1:eta=1";
  const std::vector<RuleAlternative> four = ExpandRule(rule);
  ASSERT_EQ(four.size(), 4u);
  EXPECT_EQ(four[1].specification,
            "adam:step_size=1e-3:epochs=5>half_inverse:kappa=1:eta=1");
  EXPECT_EQ(four[1].chosen, "step_size=1e-3:kappa=1");
  const std::vector<RuleAlternative> two =
      ExpandRule("adam:epochs=1|5>half_inverse");
  ASSERT_EQ(two.size(), 2u);
  EXPECT_EQ(two[0].specification, "adam:epochs=1>half_inverse");
  EXPECT_EQ(two[1].specification, "adam:epochs=5>half_inverse");
}

// The rest needs problems and rules.
SweepPlan Plan(const std::string& text) {
  Grid grid;
  SweepPlan plan;
  std::string error;
  EXPECT_TRUE(ParseGrid(text, &grid, &error)) << error;
  EXPECT_TRUE(MakeSweepPlan({"toy_network", {}, -1}, grid, &plan, &error))
      << error;
  return plan;
}

TEST(SweepPlan, HasAPointForEveryCombination) {
  const SweepPlan plan =
      Plan("lambda=1,0.1;rule=adam:step_size=1|2|3,half_inverse;seed=5,6");
  EXPECT_EQ(plan.points.size(), 2u * (3u + 1u) * 2u);
  EXPECT_EQ(plan.jobs.size(), plan.points.size());
  // Alternatives change fastest, then the seed, then the rule.
  EXPECT_EQ(plan.points[1].alternative, 1);
  EXPECT_EQ(plan.points[3].at, (std::vector<int>{0, 0, 1}));
  EXPECT_EQ(plan.points[6].at, (std::vector<int>{0, 1, 0}));
  EXPECT_EQ(plan.jobs[plan.points[4].job].method.label, "adam:step_size=2");
  EXPECT_EQ(plan.jobs[plan.points[4].job].seed, 6);
  // A problem is made once.
  EXPECT_EQ(plan.jobs[0].problem, plan.jobs[7].problem);
  EXPECT_NE(plan.jobs[0].problem, plan.jobs[8].problem);
}

TEST(SweepPlan, SeedsMayBeRanges) {
  const SweepPlan plan = Plan("seed=9,1..2,3,...,6;rule=adam");
  std::vector<int> seeds;
  for (const SweepJob& job : plan.jobs) seeds.push_back(job.seed);
  EXPECT_EQ(seeds, (std::vector<int>{9, 1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(plan.grid.axes[0].values,
            (Strings{"9", "1", "2", "3", "4", "5", "6"}));
}

// Of several axes, whichever of them is to blame.
TEST(SweepPlan, NamesTheValueThatIsNotAllowed) {
  for (const auto& [text, message] :
       std::vector<std::pair<std::string, std::string>>{
           {"rule=:a=1", "does not start with a name"},
           {"rule=adam|newton", "adam|newton"},
           {"rule=adam:", "adam:"},
           {"rule=adam:step_size", "step_size"},
           {"rule=adam:step_size=1||2", "step_size="},
           {"lambda=1,-3;num_samples=8,9;rule=adam", "lambda=-3"},
           {"lambda=1,2;num_samples=8,0;rule=adam", "num_samples=0"},
           {"rule=half_inverse;truncation=1e-3,5", "truncation=5"},
           {"truncation=1e-3,5;step_size=1,2;rule=half_inverse",
            "truncation=5"},
           {"hidden=3,4-x;activation=relu;rule=adam", "hidden=4-x"},
           {"hidden=3,4;activation=relu,sine;rule=adam",
            "activation=sine is no choice"},
           {"truncation=1e-3,0;step_size=1,-2;rule=adam,half_inverse",
            "step_size=-2"}}) {
    SCOPED_TRACE(text);
    Grid grid;
    SweepPlan plan;
    std::string error;
    ASSERT_TRUE(ParseGrid(text, &grid, &error)) << error;
    EXPECT_FALSE(MakeSweepPlan({"toy_network", {}, -1}, grid, &plan, &error));
    EXPECT_EQ(error.rfind("--grid: ", 0), 0u) << error;
    EXPECT_NE(error.find(message), std::string::npos) << error;
  }
}

TEST(SweepPlan, OptionsOfRulesGoToThoseThatHaveThem) {
  const SweepPlan plan = Plan(
      "truncation=1e-3,1e-6;rule=half_inverse,adam,gauss_newton:truncation=0");
  ASSERT_EQ(plan.points.size(), 6u);
  EXPECT_EQ(plan.jobs.size(), 4u);
  EXPECT_EQ(plan.jobs[plan.points[0].job].method.label,
            "half_inverse:truncation=1e-3");
  EXPECT_EQ(plan.jobs[plan.points[3].job].method.label,
            "half_inverse:truncation=1e-6");
  EXPECT_EQ(plan.points[1].job, plan.points[4].job);
  // Its own setting goes first.
  EXPECT_EQ(plan.points[2].job, plan.points[5].job);
  EXPECT_EQ(plan.jobs[plan.points[2].job].method.label,
            "gauss_newton:truncation=0");
}

TEST(SweepPlan, ARulesOwnBatchSizeGoesFirst) {
  const SweepPlan plan = Plan("batch_size=8,0;rule=adam,adam:batch_size=4");
  EXPECT_EQ(plan.jobs.size(), 3u);
  EXPECT_EQ(plan.jobs[plan.points[0].job].batch_size, 8);
  EXPECT_EQ(plan.jobs[plan.points[1].job].method.last_phase().batch_size, 4);
  EXPECT_EQ(plan.jobs[plan.points[2].job].batch_size, 256);
  EXPECT_EQ(plan.jobs[1].name, "1-adam-batch_size-4-batch4-seed1");
  EXPECT_EQ(plan.points[1].job, plan.points[3].job);
}

TEST(SweepPlan, PhasesWithoutABatchSizeTakeTheAxis) {
  const SweepPlan plan = Plan(
      "batch_size=8,16;truncation=1e-3;"
      "rule=adam:epochs=1>half_inverse:batch_size=4");
  ASSERT_EQ(plan.jobs.size(), 2u);
  EXPECT_EQ(plan.jobs[1].method.label,
            "adam:epochs=1>half_inverse:batch_size=4:truncation=1e-3");
  EXPECT_EQ(plan.jobs[1].batch_size, 16);
  EXPECT_EQ(plan.jobs[1].name,
            "1-adam-epochs-1-half_inverse-batch_size-4-truncation-1e-3-"
            "batch16+4-seed1");
}

TEST(SweepPlan, TheNetworkIsAnAxis) {
  const SweepPlan plan = Plan(
      "hidden=3,4-5;activation=tanh,relu;initialization=he;"
      "lambda=1,0.1;rule=adam");
  ASSERT_EQ(plan.jobs.size(), 8u);
  const SweepJob& last = plan.jobs[7];
  EXPECT_EQ(last.name,
            "7-hidden-4-5-activation-relu-initialization-he-lambda-0.1-adam-"
            "batch256-seed1");
  const DenseNetwork& network = *last.learning().model->dense_network();
  EXPECT_EQ(network.widths(), (std::vector<int>{1, 4, 5, 2}));
  EXPECT_EQ(network.hidden_activation(), Activation::kRelu);
  EXPECT_EQ(last.learning().initialization, Initialization::kHeUniform);
  EXPECT_EQ(plan.jobs[0].learning().model->dense_network()->widths(),
            (std::vector<int>{1, 3, 2}));
  // The physics of a point is made once.
  EXPECT_EQ(&plan.jobs[5].learning().model->simulator(),
            &plan.jobs[7].learning().model->simulator());
}

TEST(SweepPlan, TheCommandLinesNetworkStandsWhereNoAxisSetsIt) {
  Grid grid;
  SweepPlan plan;
  std::string error;
  ASSERT_TRUE(ParseGrid("activation=relu,gelu;rule=adam", &grid, &error));
  SweepBase base{"toy_network", {"4-5", "sigmoid", ""}, -1};
  ASSERT_TRUE(MakeSweepPlan(base, grid, &plan, &error)) << error;
  ASSERT_EQ(plan.jobs.size(), 2u);
  const DenseNetwork& network = *plan.jobs[1].learning().model->dense_network();
  EXPECT_EQ(network.widths(), (std::vector<int>{1, 4, 5, 2}));
  EXPECT_EQ(network.hidden_activation(), Activation::kGelu);
  base.network.hidden = "4-five";
  EXPECT_FALSE(MakeSweepPlan(base, grid, &plan, &error));
  EXPECT_EQ(error.rfind("--hidden=4-five: ", 0), 0u) << error;
}

TEST(SweepPlan, EveryTorchScriptFileIsANetworkOfItsOwn) {
  SetTorchScriptLoader([](const std::string& path,
                          const std::vector<std::int64_t>& input_shape,
                          bool /*double_precision*/,
                          std::string* /*error*/) {
    const std::vector<int> widths = {
        static_cast<int>(input_shape[0]), static_cast<int>(path.size()), 2};
    return std::make_shared<DenseNetwork>(widths, Activation::kTanh);
  });
  const SweepPlan plan = Plan("torch_script=a.pt,large.pt;rule=adam");
  ASSERT_EQ(plan.jobs.size(), 2u);
  EXPECT_EQ(plan.jobs[0].learning().model->dense_network()->widths()[1], 4);
  EXPECT_EQ(plan.jobs[1].learning().model->dense_network()->widths()[1], 8);
}

}  // namespace sweep_grid_test
}  // namespace invgrad
