#include "invgrad/methods/method.h"

#include <cctype>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "ceres/iteration_callback.h"
#include "gtest/gtest.h"
#include "invgrad/chain/autodiff_loss.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/minimize/method_minimization.h"
#include "invgrad/train/evaluation.h"
#include "invgrad/train/train.h"

namespace invgrad {
namespace {

struct QuarticLoss {
  template <typename T>
  bool operator()(const T* y, const double* target, T* loss) const {
    const T r = y[0] - target[0];
    *loss = r * r * r * r;
    return true;
  }
};

// y = 2 a - 1 to be learnt by 1-3-1, 12 samples, no test data.
struct Line {
  Model model;
  DataSet train;
  DataSet test;
  Eigen::VectorXd weights;

  explicit Line(std::shared_ptr<const Loss> loss =
                    std::make_shared<SquaredNormLoss>(1, 1.0),
                int num_hidden = 3)
      : model(DenseNetwork({1, num_hidden, 1}, Activation::kTanh),
              std::make_shared<IdentitySimulator>(1),
              std::move(loss),
              Reduction::kMean) {
    NumpyRandom random(5);
    train.inputs = random.Rand(1, 12);
    train.contexts.resize(0, 12);
    train.targets = 2.0 * train.inputs.array() - 1.0;
    train.solutions = train.targets;
    test = train.Range(0, 0);
    weights =
        model.network().InitialWeights(Initialization::kGlorotUniform, &random);
  }
};

Method Parse(const std::string& text) {
  std::vector<Method> methods;
  std::string error;
  EXPECT_TRUE(ParseMethods(text, &methods, &error)) << error;
  EXPECT_EQ(methods.size(), 1u);
  return methods.at(0);
}

// Of a method in one phase.
Phase ParsePhase(const std::string& text) { return Parse(text).phases.at(0); }

TrainResult TrainLine(const std::string& method,
                      const Line& line,
                      TrainOptions options) {
  options.initial_weights = line.weights;
  return Train(line.model, {line.train, line.test}, method, options);
}

TrainOptions Epochs(int num_epochs) {
  TrainOptions options;
  options.max_num_epochs = num_epochs;
  options.batch_size = 0;
  return options;
}

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
                                "newton"}) {
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

// --- Parsing ---

TEST(Method, SettingsOfAChainGoToTheRuleIfItHasThemAndElseToTheWays) {
  const Phase phase = ParsePhase(
      "newton/inverse/half_inverse:truncation=1e-3:y_step_size=0.5:"
      "batch_size=4");
  EXPECT_EQ(phase.rule->name, "half_inverse");
  EXPECT_EQ(phase.ceres, nullptr);
  EXPECT_EQ(phase.rule_settings, (Settings{{"truncation", "1e-3"}}));
  ASSERT_TRUE(phase.pull_back.has_value());
  EXPECT_EQ(phase.pull_back->ChainOptions().y_step_size, 0.5);
  EXPECT_EQ(phase.batch_size, 4);
}

TEST(Method, NamedChainsHaveDefaultsThatSettingsReplace) {
  EXPECT_EQ(ParsePhase("physical_gradient").rule_settings,
            (Settings{{"step_size", "1"}}));
  EXPECT_EQ(ParsePhase("physical_gradient:step_size=0.1").rule_settings,
            (Settings{{"step_size", "0.1"}}));
  EXPECT_TRUE(ParsePhase("hig").pull_back->is_joint());
  EXPECT_EQ(
      ParsePhase("physics_informed").pull_back->ChainOptions().data_weight,
      1.0);
}

TEST(Method, SettingsGoToTheRuleIfItHasThemAndElseToCeres) {
  const Phase phase = ParsePhase(
      "ceres_lm+half_inverse:truncation=1e-3:initial_trust_region_radius=10:"
      "batch_size=4");
  EXPECT_EQ(phase.rule->name, "half_inverse");
  EXPECT_EQ(phase.ceres->name, "ceres_lm");
  EXPECT_EQ(phase.rule_settings, (Settings{{"truncation", "1e-3"}}));
  EXPECT_EQ(phase.ceres_settings,
            (Settings{{"initial_trust_region_radius", "10"}}));
  EXPECT_EQ(phase.batch_size, 4);
}

TEST(Method, WhatHasNoRuleMakesNone) {
  EXPECT_EQ(ParsePhase("ceres_bfgs").MakeRule(), nullptr);
  EXPECT_NE(ParsePhase("adam").MakeRule(), nullptr);
  EXPECT_EQ(ParsePhase("adam").batch_size, -1);
}

TEST(Method, RefusesWhatItCannotRunAndSaysWhy) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"adm", "adam"},
      {"ceres_lmm", "ceres_lm"},
      {"ceres_bfgs+adam", "not to 'ceres_bfgs'"},
      {"adam+adam", "not to 'adam'"},
      {"+adam", "not to ''"},
      {"ceres_lm+", "unknown rule ''"},
      {"ceres_lm+ceres_lm", "unknown rule 'ceres_lm'"},
      {"adam:batch_size=-1", "batch_size=-1"},
      {"adam:batch_size=few", "batch_size=few"},
      {"adam:step_size=0", "step_size=0"},
      {"ceres_lm:trunc=1", "trunc"},
      {"adam,adam", "twice"},
      {"", "name"},
      {"adam,", "name"},
      {"newton/inverse", "LOSS/SIMULATOR/RULE"},
      {"newton/inverse/adam/adam", "LOSS/SIMULATOR/RULE"},
      {"newton/inverse/adm", "adam"},
      {"newtn/inverse/adam", "saddle_free_newton"},
      {"newton/inverted/adam", "numerical"},
      {"newton/inverse/ceres_lm", "unknown rule 'ceres_lm'"},
      {"sip:y_step_size=0", "y_step_size=0"},
      {"hig:proxy=l1", "proxy"},
      {"sip:newton_steps=2", "newton_steps"},
      {"sip:stepsize=1e-3", "did you mean step_size"},
      {"sip:proxi=l1", "did you mean proxy"},
  };
  for (const auto& [text, word] : cases) {
    SCOPED_TRACE(text);
    std::vector<Method> methods;
    std::string error;
    EXPECT_FALSE(ParseMethods(text, &methods, &error));
    EXPECT_NE(error.find(word), std::string::npos) << error;
  }
}

