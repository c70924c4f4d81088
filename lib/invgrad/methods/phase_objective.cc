#include "invgrad/methods/phase_objective.h"

#include <limits>
#include <utility>

#include "invgrad/core/hessian_times.h"
#include "invgrad/inverse/chain_pull_back.h"
#include "invgrad/methods/pull_back_method.h"

namespace invgrad {
namespace {

// Returns false if the pull-back cannot train this model on these data.
bool CheckPullBack(const PullBackMethod& pull_back,
                   UpdateRule* rule,
                   const Model& model,
                   const DataSet& train,
                   std::string* error) {
  const bool is_closed_loop = model.feedback() != nullptr;
  if (is_closed_loop && pull_back.updates() > 1) {
    *error =
        "updates > 1: in a closed loop an update moves the inputs of the next "
        "one";
  } else if (is_closed_loop && !pull_back.is_joint() && ComparesCosts(rule)) {
    *error = std::string(kComparesCosts) +
             "in a closed loop an update moves the inputs of what is pulled "
             "back";
  } else if (pull_back.is_joint() && !pull_back.lowers_loss() &&
             ComparesCosts(rule)) {
    *error = std::string(kComparesCosts) + kJointStepHasNoCost;
  } else if (pull_back.needs_solutions() && train.solutions.rows() == 0) {
    *error = "the training data have no solutions x* to learn from";
  } else {
    return pull_back.CanPullBack(model.simulator(), error);
  }
  return false;
}

}  // namespace

bool ComparesCosts(UpdateRule* rule) {
  return rule->judge() != nullptr || rule->Needs().after;
}

std::unique_ptr<BatchObjective> MakePhaseObjective(
    const Phase& phase,
    UpdateRule* rule,
    const Model& model,
    const DataSet& train,
    std::shared_ptr<const InverseSimulator> inverse,
    const Communicator* communicator,
    std::string* error) {
  if (phase.pull_back == nullptr) {
    return std::make_unique<ModelObjective>(model);
  }
  const PullBackMethod& pull_back = *phase.pull_back;
  if (!CheckPullBack(pull_back, rule, model, train, error)) {
    return nullptr;
  }
  if (pull_back.is_joint()) {
    return std::make_unique<ModelObjective>(model.WithLoss(
        pull_back.MakeLoss(model.shared_loss()), model.reduction()));
  }
  ChainPullBack::Options chain = pull_back.ChainOptions();
  chain.communicator = communicator;
  return std::make_unique<ChainPullBack>(&model, std::move(inverse), chain);
}

double CostOf(BatchObjective* objective,
              const DataSet& batch,
              const Eigen::VectorXd& weights) {
  Linearization at_weights;
  std::string ignored;
  return objective->LinearizeAgain(
             weights, batch, LinearizationParts(), &at_weights, &ignored)
             ? at_weights.cost
             : std::numeric_limits<double>::quiet_NaN();
}

bool MakeUpdates(const DataSet& batch,
                 const std::function<void(const Eigen::VectorXd& before)>& undo,
                 BatchObjective* objective,
                 UpdateRule* rule,
                 Linearization* at_weights,
                 Eigen::VectorXd* weights,
                 std::string* error) {
  StepJudge* const judge = rule->judge();
  Eigen::VectorXd step;
  for (int k = 0; k < objective->updates_per_step(); ++k) {
    if (k > 0) {
      at_weights->hessian_times = nullptr;  // of the last weights
      if (!objective->LinearizeAgain(
              *weights, batch, rule->Needs(), at_weights, error)) {
        return false;
      }
    }
    if (objective->is_proxy() && ComparesCosts(rule)) {
      at_weights->cost = CostOf(objective, batch, *weights);
    }
    // Of the loss, or of a proxy with constant x~.
    const auto after = [&](const Eigen::VectorXd& step,
                           const LinearizationParts& parts,
                           Linearization* there,
                           std::string* why) {
      Eigen::VectorXd trial = *weights;
      return objective->Plus(step, batch, &trial, why) &&
             objective->LinearizeAgain(trial, batch, parts, there, why);
    };
    AddProductsAndTrials(
        rule->Needs(), objective->Unknowns(*weights), after, at_weights);
    if (!rule->ComputeStep(*at_weights, &step, error)) return false;
    const Eigen::VectorXd before = *weights;
    const bool is_solved = objective->Plus(step, batch, weights, error);
    if (judge == nullptr) {
      if (!is_solved) return false;
      continue;
    }
    const double cost = is_solved ? CostOf(objective, batch, *weights)
                                  : std::numeric_limits<double>::quiet_NaN();
    if (!judge->KeepsStep(cost, 1.0)) undo(before);
  }
  return true;
}

}  // namespace invgrad
