#include "invgrad/train/trainer.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <numeric>
#include <utility>

#include "glog/logging.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/train/checkpoint.h"
#include "invgrad/train/training_task.h"

namespace invgrad {

namespace {

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

std::string AtStep(const std::string& what, long step) {
  return what + " at step " + std::to_string(step);
}

// Nothing, if nothing was inverted.
void RecordCounts(const PullBackCounts& counts, HistoryRow* row) {
  if (counts.of(PullBackSource::kDerivative) > 0) return;
  const auto count = [&](PullBackSource source) {
    return static_cast<double>(counts.of(source));
  };
  row->by_inverse = count(PullBackSource::kInverse);
  row->by_numerical_inverse = count(PullBackSource::kNumericalInverse);
  row->by_inverse_gradient = count(PullBackSource::kInverseGradient);
  row->by_gradient = count(PullBackSource::kGradient);
  row->not_moved = count(PullBackSource::kNone);
}

// One run; the members are what a checkpoint holds.
class TrainingRun {
 public:
  TrainingRun(const TrainingTask& task,
              UpdateRule* rule,
              const TrainingResults& results)
      : options_(task.options),
        model_(task.model),
        train_(task.train),
        test_(task.test),
        rule_(rule),
        weights_(results.weights),
        history_(results.history),
        summary_(results.summary),
        shuffle_(options_.shuffle_seed),
        batch_size_(options_.batch_size == 0 ? train_.num_samples()
                                             : options_.batch_size),
        steps_per_epoch_(train_.num_samples() / batch_size_) {}

  // Continues from options.checkpoint_path. False if the file does not fit.
  bool Restore(std::string* error);

  void Run();

 private:
  struct BestLoss {
    double loss = std::numeric_limits<double>::infinity();
    int evaluations_since = 0;
  };

  // The samples of the step that is to be taken.
  DataSet NextBatch();
  // One step; false if the run ends, with the summary filled.
  bool Step();
  // Linearizes at the weights what the rule is to see.
  bool Linearize(const DataSet& batch,
                 Linearization* at_weights,
                 std::string* error);
  // The rule's updates that belong to a step, the first one from *at_weights.
  bool Update(const DataSet& batch,
              Linearization* at_weights,
              std::string* error);
  // What the rule judges its steps by, the loss or the proxy: NaN if there is
  // no finite one.
  double JudgedCost(const DataSet& batch);
  // Takes the last step back, because some samples have no finite loss after
  // it. False if there is none, or if the rule does not judge.
  bool TakeLastStepBack();
  void Evaluate();
  // Looks at the losses if it is time to; false if the run ends by that, with
  // the summary filled.
  bool EvaluateIfDue();
  // True if the run ends, with the summary filled.
  bool IsDone();
  bool CallBack(double batch_loss, double gradient_max_norm, double step_norm);
  void Finish(ceres::TerminationType type, const std::string& message);
  // True if the run was ended by its budget or its user, and by nothing else.
  bool MayGoOn() const {
    return summary_->termination_type != ceres::FAILURE &&
           summary_->termination_type != ceres::CONVERGENCE;
  }
  void SaveCheckpoint();
  double Progress() const;
  int epoch() const { return static_cast<int>(step_ / steps_per_epoch_); }
  int updates_per_step() const {
    return options_.pull_back == nullptr
               ? 1
               : options_.pull_back->updates_per_evaluation();
  }

  const TrainOptions& options_;
  const Model& model_;
  const DataSet& train_;
  const DataSet& test_;
  UpdateRule* const rule_;
  Eigen::VectorXd* const weights_;
  History* const history_;
  TrainSummary* const summary_;

  NumpyRandom shuffle_;
  const int batch_size_;
  const long steps_per_epoch_;