// --- Training ---

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

class StopAt final : public ceres::IterationCallback {
 public:
  StopAt(int step, ceres::CallbackReturnType verdict)
      : step_(step), verdict_(verdict) {}
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    return iteration.iteration >= step_ ? verdict_ : ceres::SOLVER_CONTINUE;
  }

 private:
  int step_;
  ceres::CallbackReturnType verdict_;
};

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

TEST(Method, PatienceEndsCeresToo) {
  Line line;
  // The test loss rises as the train loss falls: its target is the opposite.
  line.test = line.train;
  line.test.targets *= -1.0;
  TrainOptions options = Epochs(1000);
  options.patience = 4;
  const TrainResult result = TrainLine("ceres_steepest_descent", line, options);
  EXPECT_EQ(result.summary.message, "no improvement in 4 evaluations");
  EXPECT_EQ(result.summary.termination_type, ceres::CONVERGENCE);
}

TEST(Method, NonmonotonicStepsEndWithTheBestWeights) {
  const Line line;
  for (int epochs = 1; epochs <= 20; ++epochs) {
    const TrainResult result = TrainLine(
        "ceres_dogleg:use_nonmonotonic_steps=true", line, Epochs(epochs));
    EXPECT_NEAR(result.history.back().train_loss,
                MeanLoss(line.model, result.weights, line.train),
                1e-13);
  }
}

TEST(Method, TrustRegionsNeedALeastSquaresLoss) {
  const Line line(
      std::make_shared<AutoDiffLoss<QuarticLoss, 1>>(QuarticLoss()));
  EXPECT_NE(TrainLine("ceres_lm", line, Epochs(1)).error, "");
  EXPECT_NE(TrainLine("ceres_lm+adam", line, Epochs(1)).error, "");
  EXPECT_EQ(TrainLine("ceres_bfgs", line, Epochs(1)).error, "");
  EXPECT_EQ(TrainLine("half_inverse", line, Epochs(1)).error, "");
}

