#include "invgrad/train/make_engine.h"

#include <algorithm>
#include <utility>

#include "fmt/core.h"
#include "invgrad/ceres/model_cost.h"
#include "invgrad/inverse/batch_objective.h"
#include "invgrad/inverse/chain_pull_back.h"
#include "invgrad/minimize/method_minimization.h"
#include "invgrad/train/ceres_engine.h"
#include "invgrad/train/rule_engine.h"
#include "invgrad/train/training_memory.h"

namespace invgrad {
namespace {

// Returns false if the pull-back cannot train this model on these data.
bool CheckPullBack(const PullBackMethod& pull_back,
                   const UpdateRule& rule,
                   const Model& model,
                   const DataSet& train,
                   std::string* error) {
  const bool is_closed_loop = model.feedback() != nullptr;
  if (is_closed_loop && pull_back.updates() > 1) {
    *error =
        "updates > 1: in a closed loop an update moves the inputs of the next "
        "one";
  } else if (is_closed_loop && !pull_back.is_joint() && rule.JudgesSteps()) {
    *error =
        "control=gain: in a closed loop an update moves the inputs of what is "
        "pulled back";
  } else if (pull_back.needs_solutions() && train.solutions.rows() == 0) {
    *error = "the training data have no solutions x* to learn from";
  } else {
    return pull_back.CanPullBack(model.simulator(), error);
  }
  return false;
}

// The batch size of the phase; -1, with *error set, if it is out of range.
int CheckBatchSize(int wanted, int num_samples, std::string* error) {
  if (wanted < 0) return std::min(TrainOptions::kDefaultBatchSize, num_samples);
  if (wanted == 0) return num_samples;
  if (wanted <= num_samples) return wanted;
  *error = fmt::format(
      "batch_size={} is out of range; allowed: 1 to the {} training samples, "
      "or 0 for all",
      wanted,
      num_samples);
  return -1;
}

std::unique_ptr<Engine> MakeRuleEngine(
    std::shared_ptr<UpdateRule> rule,
    std::unique_ptr<BatchObjective> objective,
    int batch_size,
    const Model& model,
    const TrainingData& data,
    const TrainOptions& options,
    std::string* error) {
  if (!objective->is_proxy() && !model.CanLinearize(rule->Needs(), error)) {
    return nullptr;
  }
  batch_size = CheckBatchSize(batch_size, data.train.num_samples(), error);
  if (batch_size < 0 || !TrainingFits(model,
                                      data,
                                      *rule,
                                      objective->is_proxy(),
                                      batch_size,
                                      options.memory_limit,
                                      error)) {
    return nullptr;
  }
  RuleEngine::Options engine_options;
  engine_options.batch_size = batch_size;
  engine_options.shuffle = options.shuffle;
  engine_options.seed = options.seed;
  return std::make_unique<RuleEngine>(
      engine_options, std::move(objective), std::move(rule), &data.train);
}

std::unique_ptr<Engine> MakeCeresEngine(const Phase& phase,
                                        const Model& model,
                                        const TrainingData& data,
                                        const TrainOptions& options,
                                        const Eigen::VectorXd& weights,
                                        std::string* error) {
  const bool is_trust_region = phase.ceres->is_trust_region;
  if (is_trust_region && !model.loss().SquaredNormFactor().has_value()) {
    *error = kNeedsLeastSquares;
    return nullptr;
  }
  if (!CeresFits(phase, model, data, options.memory_limit, error)) {
    return nullptr;
  }
  if (phase.rule != nullptr) {
    if (!model.CanLinearize(phase.MakeRule()->Needs(), error)) return nullptr;
    Eigen::VectorXd any_weights = weights;
    ceres::Problem problem;
    AddModelToProblem(&model, &data.train, &any_weights, &problem);
    if (!TakesProposals(phase, problem, error)) return nullptr;
  }
  return std::make_unique<CeresEngine>(phase, &model, &data.train);
}

}  // namespace

std::unique_ptr<Engine> MakeEngine(const Phase& phase,
                                   const Model& model,
                                   const TrainingData& data,
                                   const TrainOptions& options,
                                   const Eigen::VectorXd& weights,
                                   std::string* error) {
  if (phase.ceres != nullptr) {
    return MakeCeresEngine(phase, model, data, options, weights, error);
  }
  std::shared_ptr<UpdateRule> rule = phase.MakeRule();
  std::unique_ptr<BatchObjective> objective;
  if (!phase.pull_back.has_value()) {
    objective = std::make_unique<ModelObjective>(model);
  } else {
    const PullBackMethod& pull_back = *phase.pull_back;
    if (!CheckPullBack(pull_back, *rule, model, data.train, error)) {
      return nullptr;
    }
    if (pull_back.is_joint()) {
      objective = std::make_unique<ModelObjective>(model.WithLoss(
          pull_back.MakeLoss(model.shared_loss()), model.reduction()));
    } else {
      objective = std::make_unique<ChainPullBack>(
          &model, options.inverse, pull_back.ChainOptions());
    }
  }
  const int batch_size =
      phase.batch_size >= 0 ? phase.batch_size : options.batch_size;
  return MakeRuleEngine(std::move(rule),
                        std::move(objective),
                        batch_size,
                        model,
                        data,
                        options,
                        error);
}

std::unique_ptr<Engine> MakeEngine(std::shared_ptr<UpdateRule> rule,
                                   const Model& model,
                                   const TrainingData& data,
                                   const TrainOptions& options,
                                   std::string* error) {
  return MakeRuleEngine(std::move(rule),
                        std::make_unique<ModelObjective>(model),
                        options.batch_size,
                        model,
                        data,
                        options,
                        error);
}

}  // namespace invgrad
