#include "invgrad/train/rule_engine.h"

#include <limits>
#include <utility>

#include "fmt/core.h"
#include "glog/logging.h"

namespace invgrad {

RuleEngine::RuleEngine(const Options& options,
                       std::unique_ptr<BatchObjective> objective,
                       std::shared_ptr<UpdateRule> rule,
                       const DataSet* train)
    : options_(options),
      objective_(std::move(objective)),
      rule_(std::move(rule)),
      train_(*train),
      steps_per_epoch_(train->num_samples() / options.batch_size),
      shuffle_(options.seed) {
  CHECK_GT(steps_per_epoch_, 0);
}

DataSet RuleEngine::NextBatch() {
  const long in_epoch = step_ % steps_per_epoch_;
  const int first = static_cast<int>(in_epoch) * options_.batch_size;
  if (!options_.shuffle) return train_.Range(first, options_.batch_size);
  if (in_epoch == 0) order_ = shuffle_.Permutation(train_.num_samples());
  const auto begin = order_.begin() + first;
  return train_.Select(std::vector<int>(begin, begin + options_.batch_size));
}

Engine::StepResult RuleEngine::Step(double progress, Eigen::VectorXd* weights) {
  StepResult result;
  const DataSet batch = NextBatch();
  Linearization at_weights;
  at_weights.progress = progress;
  bool is_finite = Linearize(batch, *weights, &at_weights, &result.message);
  if (!is_finite && TakeBack(weights)) {
    is_finite = Linearize(batch, *weights, &at_weights, &result.message);
  }
  if (is_finite) {
    last_good_weights_ = *weights;
    result.batch_loss = at_weights.cost;
  }
  const long num_taken_back = num_taken_back_;
  if (!is_finite || !Update(batch, &at_weights, weights, &result.message)) {
    RestoreLastGood(weights);
    return result;
  }
  ++step_;
  result.outcome = StepResult::Outcome::kStepped;
  result.iteration.step_is_valid = true;
  result.iteration.step_is_successful = num_taken_back_ == num_taken_back;
  result.iteration.cost = result.batch_loss;
  if (at_weights.gradient.size() > 0) {
    result.iteration.gradient_max_norm =
        at_weights.gradient.lpNorm<Eigen::Infinity>();
  }
  result.iteration.step_norm = (*weights - last_good_weights_).norm();
  return result;
}

bool RuleEngine::Linearize(const DataSet& batch,
                           const Eigen::VectorXd& weights,
                           Linearization* at_weights,
                           std::string* error) {
  return objective_->Linearize(
      weights, batch, rule_->Needs(), at_weights, error);
}

bool RuleEngine::Update(const DataSet& batch,
                        Linearization* at_weights,
                        Eigen::VectorXd* weights,
                        std::string* error) {
  const bool judges = rule_->JudgesSteps();
  Eigen::VectorXd step;
  for (int k = 0; k < objective_->updates_per_step(); ++k) {
    if (k > 0 && !objective_->LinearizeAgain(
                     *weights, batch, rule_->Needs(), at_weights, error)) {
      return false;
    }
    if (judges && objective_->is_proxy()) {
      at_weights->cost = JudgedCost(batch, *weights);
    }
    if (!rule_->ComputeStep(*at_weights, &step, error)) return false;
    const Eigen::VectorXd before = *weights;
    *weights += step;
    if (judges && !rule_->KeepsStep(JudgedCost(batch, *weights), 1.0)) {
      // Not weights - step, which has rounding errors.
      *weights = before;
      ++num_taken_back_;
    }
  }
  return true;
}

double RuleEngine::JudgedCost(const DataSet& batch,
                              const Eigen::VectorXd& weights) {
  Linearization at_weights;
  std::string ignored;
  return objective_->LinearizeAgain(
             weights, batch, LinearizationParts(), &at_weights, &ignored)
             ? at_weights.cost
             : std::numeric_limits<double>::quiet_NaN();
}

bool RuleEngine::TakeBack(Eigen::VectorXd* weights) {
  if (!rule_->JudgesSteps() || last_good_weights_.size() == 0 ||
      *weights == last_good_weights_) {
    return false;
  }
  *weights = last_good_weights_;
  rule_->KeepsStep(std::numeric_limits<double>::quiet_NaN(), 1.0);
  ++num_taken_back_;
  return true;
}

void RuleEngine::RestoreLastGood(Eigen::VectorXd* weights) {
  if (last_good_weights_.size() > 0) *weights = last_good_weights_;
}

void RuleEngine::VisitState(StateArchive* archive) {
  archive->Expect("batch_size", options_.batch_size);
  archive->Expect("num_samples", train_.num_samples());
  archive->Visit("steps_of_phase", &step_);
  archive->Visit("num_taken_back", &num_taken_back_);
  archive->Visit("last_good_weights", &last_good_weights_);
  archive->Visit("order", &order_);
  archive->Require(
      !options_.shuffle || step_ % steps_per_epoch_ == 0 ||
          order_.size() == static_cast<size_t>(train_.num_samples()),
      "order");
  Eigen::VectorXd shuffle = shuffle_.State();
  archive->Visit("shuffle", &shuffle);
  archive->Require(shuffle_.SetState(shuffle), "shuffle");
  const std::vector<Eigen::VectorXd*> rule_state = rule_->MutableState();
  for (size_t i = 0; i < rule_state.size(); ++i) {
    // An array that is not empty before the first step keeps its size.
    const Eigen::Index size = rule_state[i]->size();
    archive->Visit(fmt::format("rule_{}", i),
                   rule_state[i],
                   archive->is_reading() && size > 0 ? size : -1);
  }
  PullBackCounts* const counts = objective_->mutable_counts();
  if (counts == nullptr) return;
  Eigen::VectorXd state = counts->State();
  archive->Visit("pull_back", &state);
  archive->Require(counts->SetState(state), "pull_back");
}

std::string RuleEngine::Finish() {
  const std::string report = counts() == nullptr ? "" : counts()->Report();
  return report.empty() ? "" : "; " + report;
}

}  // namespace invgrad