  long step_ = 0;
  double seconds_ = 0.0;
  double batch_loss_ = HistoryRow::kNone;
  double step_norm_ = HistoryRow::kNone;
  long num_taken_back_ = 0;
  long num_taken_back_before_ = 0;  // at the last callback
  BestLoss best_;
  std::vector<int> order_;  // of this epoch, if shuffled and under way
  // The weights of the last finite batch loss.
  Eigen::VectorXd last_good_weights_;
  Eigen::VectorXd weights_before_;  // the update that is under way
  Clock::time_point last_checkpoint_ = Clock::now();
};

DataSet TrainingRun::NextBatch() {
  const long in_epoch = step_ % steps_per_epoch_;
  const int first = static_cast<int>(in_epoch) * batch_size_;
  if (!options_.shuffle) return train_.Range(first, batch_size_);
  if (in_epoch == 0) order_ = shuffle_.Permutation(train_.num_samples());
  const auto begin = order_.begin() + first;
  return train_.Select(std::vector<int>(begin, begin + batch_size_));
}

double TrainingRun::Progress() const {
  const double by_epochs =
      static_cast<double>(step_) /
      (static_cast<double>(steps_per_epoch_) * options_.max_num_epochs);
  const double by_steps = static_cast<double>(step_) / options_.max_num_steps;
  const double by_time = seconds_ / options_.max_time_in_seconds;
  return std::min(1.0, std::max({by_epochs, by_steps, by_time}));
}

bool TrainingRun::Step() {
  const Clock::time_point start = Clock::now();
  const DataSet batch = NextBatch();
  Linearization at_weights;
  at_weights.progress = Progress();
  std::string error;
  bool is_finite = Linearize(batch, &at_weights, &error);
  if (!is_finite && TakeLastStepBack()) {
    is_finite = Linearize(batch, &at_weights, &error);
  }
  if (is_finite) {
    last_good_weights_ = *weights_;
    batch_loss_ = at_weights.cost;
  }
  if (!is_finite || !Update(batch, &at_weights, &error)) {
    seconds_ += SecondsSince(start);
    *weights_ = last_good_weights_;
    Finish(ceres::FAILURE, AtStep("diverged", step_ + 1) + ": " + error);
    return false;
  }
  ++step_;
  seconds_ += SecondsSince(start);
  step_norm_ = (*weights_ - last_good_weights_).norm();
  return CallBack(batch_loss_,
                  at_weights.gradient.size() == 0
                      ? 0.0
                      : at_weights.gradient.lpNorm<Eigen::Infinity>(),
                  step_norm_);
}

bool TrainingRun::Linearize(const DataSet& batch,
                            Linearization* at_weights,
                            std::string* error) {
  weights_before_ = *weights_;
  return options_.pull_back == nullptr
             ? model_.Linearize(
                   *weights_, batch, rule_->Needs(), at_weights, error)
             : options_.pull_back->Linearize(
                   *weights_, batch, rule_->Needs(), at_weights, error);
}

bool TrainingRun::Update(const DataSet& batch,
                         Linearization* at_weights,
                         std::string* error) {
  Eigen::VectorXd step;
  for (int k = 0; k < updates_per_step(); ++k) {
    if (k > 0 && !options_.pull_back->LinearizeAgain(
                     *weights_, batch, rule_->Needs(), at_weights, error)) {
      return false;
    }
    const bool judges = rule_->JudgesSteps();
    if (judges && options_.pull_back != nullptr) {
      at_weights->cost = JudgedCost(batch);
    }
    if (!rule_->ComputeStep(*at_weights, &step, error)) return false;
    *weights_ += step;
    if (judges && !rule_->KeepsStep(JudgedCost(batch), 1.0)) {
      // Not weights - step, which is rounded.
      *weights_ = weights_before_;
      ++num_taken_back_;
    }
    weights_before_ = *weights_;
  }
  return true;
}

double TrainingRun::JudgedCost(const DataSet& batch) {
  Linearization at_weights;
  std::string ignored;
  const bool is_finite =
      options_.pull_back == nullptr
          ? model_.Cost(*weights_, batch, &at_weights.cost, &ignored)
          : options_.pull_back->LinearizeAgain(
                *weights_, batch, LinearizationParts(), &at_weights, &ignored);
  return is_finite ? at_weights.cost : HistoryRow::kNone;
}

bool TrainingRun::TakeLastStepBack() {
  if (!rule_->JudgesSteps() || *weights_ == last_good_weights_) return false;
  *weights_ = last_good_weights_;
  rule_->KeepsStep(HistoryRow::kNone, 1.0);
  ++num_taken_back_;
  return true;
}

bool TrainingRun::CallBack(double batch_loss,
                           double gradient_max_norm,
                           double step_norm) {
  ceres::IterationSummary iteration;
  iteration.iteration = static_cast<int>(step_);
  iteration.step_is_valid = true;
  iteration.step_is_successful = num_taken_back_ == num_taken_back_before_;
  num_taken_back_before_ = num_taken_back_;
  iteration.cost = batch_loss;
  iteration.gradient_max_norm = gradient_max_norm;
  iteration.step_norm = step_norm;
  iteration.cumulative_time_in_seconds = seconds_;
  for (ceres::IterationCallback* callback : options_.callbacks) {
    switch ((*callback)(iteration)) {
      case ceres::SOLVER_CONTINUE:
        break;
      case ceres::SOLVER_ABORT:
        Finish(ceres::USER_FAILURE, AtStep("aborted by a callback", step_));
        return false;
      case ceres::SOLVER_TERMINATE_SUCCESSFULLY:
        Finish(ceres::USER_SUCCESS, AtStep("stopped by a callback", step_));
        return false;
    }
  }
  return true;
}

void TrainingRun::Evaluate() {
  HistoryRow row;
  row.step = step_;
  row.epoch = static_cast<double>(step_) / steps_per_epoch_;
  row.seconds = seconds_;
  row.batch_loss = batch_loss_;
  row.train_loss = MeanLoss(model_, *weights_, train_);
  if (!std::isfinite(row.train_loss) && TakeLastStepBack()) {
    row.train_loss = MeanLoss(model_, *weights_, train_);
  }
  if (test_.num_samples() > 0) {
    row.test_loss = MeanLoss(model_, *weights_, test_);
  }
  row.step_norm = step_norm_;
  if (options_.metric) row.metric = options_.metric(*weights_);
  if (options_.pull_back != nullptr) {
    RecordCounts(options_.pull_back->counts(), &row);
  }
  history_->push_back(row);
  const double watched =
      test_.num_samples() > 0 ? row.test_loss : row.train_loss;
  if (watched < best_.loss) {
    best_ = {watched, 0};
  } else {
    ++best_.evaluations_since;
  }
  if (options_.on_evaluation) options_.on_evaluation(*history_);
}

bool TrainingRun::IsDone() {
  const HistoryRow& last = history_->back();
  if (options_.target_loss > 0.0 && last.step == step_ &&
      last.train_loss <= options_.target_loss) {
    Finish(ceres::CONVERGENCE, AtStep("target loss reached", step_));
  } else if (options_.patience > 0 &&
             best_.evaluations_since >= options_.patience) {
    Finish(ceres::CONVERGENCE,
           "no improvement in " + std::to_string(options_.patience) +
               " evaluations");
  } else if (epoch() >= options_.max_num_epochs) {
    Finish(ceres::NO_CONVERGENCE, "epochs done");
  } else if (step_ >= options_.max_num_steps) {
    Finish(ceres::NO_CONVERGENCE, "steps done");
  } else if (seconds_ >= options_.max_time_in_seconds) {
    Finish(ceres::NO_CONVERGENCE, "time used up");
  } else {
    return false;
  }
  return true;
}

void TrainingRun::Finish(ceres::TerminationType type,
                         const std::string& message) {
  summary_->termination_type = type;
  summary_->message = message;
}

bool TrainingRun::EvaluateIfDue() {
  if (step_ % steps_per_epoch_ != 0 || !IsEvaluationEpoch(epoch()) ||
      history_->back().step == step_) {
    return true;
  }
  Evaluate();
  if (!std::isfinite(history_->back().train_loss)) {
    *weights_ = last_good_weights_;
    Finish(ceres::FAILURE,
           AtStep("diverged", step_) + ": the train loss is not finite");
    return false;
  }
  if (!options_.checkpoint_path.empty() &&
      SecondsSince(last_checkpoint_) >=
          options_.checkpoint_interval_in_seconds) {
    SaveCheckpoint();
  }
  return true;
}

void TrainingRun::Run() {
  bool runs = true;
  if (history_->empty()) {
    last_good_weights_ = *weights_;
    Evaluate();
    runs = CallBack(history_->back().train_loss, 0.0, 0.0);
  }
  if (runs && !std::isfinite(history_->back().train_loss)) {
    double ignored = 0.0;
    std::string why;
    model_.Cost(*weights_, train_, &ignored, &why);
    Finish(ceres::FAILURE,
           "the loss is not finite at the initial weights: " + why);
    runs = false;
  }
  // A run that was stopped after a step has its evaluation before it.
  runs = runs && EvaluateIfDue();
  while (runs && !IsDone()) runs = Step() && EvaluateIfDue();
  // Before the evaluation below, which a longer run would not have made.
  if (!options_.checkpoint_path.empty() && MayGoOn()) SaveCheckpoint();
  // The state in which the run ended, wherever that was.
  if (history_->back().step != step_) Evaluate();
  summary_->num_steps = step_;
  summary_->num_updates = step_ * updates_per_step();
  summary_->num_taken_back = num_taken_back_;
  summary_->train_time_in_seconds = seconds_;
}

void TrainingRun::SaveCheckpoint() {
  Checkpoint checkpoint;
  auto& arrays = checkpoint.arrays;
  const auto scalar = [](double value) {
    return Eigen::VectorXd::Constant(1, value);
  };
  arrays["weights"] = *weights_;
  arrays["step"] = scalar(static_cast<double>(step_));
  arrays["seconds"] = scalar(seconds_);
  arrays["batch_loss"] = scalar(batch_loss_);
  arrays["step_norm"] = scalar(step_norm_);
  arrays["num_taken_back"] = scalar(static_cast<double>(num_taken_back_));
  arrays["last_good_weights"] = last_good_weights_;
  arrays["best_loss"] = scalar(best_.loss);
  arrays["evaluations_since_best"] = scalar(best_.evaluations_since);
  arrays["batch_size"] = scalar(batch_size_);
  arrays["num_samples"] = scalar(train_.num_samples());
  arrays["shuffle"] = shuffle_.State();
  arrays["order"] = Eigen::Map<const Eigen::VectorXi>(
                        order_.data(), static_cast<Eigen::Index>(order_.size()))
                        .cast<double>();
  const std::vector<Eigen::VectorXd*> rule_state = rule_->MutableState();
  for (size_t i = 0; i < rule_state.size(); ++i) {
    arrays["rule_" + std::to_string(i)] = *rule_state[i];
  }
  if (options_.pull_back != nullptr) {
    arrays["pull_back"] = options_.pull_back->counts().State();
  }
  std::vector<double> rows;
  for (const HistoryRow& row : *history_) {
    rows.push_back(static_cast<double>(row.step));
    const auto columns = row.Columns();
    rows.insert(rows.end(), columns.begin(), columns.end());
  }
  arrays["history"] = Eigen::Map<const Eigen::VectorXd>(
      rows.data(), static_cast<Eigen::Index>(rows.size()));
  std::string error;
  // A checkpoint that cannot be written costs a resume, not the run.
  if (!WriteCheckpoint(options_.checkpoint_path, checkpoint, &error)) {
    LOG(ERROR) << error;
  }
  last_checkpoint_ = Clock::now();
}

bool TrainingRun::Restore(std::string* error) {
  Checkpoint checkpoint;
  if (!ReadCheckpoint(options_.checkpoint_path, &checkpoint, error)) {
    return false;
  }
  const auto misfit = [&](const std::string& name) {
    *error = options_.checkpoint_path + ": array '" + name +
             "' is missing or does not fit this run";
    return false;
  };
  // Null, with *error set, if the array is missing or has another size; any
  // size will do if it is negative. Nothing is assigned before all of them are
  // found to fit.
  const auto find = [&](const std::string& name,
                        Eigen::Index size) -> const Eigen::VectorXd* {
    const auto it = checkpoint.arrays.find(name);
    if (it == checkpoint.arrays.end() ||
        (size >= 0 && it->second.size() != size)) {
      misfit(name);
      return nullptr;
    }
    return &it->second;
  };
  std::map<std::string, double> scalars;
  for (const char* name : {"step",
                           "seconds",
                           "batch_loss",
                           "step_norm",
                           "num_taken_back",
                           "best_loss",
                           "evaluations_since_best",
                           "batch_size",
                           "num_samples"}) {
    const Eigen::VectorXd* value = find(name, 1);
    if (value == nullptr) return false;
    scalars[name] = (*value)[0];
  }
  const auto is_same = [&](const char* name, int ours) {
    if (scalars[name] == ours) return true;
    *error = options_.checkpoint_path + ": found " + name + "=" +
             std::to_string(static_cast<long>(scalars[name])) + ", wanted " +
             std::to_string(ours);
    return false;
  };
  if (!is_same("batch_size", batch_size_) ||
      !is_same("num_samples", train_.num_samples())) {
    return false;
  }
  const Eigen::VectorXd* weights = find("weights", weights_->size());
  if (weights == nullptr) return false;
  const Eigen::VectorXd* last_good_weights =
      find("last_good_weights", weights_->size());
  const Eigen::VectorXd* rows = find("history", -1);
  const Eigen::VectorXd* order = find("order", -1);
  const Eigen::VectorXd* shuffle = find("shuffle", -1);
  if (last_good_weights == nullptr || rows == nullptr || order == nullptr ||
      shuffle == nullptr) {
    return false;
  }
  const long step = static_cast<long>(scalars["step"]);
  const bool needs_order = options_.shuffle && step % steps_per_epoch_ != 0;
  constexpr Eigen::Index kRowSize = 1 + HistoryRow::kNumColumns;
  if (rows->size() == 0 || rows->size() % kRowSize != 0) {
    return misfit("history");
  }
  if (needs_order && order->size() != train_.num_samples()) {
    return misfit("order");
  }
  const std::vector<Eigen::VectorXd*> rule_state = rule_->MutableState();
  std::vector<const Eigen::VectorXd*> found_state;
  for (size_t i = 0; i < rule_state.size(); ++i) {
    found_state.push_back(find("rule_" + std::to_string(i), -1));
    if (found_state.back() == nullptr) return false;
    // Those that have a size before the first step keep it.
    if (rule_state[i]->size() > 0 &&
        rule_state[i]->size() != found_state.back()->size()) {
      return misfit("rule_" + std::to_string(i));
    }
  }
  const Eigen::VectorXd* pull_back = nullptr;
  if (options_.pull_back != nullptr) {
    pull_back = find("pull_back", -1);
    if (pull_back == nullptr) return false;
  }
  if (!shuffle_.SetState(*shuffle)) return misfit("shuffle");
  if (pull_back != nullptr &&
      !options_.pull_back->mutable_counts()->SetState(*pull_back)) {
    return misfit("pull_back");
  }

  step_ = step;
  seconds_ = scalars["seconds"];
  batch_loss_ = scalars["batch_loss"];
  step_norm_ = scalars["step_norm"];
  num_taken_back_ = static_cast<long>(scalars["num_taken_back"]);
  num_taken_back_before_ = num_taken_back_;
  best_.loss = scalars["best_loss"];
  best_.evaluations_since = static_cast<int>(scalars["evaluations_since_best"]);
  *weights_ = *weights;
  last_good_weights_ = *last_good_weights;
  order_.resize(order->size());
  Eigen::Map<Eigen::VectorXi>(order_.data(), order->size()) =
      order->cast<int>();
  for (size_t i = 0; i < rule_state.size(); ++i) {
    *rule_state[i] = *found_state[i];
  }
  for (Eigen::Index i = 0; i < rows->size(); i += kRowSize) {
    HistoryRow row;
    row.step = static_cast<long>((*rows)[i]);
    std::array<double, HistoryRow::kNumColumns> columns;
    std::copy_n(rows->data() + i + 1, columns.size(), columns.begin());
    row.SetColumns(columns);
    history_->push_back(row);
  }
  return true;
}

}  // namespace

bool IsEvaluationEpoch(int epoch) {
  // Spacing 1 up to 40, 2 up to 80, 4 up to 160, ...
  int spacing = 1;
  while (epoch > 40 * spacing) spacing *= 2;
  return epoch % spacing == 0;
}

double MeanLoss(const Model& model,
                const Eigen::VectorXd& weights,
                const DataSet& data) {
  double cost = 0.0;
  std::string error;
  if (!model.Cost(weights, data, &cost, &error)) return HistoryRow::kNone;
  const int num_samples = data.num_samples();
  return cost / (model.BatchScale(num_samples) * num_samples);
}

bool Train(const TrainOptions& options,
           const Model& model,
           const DataSet& train,
           const DataSet& test,
           UpdateRule* rule,
           Eigen::VectorXd* weights,
           History* history,
           TrainSummary* summary,
           std::string* error) {
  CHECK(rule != nullptr && weights != nullptr && history != nullptr &&
        summary != nullptr && error != nullptr);
  const TrainingTask task{options, model, train, test, nullptr};
  if (!CheckTraining(task, *rule, *weights, error)) return false;
  history->clear();
  *summary = TrainSummary();
  TrainingRun run(task, rule, {weights, history, summary});
  if (!options.checkpoint_path.empty() &&
      std::filesystem::exists(options.checkpoint_path) && !run.Restore(error)) {
    return false;
  }
  run.Run();
  return true;
}

}  // namespace invgrad
