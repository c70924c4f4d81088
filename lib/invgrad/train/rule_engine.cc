#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "fmt/core.h"
#include "invgrad/core/hessian_times.h"
#include "invgrad/internal/logging.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/output_layer/reduced_objective.h"
#include "invgrad/output_layer/share.h"
#include "invgrad/output_layer/steady_fall.h"
#include "invgrad/train/engine.h"

namespace invgrad {
namespace {

// So many batches in a row without a finite loss end the run.
constexpr long kMaxLeftOut = 100;

class RuleEngine final : public Engine {
 public:
  RuleEngine(int batch_size,
             int output_layer_period,
             bool watches_fall,
             const TrainOptions& options,
             std::unique_ptr<BatchObjective> objective,
             std::shared_ptr<UpdateRule> rule,
             const Model* model,
             const TrainingData* data)
      : batch_size_(batch_size),
        shuffles_(options.shuffle),
        judges_weights_(rule->JudgesWeights() &&
                        (data->source != nullptr ||
                         batch_size < data->train.num_samples())),
        num_weights_(options.initial_weights.size()),
        output_layer_period_(output_layer_period),
        watches_fall_(watches_fall),
        objective_(std::move(objective)),
        reduced_(output_layer_period > 0
                     ? dynamic_cast<ReducedObjective*>(objective_.get())
                     : nullptr),
        rule_(std::move(rule)),
        model_(*model),
        train_(data->train),
        source_(data->source),
        steps_per_epoch_(train_.num_samples() / batch_size),
        fall_(reduced_ != nullptr && reduced_->of_batch()
                  ? SteadyFall::kLeastCountOfAll
                  : SteadyFall::kLeastCountOfShares),
        random_(options.seed),
        before_order_(random_) {
    CHECK_GT(steps_per_epoch_, 0);
    CHECK_EQ(output_layer_period > 0, reduced_ != nullptr);
  }

  long steps_per_epoch() const override { return steps_per_epoch_; }
  StepResult Step(double progress, Eigen::VectorXd* weights) override;
  bool TakeBack(Eigen::VectorXd* weights) override;
  void RestoreLastGood(Eigen::VectorXd* weights) override {
    if (last_good_weights_.size() > 0) *weights = last_good_weights_;
  }
  Eigen::VectorXd Finished(const Eigen::VectorXd& weights) override {
    Eigen::VectorXd finished = weights;
    std::string ignored;
    if (reduced_ != nullptr && source_ == nullptr) {
      reduced_->SolveOutputLayer(train_, &finished, &ignored);
    }
    return finished;
  }
  bool HasStalled() const override {
    return watches_fall_ && fall_.HasStalled(progress_);
  }
  const Eigen::VectorXd* start_of_step() const override {
    return &last_good_weights_;
  }
  long num_updates() const override {
    return step_ * objective_->updates_per_step();
  }
  long num_taken_back() const override { return num_taken_back_; }
  const PullBackCounts* counts() const override {
    return objective_->mutable_counts();
  }
  void VisitState(StateArchive* archive) override;
  std::string Finish() override {
    const std::string report = counts() == nullptr ? "" : counts()->Report();
    return report.empty() ? "" : "; " + report;
  }

 private:
  // The samples of the next step from the weights.
  DataSet NextBatch(const Eigen::VectorXd& weights);
  DataSet NextBatchOfSource(const Eigen::VectorXd& weights);
  void DrawOrder();
  // Samples of the source for a solution of the output layer before a step on the
  // batch.
  DataSet FreshSamples(const DataSet& batch,
                       const Eigen::VectorXd& weights) const;
  // Sets the best output layer of the weights, if it is due before a step on the
  // batch.
  bool SolveIfDue(const DataSet& batch,
                  Eigen::VectorXd* weights,
                  std::string* error);
  // The loss with the best output layer of the share, whatever steps follow; NaN
  // if there is none.
  double LossOnShare(const ReducedObjective::Blocks& share,
                     const Eigen::VectorXd& weights);
  bool ReadsLoss() const {
    return watches_fall_ && SteadyFall::Reads(progress_);
  }
  // The weights after a step of the rule. Where each step has its best output
  // layer, these have it; `error` as SolveOutputLayer.
  bool After(const DataSet& batch,
             const Eigen::VectorXd& step,
             Eigen::VectorXd* weights,
             std::string* error);

