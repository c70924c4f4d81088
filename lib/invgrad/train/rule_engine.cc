#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "fmt/core.h"
#include "invgrad/internal/logging.h"
#include "invgrad/methods/phase_objective.h"
#include "invgrad/train/batch_sequence.h"
#include "invgrad/train/engine.h"
#include "invgrad/train/weight_ledger.h"
#include "invgrad/update_rule.h"

namespace invgrad {
namespace {

// So many batches in a row without a finite loss end the run.
constexpr long kMaxLeftOut = 100;

class RuleEngine final : public Engine {
 public:
  RuleEngine(int batch_size,
             const TrainOptions& options,
             std::unique_ptr<BatchObjective> objective,
             std::shared_ptr<UpdateRule> rule,
             const Model* model,
             const TrainingData* data)
      : Engine(data->train.num_samples() / batch_size, /*has_state=*/true),
        batches_(batch_size, options, model, data),
        judge_(rule->judge()),
        judges_weights_(judge_ != nullptr && judge_->JudgesWeights() &&
                        batches_.has_new_samples()),
        num_weights_(model->num_weights()),
        objective_(std::move(objective)),
        rule_(std::move(rule)) {}

  StepResult Step(double progress, Eigen::VectorXd* weights) override;
  bool Undo(UndoReason reason,
            const Eigen::VectorXd& best,
            Eigen::VectorXd* weights) override;
  Eigen::VectorXd Finished(const Eigen::VectorXd& weights) override {
    return objective_->Finished(weights);
  }
  Counts counts() const override {
    return {step_ * objective_->updates_per_step(),
            ledger_.num_undone(),
            objective_->mutable_counts()};
  }
  void VisitState(StateArchive* archive) override;
  std::string Finish() override {
    const PullBackCounts* pull_backs = objective_->mutable_counts();
    const std::string report =
        pull_backs == nullptr ? "" : pull_backs->Report();
    return report.empty() ? "" : "; " + report;
  }

 private:
  // Linearizes at the weights, after the steps that the judge undoes.
  // *left_out: the loss of the batch is finite nowhere, and the rule judges
  // weights.
  bool Begin(const DataSet& batch,
             Linearization* at_weights,
             Eigen::VectorXd* weights,
             bool* left_out,
             std::string* error);
  class Others;

  BatchSequence batches_;
  StepJudge* const judge_;  // of the rule; may be null
  const bool judges_weights_;
  const Eigen::Index num_weights_;
  const std::unique_ptr<BatchObjective> objective_;
  const std::shared_ptr<UpdateRule> rule_;

  long step_ = 0;
  WeightLedger ledger_;
  long num_left_out_ = 0;  // in a row
};

Engine::StepResult RuleEngine::Step(double progress, Eigen::VectorXd* weights) {
  StepResult result;
  const DataSet batch = batches_.Next(step_, *weights);
  Linearization at_weights;
  at_weights.progress = progress;
  bool left_out = false;
  const bool is_finite =
      objective_->Prepare(step_, progress, batch, weights, &result.message) &&
      Begin(batch, &at_weights, weights, &left_out, &result.message);
  if (is_finite) {
    ledger_.SetBefore(*weights);
    result.batch_loss = at_weights.cost;
  }
  const long num_undone = ledger_.num_undone();
  const auto undo = [&](const Eigen::VectorXd& before) {
    ledger_.Undo(UndoReason::kJudged, before, weights);
  };
  if (left_out) {
    ledger_.Undo(UndoReason::kNoLoss, ledger_.before(), weights);
  } else if (!is_finite || !MakeUpdates(batch,
                                        undo,
                                        objective_.get(),
                                        rule_.get(),
                                        &at_weights,
                                        weights,
                                        &result.message)) {
    ledger_.Undo(UndoReason::kEnd, ledger_.before(), weights);
    return result;
  }
  ++step_;
  result.outcome = StepResult::Outcome::kStepped;
  result.iteration.step_is_valid = true;
  result.iteration.step_is_successful = ledger_.num_undone() == num_undone;
  result.iteration.cost = result.batch_loss;
  if (at_weights.gradient.size() > 0) {
    result.iteration.gradient_max_norm =
        at_weights.gradient.lpNorm<Eigen::Infinity>();
  }
  result.iteration.step_norm = (*weights - ledger_.before()).norm();
  result.has_stalled = objective_->HasStalled();
  return result;
}

// The cost of a proxy says nothing about the loss of the batch, only whether it
// is finite: it is before each step.
class RuleEngine::Others final : public StepJudge::OtherWeights {
 public:
  Others(RuleEngine* engine,
         const DataSet& batch,
         const Eigen::VectorXd& weights,
         bool is_finite)
      : engine_(*engine),
        batch_(batch),
        weights_(weights),
        is_finite_(is_finite) {}

