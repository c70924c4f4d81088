// What holds for every method.

#include <cctype>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "ceres/iteration_callback.h"
#include "gtest/gtest.h"
#include "invgrad/loss.h"
#include "invgrad/method.h"
#include "invgrad/methods/ceres_methods.h"
#include "invgrad/methods/pull_back_method.h"
#include "invgrad/minimize.h"
#include "invgrad/minimize/method_minimization.h"
#include "invgrad/rules.h"
#include "invgrad/train.h"
#include "tests/methods/line.h"
#include "tests/support/parse_method.h"
#include "tests/support/train_options.h"

namespace invgrad {
namespace every_method_test {

std::vector<std::string> AllMethods() {
  std::vector<std::string> names;
  for (const RuleRow& row : Rules()) {
    names.push_back(row.name);
    names.push_back("ceres_lm+" + row.name);
    names.push_back("ceres_dogleg+" + row.name);
  }
  for (const CeresMethodRow& row : CeresMethods()) names.push_back(row.name);
  for (const ChainMethodRow& row : ChainMethods()) names.push_back(row.name);
  // All ways through the simulator; through the loss and the network some.
  for (const char* simulator : {"joint",
                                "adjoint",
                                "inverse_gradient",
                                "half_inverse",
                                "inverse",
                                "numerical",
                                "newton",
                                "gradient_descent",
                                "lbfgs"}) {
    names.push_back(std::string("newton/") + simulator + "/adam");
    names.push_back(std::string("gradient/") + simulator + "/half_inverse");
  }
  names.emplace_back("saddle_free_newton/inverse/newton");
  names.emplace_back("newton/inverse/gauss_newton:step_size=0.5:updates=3");
  names.emplace_back("sip:proxy=l1:curvature_weight=0.5:max_change=0.1");
  return names;
}

// Whether it learns from solutions, which a point has not.
bool IsSupervised(const std::string& name) {
  return name == "supervised" || name == "physics_informed";
}

// Whether it has settings that mean something for batches only.
bool NeedsBatches(const std::string& name) {
  return name.find("proxy") != std::string::npos ||
         name.find("updates") != std::string::npos;
}

class EveryMethod : public ::testing::TestWithParam<std::string> {};

// The history's loss is that of the weights, whoever took the steps.
TEST_P(EveryMethod, TrainsAndRecordsTheLossOfItsWeights) {
  const Line line;
  const TrainResult result = TrainLine(GetParam(), line, Epochs(5));
  ASSERT_EQ(result.error, "");
  EXPECT_NE(result.summary.termination_type, ceres::FAILURE)
      << result.summary.message;
  EXPECT_EQ(result.history.front().step, 0);
  EXPECT_NEAR(result.history.front().train_loss,
              MeanLoss(line.model, line.weights, line.train),
              1e-14);
  EXPECT_EQ(result.history.back().step, result.summary.num_steps);
  // Ceres' cost and the model's are summed in another order.
  EXPECT_NEAR(result.history.back().train_loss,
              MeanLoss(line.model, result.weights, line.train),
              1e-13);
  EXPECT_LE(result.summary.num_steps, 5);
}

// Whoever takes the steps.
TEST_P(EveryMethod, TheMetricIsThatOfTheWeights) {
  const Line line;
  TrainOptions options = Epochs(2);
  options.metric = [](const Eigen::VectorXd& weights) {
    return weights.squaredNorm();
  };
  const TrainResult result = TrainLine(GetParam(), line, options);
  ASSERT_EQ(result.error, "");
  EXPECT_EQ(result.history.front().metric, line.weights.squaredNorm());
  EXPECT_EQ(result.history.back().metric, result.weights.squaredNorm());
}

TEST_P(EveryMethod, NoBudgetIsNoStep) {
  const Line line;
  const TrainResult result = TrainLine(GetParam(), line, Epochs(0));
  ASSERT_EQ(result.error, "");
  EXPECT_EQ(result.summary.num_steps, 0);
  EXPECT_EQ(result.history.size(), 1u);
  EXPECT_EQ(result.weights, line.weights);
}

TEST_P(EveryMethod, RefusesDataThatAreNotFinite) {
  Line line;
  line.train.targets(0, 7) = std::nan("");
  const TrainResult result = TrainLine(GetParam(), line, Epochs(1));
  EXPECT_NE(result.error, "");
  EXPECT_NE(result.error.find("train data"), std::string::npos) << result.error;
}

// 1e200 is finite, and its square, the loss, is not.
TEST_P(EveryMethod, FailsWhereTheStartHasNoFiniteLoss) {
  Line line;
  line.train.targets(0, 7) = 1e200;
  const TrainResult result = TrainLine(GetParam(), line, Epochs(3));
  ASSERT_EQ(result.error, "");
  EXPECT_EQ(result.summary.termination_type, ceres::FAILURE);
  EXPECT_FALSE(result.summary.message.empty());
  EXPECT_EQ(result.summary.num_steps, 0);
  ASSERT_EQ(result.history.size(), 1u);
  EXPECT_FALSE(std::isfinite(result.history[0].train_loss));
  EXPECT_EQ(result.weights, line.weights);
}

TEST_P(EveryMethod, CallbacksEndTheRunAndItsResultsAreKept) {
  const Line line;
  for (const auto& [verdict, type] :
       {std::make_pair(ceres::SOLVER_ABORT, ceres::USER_FAILURE),
        std::make_pair(ceres::SOLVER_TERMINATE_SUCCESSFULLY,
                       ceres::USER_SUCCESS)}) {
    StopAt callback(2, verdict);
    TrainOptions options = Epochs(1000);
    options.callbacks.push_back(&callback);
    const TrainResult result = TrainLine(GetParam(), line, options);
    EXPECT_EQ(result.summary.termination_type, type);
    EXPECT_NE(result.summary.message.find("by a callback at step 2"),
              std::string::npos)
        << result.summary.message;
    EXPECT_EQ(result.history.back().step, 2);
    EXPECT_NEAR(result.history.back().train_loss,
                MeanLoss(line.model, result.weights, line.train),
                1e-13);
  }
}

TEST_P(EveryMethod, ATargetThatIsReachedIsConvergence) {
  const Line line;
  TrainOptions options = Epochs(100);
  options.target_loss = 1e3;
  const TrainResult result = TrainLine(GetParam(), line, options);
  EXPECT_EQ(result.summary.termination_type, ceres::CONVERGENCE);
  EXPECT_NE(result.summary.message.find("target loss reached at step 0"),
            std::string::npos)
      << result.summary.message;
}

INSTANTIATE_TEST_SUITE_P(Method,
                         EveryMethod,
                         ::testing::ValuesIn(AllMethods()),
                         [](const auto& info) {
                           std::string name = info.param;
                           for (char& c : name) {
                             if (std::isalnum(c) == 0) c = '_';
                           }
                           return name;
                         });

TEST_P(EveryMethod, ThePathBeginsAtTheStartAndEndsAtTheState) {
  if (IsSupervised(GetParam()) || NeedsBatches(GetParam())) {
    PointObjective point = Objective(std::make_shared<SquaredNormLoss>(2, 0.5));
    std::vector<Eigen::VectorXd> path;
    MinimizerSummary summary;
    std::string error;
    EXPECT_FALSE(MinimizeByMethod(ParseMethod(GetParam()),
                                  MinimizerOptions(),
                                  nullptr,
                                  &point,
                                  &path,
                                  &summary,
                                  &error));
    EXPECT_NE(error.find(IsSupervised(GetParam()) ? "no data" : "network"),
              std::string::npos)
        << error;
    return;
  }
  PointObjective objective =
      Objective(std::make_shared<SquaredNormLoss>(2, 0.5));
  const Eigen::VectorXd start = objective.State();
  MinimizerOptions options;
  // Ceres may reject a proposal three times before it takes a step of its own.
  options.max_num_iterations = 6;
  std::vector<Eigen::VectorXd> path;
  MinimizerSummary summary;
  std::string error;
  ASSERT_TRUE(MinimizeByMethod(ParseMethod(GetParam()),
                               options,
                               nullptr,
                               &objective,
                               &path,
                               &summary,
                               &error))
      << error;
  if (GetParam() == "kfac_half_inverse" || GetParam() == "kfac") {
    // A point has no layers.
    EXPECT_EQ(summary.termination_type, ceres::FAILURE);
    EXPECT_NE(summary.message.find("K-FAC needs"), std::string::npos)
        << summary.message;
    return;
  }
  EXPECT_NE(summary.termination_type, ceres::FAILURE) << summary.message;
  ASSERT_GE(path.size(), 2u);
  EXPECT_EQ(path.front(), start);
  EXPECT_EQ(path.back(), objective.State());
  double cost = 0.0;
  ASSERT_TRUE(objective.Cost(&cost, &error)) << error;
  EXPECT_LT(cost, summary.initial_cost) << summary.BriefReport();
}

TEST_P(EveryMethod, AStartWithoutAFiniteLossIsTheWholePath) {
  if (IsSupervised(GetParam()) || NeedsBatches(GetParam())) return;
  PointObjective objective =
      Objective(std::make_shared<SquaredNormLoss>(2, 0.5));
  const Eigen::VectorXd start = Eigen::Vector2d(1e200, 0.0);
  objective.SetState(start);
  std::vector<Eigen::VectorXd> path;
  MinimizerSummary summary;
  std::string error;
  ASSERT_TRUE(MinimizeByMethod(ParseMethod(GetParam()),
                               MinimizerOptions(),
                               nullptr,
                               &objective,
                               &path,
                               &summary,
                               &error))
      << error;
  EXPECT_EQ(summary.termination_type, ceres::FAILURE);
  ASSERT_EQ(path.size(), 1u);
  EXPECT_EQ(path[0], start);
}

}  // namespace every_method_test
}  // namespace invgrad