  // Linearizes at the weights, after those returns that the rule decides.
  // *left_out: the loss of the batch is finite nowhere, and the rule judges
  // weights.
  bool Begin(const DataSet& batch,
             Linearization* at_weights,
             Eigen::VectorXd* weights,
             bool* left_out,
             std::string* error);
  // Makes all updates of a step; *at_weights is the linearization for the first
  // one.
  bool Update(const DataSet& batch,
              Linearization* at_weights,
              Eigen::VectorXd* weights,
              std::string* error);
  // The cost of the objective; NaN if it is not finite.
  double JudgedCost(const DataSet& batch, const Eigen::VectorXd& weights);

  class Others;

  const int batch_size_;
  const bool shuffles_;
  const bool judges_weights_;
  const Eigen::Index num_weights_;
  const int output_layer_period_;
  const bool watches_fall_;
  const std::unique_ptr<BatchObjective> objective_;
  ReducedObjective* const reduced_;  // the objective; may be null
  const std::shared_ptr<UpdateRule> rule_;
  const Model& model_;
  const DataSet& train_;
  const std::shared_ptr<const DataSource> source_;  // may be null
  const long steps_per_epoch_;

  long step_ = 0;
  double progress_ = 0.0;  // before the last step
  SteadyFall fall_;        // of a solved output layer
  long num_taken_back_ = 0;
  NumpyRandom random_;
  // Of the current epoch, if shuffled, and the random numbers before it.
  std::vector<int> order_;
  NumpyRandom before_order_;
  // Of a source whose samples serve several steps: the weights before the first
  // one, the number of the set, and its samples.
  Eigen::VectorXd set_weights_;
  long set_ = -1;
  DataSet set_samples_;
  // The weights of the last finite batch loss.
  Eigen::VectorXd last_good_weights_;
  // The copy of a rule that judges weights; may be empty.
  Eigen::VectorXd copied_weights_;
  long num_left_out_ = 0;  // in a row
};

DataSet RuleEngine::NextBatch(const Eigen::VectorXd& weights) {
  if (source_ != nullptr) return NextBatchOfSource(weights);
  const long in_epoch = step_ % steps_per_epoch_;
  const int first = static_cast<int>(in_epoch) * batch_size_;
  if (!shuffles_) return train_.Range(first, batch_size_);
  if (in_epoch == 0) DrawOrder();
  const auto begin = order_.begin() + first;
  return train_.Select(std::vector<int>(begin, begin + batch_size_));
}

DataSet RuleEngine::NextBatchOfSource(const Eigen::VectorXd& weights) {
  const long steps_per_set = source_->steps_per_set();
  if (steps_per_set == 1) {
    return source_->Batch(step_, batch_size_, model_, weights);
  }
  if (step_ % steps_per_set == 0) set_weights_ = weights;
  if (set_ != step_ / steps_per_set) {
    set_ = step_ / steps_per_set;
    set_samples_ = source_->Batch(step_, batch_size_, model_, set_weights_);
  }
  return set_samples_;
}

void RuleEngine::DrawOrder() {
  before_order_ = random_;
  order_ = random_.Permutation(train_.num_samples());
}

DataSet RuleEngine::FreshSamples(const DataSet& batch,
                                 const Eigen::VectorXd& weights) const {
  if (source_->needs_whole_batches()) return batch;
  const int size = SamplesOfShare(model_, objective_->is_proxy());
  return source_->Batch(step_, std::max(size, batch_size_), model_, weights);
}

bool RuleEngine::SolveIfDue(const DataSet& batch,
                            Eigen::VectorXd* weights,
                            std::string* error) {
  if (reduced_ == nullptr) return true;
  if (reduced_->of_batch()) {
    // After each step the layer is the best one of the step's samples.
    const bool is_new_set =
        source_ != nullptr && step_ % source_->steps_per_set() == 0;
    if ((step_ == 0 || is_new_set) &&
        !reduced_->SolveOutputLayer(batch, weights, error)) {
      return false;
    }
    if (ReadsLoss()) {
      fall_.Add(progress_, MeanLoss(model_, *weights, batch));
    }
    return true;
  }
  if (step_ % output_layer_period_ != 0) return true;
  ReducedObjective::Blocks share;
  const bool has_share =
      source_ == nullptr
          ? reduced_->TrainingShare(step_ / output_layer_period_, &share, error)
          : reduced_->Split(FreshSamples(batch, *weights), &share, error);
  if (!has_share) return false;
  if (ReadsLoss()) {
    fall_.Add(progress_, LossOnShare(share, *weights));
  }
  return reduced_->SolveOnShare(share, /*steps_follow=*/true, weights, error);
}

double RuleEngine::LossOnShare(const ReducedObjective::Blocks& share,
                               const Eigen::VectorXd& weights) {
  Eigen::VectorXd best = weights;
  std::string ignored;
  if (!reduced_->SolveOnShare(share, /*steps_follow=*/false, &best, &ignored)) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  double sum = 0.0;
  int num_samples = 0;
  for (const DataSet& block : share) {
    sum += MeanLoss(model_, best, block) * block.num_samples();
    num_samples += block.num_samples();
  }
  return sum / num_samples;
}

bool RuleEngine::After(const DataSet& batch,
                       const Eigen::VectorXd& step,
                       Eigen::VectorXd* weights,
                       std::string* error) {
  if (reduced_ == nullptr) {
    *weights += step;
    return true;
  }
  reduced_->AddStep(step, weights);
  return !reduced_->of_batch() ||
         reduced_->SolveOutputLayer(batch, weights, error);
}

Engine::StepResult RuleEngine::Step(double progress, Eigen::VectorXd* weights) {
  StepResult result;
  progress_ = progress;
  const DataSet batch = NextBatch(*weights);
  Linearization at_weights;
  at_weights.progress = progress;
  bool left_out = false;
  const bool is_finite =
      SolveIfDue(batch, weights, &result.message) &&
      Begin(batch, &at_weights, weights, &left_out, &result.message);
  if (is_finite) {
    last_good_weights_ = *weights;
    result.batch_loss = at_weights.cost;
  }
  const long num_taken_back = num_taken_back_;
  if (left_out) {
    ++num_taken_back_;
    RestoreLastGood(weights);
  } else if (!is_finite ||
             !Update(batch, &at_weights, weights, &result.message)) {
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

// The cost of a proxy says nothing about the loss of the batch, only whether it
// is finite: it is before each step.
class RuleEngine::Others final : public UpdateRule::OtherWeights {
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
    const Eigen::VectorXd& before = engine_.last_good_weights_;
    if (!engine_.objective_->is_proxy()) return CostAt(before);
    const bool is_known =
        !is_finite_ && before.size() > 0 && before != weights_;
    return is_known ? 0.0 : kNaN;
  }
  double CostAtCopy() override {
    if (engine_.objective_->is_proxy()) return kNaN;
    return CostAt(engine_.copied_weights_);
  }

 private:
  static constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

  double CostAt(const Eigen::VectorXd& weights) {
    return weights.size() == 0 ? kNaN : engine_.JudgedCost(batch_, weights);
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
  using Verdict = UpdateRule::Verdict;
  const auto linearize = [&] {
    return objective_->Linearize(
        *weights, batch, rule_->Needs(), at_weights, error);
  };
  bool is_finite = linearize();
  if (!judges_weights_) {
    return is_finite || (TakeBack(weights) && linearize());
  }
  Others others(this, batch, *weights, is_finite);
  const Verdict verdict = rule_->JudgeWeights(
      is_finite ? at_weights->cost : std::numeric_limits<double>::quiet_NaN(),
      &others);
  switch (verdict) {
    case Verdict::kCopy:
      copied_weights_ = *weights;
      break;
    case Verdict::kCopyBeforeLastStep:
      copied_weights_ = last_good_weights_;
      break;
    case Verdict::kRevertStep:
    case Verdict::kReturn: {
      const bool is_step = verdict == Verdict::kRevertStep;
      const Eigen::VectorXd& back =
          is_step ? last_good_weights_ : copied_weights_;
      CHECK_GT(back.size(), 0) << "There are no weights to go back to.";
      *weights = back;
      ++num_taken_back_;
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
    // Of the loss, or of a proxy with constant x~.
    const auto after = [&](const Eigen::VectorXd& step,
                           const LinearizationParts& parts,
                           Linearization* there,
                           std::string* why) {
      Eigen::VectorXd trial = *weights;
      return After(batch, step, &trial, why) &&
             objective_->LinearizeAgain(trial, batch, parts, there, why);
    };
    AddProductsAndTrials(
        rule_->Needs(),
        reduced_ == nullptr ? *weights : reduced_->OtherWeights(*weights),
        after,
        at_weights);
    if (!rule_->ComputeStep(*at_weights, &step, error)) return false;
    const Eigen::VectorXd before = *weights;
    const bool is_solved = After(batch, step, weights, error);
    if (!is_solved && !judges) return false;
    const double cost = !judges || !is_solved
                            ? std::numeric_limits<double>::quiet_NaN()
                            : JudgedCost(batch, *weights);
    if (judges && !rule_->KeepsStep(cost, 1.0)) {
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
  if (!rule_->JudgesSteps()) return false;
  if (*weights == last_good_weights_ && copied_weights_.size() > 0) {
    last_good_weights_ = copied_weights_;
  }
  if (last_good_weights_.size() == 0 || *weights == last_good_weights_) {
    return false;
  }
  *weights = last_good_weights_;
  rule_->KeepsStep(std::numeric_limits<double>::quiet_NaN(), 1.0);
  ++num_taken_back_;
  return true;
}

void RuleEngine::VisitState(StateArchive* archive) {
  archive->Visit("steps_of_phase", &step_);
  archive->Visit("num_taken_back", &num_taken_back_);
  archive->Visit("last_good_weights", &last_good_weights_);
  archive->Require(last_good_weights_.size() == 0 ||
                       (last_good_weights_.size() == num_weights_ &&
                        last_good_weights_.allFinite()),
                   "last_good_weights");
  if (shuffles_) {
    const bool is_within_epoch = step_ % steps_per_epoch_ != 0;
    Eigen::VectorXd random =
        (is_within_epoch ? before_order_ : random_).State();
    archive->Visit("random", &random, random.size());
    if (archive->is_reading() && archive->error().empty()) {
      archive->Require(random_.SetState(random), "random");
      if (is_within_epoch) DrawOrder();
    }
  }
  if (source_ != nullptr && source_->steps_per_set() > 1) {
    archive->Visit("set_weights", &set_weights_);
    archive->Require(
        (set_weights_.size() == 0 && step_ == 0) ||
            (set_weights_.size() == num_weights_ && set_weights_.allFinite()),
        "set_weights");
  }
  if (reduced_ != nullptr) {
    Eigen::VectorXd* const drift = reduced_->mutable_state();
    archive->Visit("output_layer", drift, drift->size());
    archive->Require(drift->allFinite(), "output_layer");
  }
  if (watches_fall_) {
    Eigen::VectorXd* const fall = fall_.mutable_state();
    archive->Visit("output_layer_fall", fall, fall->size());
    archive->Require(fall->allFinite(), "output_layer_fall");
  }
  if (judges_weights_) {
    archive->Visit("copied_weights", &copied_weights_);
    archive->Require(copied_weights_.size() == 0 ||
                         (copied_weights_.size() == num_weights_ &&
                          copied_weights_.allFinite()),
                     "copied_weights");
    archive->Visit("num_left_out", &num_left_out_);
  }
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
    int output_layer_period,
    bool watches_fall,
    const TrainOptions& options,
    std::unique_ptr<BatchObjective> objective,
    std::shared_ptr<UpdateRule> rule,
    const Model* model,
    const TrainingData* data) {
  return std::make_unique<RuleEngine>(batch_size,
                                      output_layer_period,
                                      watches_fall,
                                      options,
                                      std::move(objective),
                                      std::move(rule),
                                      model,
                                      data);
}

}  // namespace invgrad