  double CostBeforeLastStep() override {
    const Eigen::VectorXd& before = engine_.ledger_.before();
    if (!engine_.objective_->is_proxy()) return CostAt(before);
    const bool is_known =
        !is_finite_ && before.size() > 0 && before != weights_;
    return is_known ? 0.0 : kNaN;
  }
  double CostAtCopy() override {
    if (engine_.objective_->is_proxy()) return kNaN;
    return CostAt(engine_.ledger_.copy());
  }

 private:
  static constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

  double CostAt(const Eigen::VectorXd& weights) {
    return weights.size() == 0
               ? kNaN
               : CostOf(engine_.objective_.get(), batch_, weights);
  }

  RuleEngine& engine_;
  const DataSet& batch_;
  const Eigen::VectorXd& weights_;
  const bool is_finite_;
};

bool RuleEngine::Begin(const DataSet& batch,
                       Linearization* at_weights,
                       Eigen::VectorXd* weights,
                       bool* left_out,
                       std::string* error) {
  using Verdict = StepJudge::Verdict;
  const auto linearize = [&] {
    return objective_->Linearize(
        *weights, batch, rule_->Needs(), at_weights, error);
  };
  bool is_finite = linearize();
  if (!judges_weights_) {
    const Eigen::VectorXd none;
    return is_finite ||
           (Undo(UndoReason::kNoLoss, none, weights) && linearize());
  }
  Others others(this, batch, *weights, is_finite);
  const Verdict verdict = judge_->JudgeWeights(
      is_finite ? at_weights->cost : std::numeric_limits<double>::quiet_NaN(),
      &others);
  switch (verdict) {
    case Verdict::kCopy:
      ledger_.SetCopy(*weights);
      break;
    case Verdict::kCopyBefore:
      ledger_.SetCopy(ledger_.before());
      break;
    case Verdict::kUndoStep:
    case Verdict::kUndoToCopy: {
      const Eigen::VectorXd& back =
          verdict == Verdict::kUndoStep ? ledger_.before() : ledger_.copy();
      CHECK_GT(back.size(), 0) << "There are no weights to go back to.";
      ledger_.Undo(UndoReason::kJudged, back, weights);
      is_finite = linearize();
      break;
    }
    case Verdict::kGoOn:
    case Verdict::kLeaveOut:
      break;
  }
  *left_out =
      !is_finite && verdict != Verdict::kGoOn && num_left_out_ < kMaxLeftOut;
  num_left_out_ = is_finite ? 0 : num_left_out_ + 1;
  return is_finite;
}

bool RuleEngine::Undo(UndoReason reason,
                      const Eigen::VectorXd& best,
                      Eigen::VectorXd* weights) {
  if (reason == UndoReason::kNoLoss) {
    if (judge_ == nullptr) return false;
    for (const Eigen::VectorXd* back : {&ledger_.copy(), &best}) {
      if (*weights == ledger_.before() && back->size() > 0) {
        ledger_.SetBefore(*back);
      }
    }
    if (ledger_.before().size() == 0 || *weights == ledger_.before()) {
      return false;
    }
    judge_->KeepsStep(std::numeric_limits<double>::quiet_NaN(), 1.0);
  }
  ledger_.Undo(reason, ledger_.before(), weights);
  return true;
}

void RuleEngine::VisitState(StateArchive* archive) {
  archive->Visit("steps_of_phase", &step_);
  ledger_.VisitState(num_weights_, /*has_copy=*/judges_weights_, archive);
  batches_.VisitState(step_, archive);
  const std::vector<Eigen::VectorXd*> arrays = objective_->MutableState();
  for (size_t i = 0; i < arrays.size(); ++i) {
    const std::string name = fmt::format("objective_{}", i);
    archive->Visit(name, arrays[i], arrays[i]->size());
    archive->Require(arrays[i]->allFinite(), name);
  }
  if (judges_weights_) archive->Visit("num_left_out", &num_left_out_);
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

}  // namespace

std::unique_ptr<Engine> MakeRuleEngine(
    int batch_size,
    const TrainOptions& options,
    std::unique_ptr<BatchObjective> objective,
    std::shared_ptr<UpdateRule> rule,
    const Model* model,
    const TrainingData* data) {
  return std::make_unique<RuleEngine>(
      batch_size, options, std::move(objective), std::move(rule), model, data);
}

}  // namespace invgrad