TEST(Method, ANeuronTooWideForProposalsIsRefused) {
  // The output neuron has 600 weights and a bias, 512 are allowed.
  const Line line(std::make_shared<SquaredNormLoss>(1, 1.0), 600);
  const TrainResult result =
      TrainLine("ceres_lm+half_inverse", line, Epochs(1));
  EXPECT_NE(result.error, "");
  EXPECT_NE(result.error.find("512"), std::string::npos) << result.error;
}

// --- Minimizing ---

// L = 1/2 |x - (1, 2)|^2 or (x_0 - 1)^4.
ChainObjective Objective(std::shared_ptr<const Loss> loss) {
  const int size = loss->size();
  return ChainObjective(std::make_shared<IdentitySimulator>(size),
                        std::move(loss),
                        Eigen::VectorXd::LinSpaced(size, 1.0, size),
                        Eigen::VectorXd::Constant(size, 5.0));
}

TEST_P(EveryMethod, ThePathBeginsAtTheStartAndEndsAtTheState) {
  if (IsSupervised(GetParam()) || NeedsBatches(GetParam())) {
    ChainObjective point = Objective(std::make_shared<SquaredNormLoss>(2, 0.5));
    std::vector<Eigen::VectorXd> path;
    MinimizerSummary summary;
    std::string error;
    EXPECT_FALSE(MinimizeByMethod(Parse(GetParam()),
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
  ChainObjective objective =
      Objective(std::make_shared<SquaredNormLoss>(2, 0.5));
  const Eigen::VectorXd start = objective.State();
  MinimizerOptions options;
  // Ceres may reject a proposal three times before it takes a step of its own.
  options.max_num_iterations = 6;
  std::vector<Eigen::VectorXd> path;
  MinimizerSummary summary;
  std::string error;
  ASSERT_TRUE(MinimizeByMethod(
      Parse(GetParam()), options, nullptr, &objective, &path, &summary, &error))
      << error;
  if (GetParam() == "kfac_half_inverse") {
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
  ChainObjective objective =
      Objective(std::make_shared<SquaredNormLoss>(2, 0.5));
  const Eigen::VectorXd start = Eigen::Vector2d(1e200, 0.0);
  objective.SetState(start);
  std::vector<Eigen::VectorXd> path;
  MinimizerSummary summary;
  std::string error;
  ASSERT_TRUE(MinimizeByMethod(Parse(GetParam()),
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

TEST(Method, ALossWithoutResidualsIsMinimizedByRulesAndLineSearches) {
  for (const char* name : {"ceres_bfgs", "newton", "gradient_descent"}) {
    SCOPED_TRACE(name);
    ChainObjective objective = Objective(
        std::make_shared<AutoDiffLoss<QuarticLoss, 1>>(QuarticLoss()));
    MinimizerOptions options;
    options.max_num_iterations = 5;
    std::vector<Eigen::VectorXd> path;
    MinimizerSummary summary;
    std::string error;
    ASSERT_TRUE(MinimizeByMethod(
        Parse(name), options, nullptr, &objective, &path, &summary, &error))
        << error;
    EXPECT_LT(std::abs(objective.State()[0] - 1.0), 4.0);
  }
  ChainObjective objective =
      Objective(std::make_shared<AutoDiffLoss<QuarticLoss, 1>>(QuarticLoss()));
  std::vector<Eigen::VectorXd> path;
  MinimizerSummary summary;
  std::string error;
  EXPECT_FALSE(MinimizeByMethod(Parse("ceres_lm"),
                                MinimizerOptions(),
                                nullptr,
                                &objective,
                                &path,
                                &summary,
                                &error));
  EXPECT_NE(error.find("a trust region needs a least-squares loss"),
            std::string::npos)
      << error;
}

}  // namespace
}  // namespace invgrad
