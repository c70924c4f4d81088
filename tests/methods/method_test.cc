#include "invgrad/method.h"

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/autodiff_loss.h"
#include "invgrad/loss.h"
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
namespace method_test {

struct QuarticLoss {
  template <typename T>
  bool operator()(const T* y, const double* target, T* loss) const {
    const T r = y[0] - target[0];
    *loss = r * r * r * r;
    return true;
  }
};

// Of a method in one phase.
Phase ParsePhase(const std::string& text) {
  return ParseMethod(text).phases.at(0);
}

// --- Parsing ---

TEST(Method, ADefaultThatIsWrittenChangesNothing) {
  EXPECT_TRUE(ParsePhase("adaptive").races_batch_size);
  EXPECT_TRUE(ParsePhase("adaptive:output_layer=trained").races_batch_size);
  EXPECT_FALSE(ParsePhase("adaptive:output_layer=exact").races_batch_size);
  EXPECT_FALSE(ParsePhase("adaptive:batch_size=8").races_batch_size);
}

TEST(Method, SettingsOfAChainGoToTheRuleIfItHasThemAndElseToTheWays) {
  const Phase phase = ParsePhase(
      "newton/inverse/half_inverse:truncation=1e-3:y_step_size=0.5:"
      "batch_size=4");
  EXPECT_EQ(phase.rule->name, "half_inverse");
  EXPECT_EQ(phase.ceres, nullptr);
  EXPECT_EQ(phase.rule_settings, (Settings{{"truncation", "1e-3"}}));
  ASSERT_TRUE(phase.pull_back != nullptr);
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

TEST(Method, ALossWithoutResidualsIsMinimizedByRulesAndLineSearches) {
  for (const char* name : {"ceres_bfgs", "newton", "gradient_descent"}) {
    SCOPED_TRACE(name);
    PointObjective objective = Objective(
        std::make_shared<AutoDiffLoss<QuarticLoss, 1>>(QuarticLoss()));
    MinimizerOptions options;
    options.max_num_iterations = 5;
    std::vector<Eigen::VectorXd> path;
    MinimizerSummary summary;
    std::string error;
    ASSERT_TRUE(MinimizeByMethod(ParseMethod(name),
                                 options,
                                 nullptr,
                                 &objective,
                                 &path,
                                 &summary,
                                 &error))
        << error;
    EXPECT_LT(std::abs(objective.State()[0] - 1.0), 4.0);
  }
  PointObjective objective =
      Objective(std::make_shared<AutoDiffLoss<QuarticLoss, 1>>(QuarticLoss()));
  std::vector<Eigen::VectorXd> path;
  MinimizerSummary summary;
  std::string error;
  EXPECT_FALSE(MinimizeByMethod(ParseMethod("ceres_lm"),
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

TEST(Method, APointHasNoBatches) {
  for (const char* name : {"gradient_descent:batch_size=8",
                           "gradient/adjoint/adam:batch_size=8",
                           "ceres_lm+half_inverse:batch_size=8"}) {
    SCOPED_TRACE(name);
    PointObjective objective =
        Objective(std::make_shared<SquaredNormLoss>(2, 0.5));
    std::vector<Eigen::VectorXd> path;
    MinimizerSummary summary;
    std::string error;
    EXPECT_FALSE(MinimizeByMethod(ParseMethod(name),
                                  MinimizerOptions(),
                                  nullptr,
                                  &objective,
                                  &path,
                                  &summary,
                                  &error));
    EXPECT_EQ(error, "batch_size needs a network to train");
  }
}

}  // namespace method_test
}  // namespace invgrad
