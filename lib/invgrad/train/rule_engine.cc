#include "invgrad/train/rule_engine.h"

#include <limits>
#include <utility>

#include "fmt/core.h"
#include "invgrad/internal/logging.h"
#include "invgrad/methods/phase_objective.h"

namespace invgrad {
namespace {

// So many batches in a row without a finite loss end the run; of stored samples
// no more than an epoch has, because the weights stay as they are.
constexpr long kMaxLeftOut = 100;

}  // namespace

RuleEngine::RuleEngine(int batch_size,
                       const TrainOptions& options,
                       std::unique_ptr<BatchObjective> objective,
                       std::shared_ptr<UpdateRule> rule,
                       const Model* model,
                       const TrainingData* data)
    : Engine(data->train.num_samples() / batch_size, /*has_state=*/true),
      batch_size_(batch_size),
      batches_(options, model, data),
      judge_(rule->judge()),
      num_weights_(model->num_weights()),
      objective_(std::move(objective)),
      rule_(std::move(rule)) {}

Engine::StepResult RuleEngine::Step(double progress, Eigen::VectorXd* weights) {
  StepResult result;
  const DataSet batch = batches_.Next(step_, batch_size_, *weights);
  Linearization at_weights;
  at_weights.progress = progress;
  bool is_left_out = false;
  const bool is_finite =
      objective_->Prepare(step_, progress, batch, weights, &result.message) &&
      Begin(batch, &at_weights, weights, &is_left_out, &result.message);
  if (is_finite) {
    ledger_.SetBefore(*weights);
    result.batch_loss = at_weights.cost;
  }
  result.iteration.cost = result.batch_loss;
  const long num_undone = ledger_.num_undone();
  const auto undo = [&](const Eigen::VectorXd& before) {
    ledger_.Undo(UndoReason::kJudged, before, weights);
  };
  if (!is_left_out && (!is_finite || !MakeUpdates(batch,
                                                  undo,
                                                  objective_.get(),
                                                  rule_.get(),
                                                  &at_weights,
                                                  weights,
                                                  &result.message))) {
    ledger_.Undo(UndoReason::kEnd, ledger_.before(), weights);
    return result;
  }
  ++step_;
  result.outcome = StepResult::Outcome::kStepped;
  result.iteration.step_is_valid = true;
  result.iteration.step_is_successful =
      !is_left_out && ledger_.num_undone() == num_undone;
  if (at_weights.gradient.size() > 0) {
    result.iteration.gradient_max_norm =
        at_weights.gradient.lpNorm<Eigen::Infinity>();
  }
  if (!is_left_out) {
    result.iteration.step_norm = (*weights - ledger_.before()).norm();
  }
  result.has_stalled = objective_->HasStalled();
  return result;
}

bool RuleEngine::Begin(const DataSet& batch,
                       Linearization* at_weights,
                       Eigen::VectorXd* weights,
                       bool* is_left_out,
                       std::string* error) {
  const auto linearize = [&] {
    return objective_->Linearize(
        *weights, batch, rule_->Needs(), at_weights, error);
  };
  if (linearize()) {
    num_left_out_ = 0;
    return true;
  }
  const Eigen::VectorXd none;
  if (Undo(UndoReason::kNoLoss, none, weights)) return linearize();
  const long max_left_out = batches_.is_fresh()
                                ? kMaxLeftOut
                                : std::min(kMaxLeftOut, steps_per_epoch());
  *is_left_out = rule_->Needs().after && num_left_out_ < max_left_out;
  ++num_left_out_;
  if (*is_left_out) ++num_left_out_in_all_;
  return false;
}

bool RuleEngine::Undo(UndoReason reason,
                      const Eigen::VectorXd& best,
                      Eigen::VectorXd* weights) {
  if (reason == UndoReason::kNoLoss) {
    // Without a judge only a rule that evaluates the loss goes back, to `best`.
    if (judge_ == nullptr && (best.size() == 0 || !rule_->Needs().after)) {
      return false;
    }
    if (best.size() > 0 &&
        (judge_ == nullptr || *weights == ledger_.before())) {
      ledger_.SetBefore(best);
    }
    if (ledger_.before().size() == 0 || *weights == ledger_.before()) {
      return false;
    }
    if (judge_ != nullptr) {
      judge_->KeepsStep(std::numeric_limits<double>::quiet_NaN(), 1.0);
    }
  }
  ledger_.Undo(reason, ledger_.before(), weights);
  return true;
}

Engine::Counts RuleEngine::counts() const {
  return {step_ * objective_->updates_per_step(),
          ledger_.num_undone(),
          objective_->mutable_counts(),
          batch_size_,
          std::nullopt};
}

std::string RuleEngine::Finish() {
  const PullBackCounts* pull_backs = objective_->mutable_counts();
  const std::string left_out =
      num_left_out_in_all_ == 0
          ? ""
          : fmt::format(
                "{} of {} batches left out, for which there was no "
                "finite loss or derivative",
                num_left_out_in_all_,
                step_);
  std::string text;
  for (const std::string& part :
       {remark_, left_out, pull_backs == nullptr ? "" : pull_backs->Report()}) {
    if (!part.empty()) text += "; " + part;
  }
  return text;
}

void RuleEngine::VisitState(StateArchive* archive) {
  archive->Visit("steps_of_phase", &step_);
  ledger_.VisitState(num_weights_, archive);
  batches_.VisitState(step_, archive);
  const std::vector<Eigen::VectorXd*> arrays = objective_->MutableState();
  for (size_t i = 0; i < arrays.size(); ++i) {
    const std::string name = fmt::format("objective_{}", i);
    archive->Visit(name, arrays[i], arrays[i]->size());
    archive->Require(arrays[i]->allFinite(), name);
  }
  archive->Visit("num_left_out", &num_left_out_);
  archive->Visit("num_left_out_in_all", &num_left_out_in_all_);
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
  archive->Require(AreCounts(state) && counts->SetState(state), "pull_back");
}

// --- For races of batch sizes ---

std::vector<Eigen::VectorXd*> RuleEngine::Arrays() {
  std::vector<Eigen::VectorXd*> arrays = rule_->MutableState();
  for (Eigen::VectorXd* array : objective_->MutableState()) {
    arrays.push_back(array);
  }
  return arrays;
}

RuleEngine::Lane RuleEngine::Save(const Eigen::VectorXd& weights) {
  Lane lane{weights, {}};
  for (const Eigen::VectorXd* array : Arrays()) lane.arrays.push_back(*array);
  lane.arrays.push_back(ledger_.before());
  return lane;
}

void RuleEngine::Load(const Lane& lane, Eigen::VectorXd* weights) {
  *weights = lane.weights;
  const std::vector<Eigen::VectorXd*> arrays = Arrays();
  CHECK_EQ(arrays.size() + 1, lane.arrays.size());
  for (size_t i = 0; i < arrays.size(); ++i) *arrays[i] = lane.arrays[i];
  ledger_.SetBefore(lane.arrays.back());
}

void RuleEngine::Lane::VisitState(const std::string& name,
                                  Eigen::Index num_weights,
                                  StateArchive* archive) {
  archive->Visit(name + "_weights", &weights);
  archive->Require((weights.size() == 0 || weights.size() == num_weights) &&
                       weights.allFinite(),
                   name + "_weights");
  for (size_t i = 0; i < arrays.size(); ++i) {
    archive->Visit(fmt::format("{}_array_{}", name, i), &arrays[i]);
  }
}

}  // namespace invgrad
