// TrainByMethod of method.h.

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "invgrad/methods/method.h"
#include "invgrad/train/ceres_training.h"

namespace invgrad {

namespace {

constexpr int kNoEpochs = std::numeric_limits<int>::max();

// False if the ways cannot train this model on these data.
bool CheckWays(const PullBackMethod& ways,
               const Model& model,
               const DataSet& train,
               std::string* error) {
  if (ways.updates() > 1 && model.feedback() != nullptr) {
    *error =
        "updates > 1: in a closed loop an update moves the inputs of the "
        "next one";
    return false;
  }
  if (ways.needs_solutions() && train.solutions.rows() == 0) {
    *error = "its data have no solutions x* to learn from";
    return false;
  }
  return ways.CanPullBack(model.simulator(), error);
}

// The same with options of a phase, which outlive it.
TrainingTask WithOptions(const TrainOptions& options,
                         const TrainingTask& task) {
  return {options, task.model, task.train, task.test, task.inverse};
}

// What the rule of a phase gets to see: the model, the model with a joint loss,
// or a pull-back through the model. A phase without a minimizer of Ceres.
class PhaseView {
 public:
  PhaseView(const Method& phase, const TrainingTask& task)
      : task_(task), model_(&task.model), options_(task.options) {
    if (!phase.pull_back.has_value()) return;
    const PullBackMethod& ways = *phase.pull_back;
    if (ways.is_joint()) {
      model_ = &joint_.emplace(task.model.WithLoss(
          ways.MakeLoss(task.model.shared_loss()), task.model.reduction()));
    } else {
      options_.pull_back =
          &pull_back_.emplace(&task.model, task.inverse, ways.ChainOptions());
    }
  }
  PhaseView(const PhaseView&) = delete;
  PhaseView& operator=(const PhaseView&) = delete;

  // Refers to this view.
  TrainingTask task() const {
    return {options_, *model_, task_.train, task_.test, task_.inverse};
  }

  // What there is to say of the samples that were pulled back.
  std::string Report() const {
    if (!pull_back_.has_value()) return "";
    const std::string counts = pull_back_->counts().Report();
    return counts.empty() ? "" : "; " + counts;
  }

 private:
  const TrainingTask& task_;
  const Model* model_;
  TrainOptions options_;
  std::optional<Model> joint_;
  std::optional<ChainPullBack> pull_back_;
};

// What TrainPhase finds to be bad input before anything runs.
bool CheckPhase(const Method& phase,
                const TrainingTask& task,
                const Eigen::VectorXd& weights,
                std::string* error) {
  if (phase.ceres != nullptr) {
    return CheckCeresTraining(phase, task, weights, error);
  }
  if (phase.pull_back.has_value() &&
      !CheckWays(*phase.pull_back, task.model, task.train, error)) {
    return false;
  }
  const PhaseView view(phase, task);
  return CheckTraining(view.task(), *phase.MakeRule(), weights, error);
}

// By one phase, or by a method that has no others. `report` is to be added to
// the run's message.
bool TrainPhase(const Method& phase,
                const TrainingTask& task,
                const TrainingResults& results,
                std::string* report,
                std::string* error) {
  if (phase.ceres != nullptr) {
    return TrainByCeres(phase, task, results, report, error);
  }
  if (phase.pull_back.has_value() &&
      !CheckWays(*phase.pull_back, task.model, task.train, error)) {
    return false;
  }
  const std::unique_ptr<UpdateRule> rule = phase.MakeRule();
  const PhaseView view(phase, task);
  const TrainingTask seen = view.task();
  if (!Train(seen.options,
             seen.model,
             seen.train,
             seen.test,
             rule.get(),
             results.weights,
             results.history,
             results.summary,
             error)) {
    return false;
  }
  *report = view.Report();
  return true;
}

// To be added to the message of a run.
std::string TakenBackText(const TrainSummary& summary) {
  if (summary.num_taken_back == 0) return "";
  return "; " + std::to_string(summary.num_taken_back) + " of " +
         std::to_string(summary.num_updates) + " steps taken back";
}

// The last phase's label is that of the whole method.
std::string OwnLabel(const Method& phase) {
  size_t begin = phase.label.rfind('>') + 1;  // 0 if there is none
  while (begin < phase.label.size() && phase.label[begin] == ' ') ++begin;
  return phase.label.substr(begin);
}

int BatchSize(const Method& phase, int batch_size) {
  return phase.batch_size >= 0 ? phase.batch_size : batch_size;
}

long StepsPerEpoch(const Method& phase, int num_samples, int batch_size) {
  if (phase.ceres != nullptr) return 1;
  const int size = BatchSize(phase, batch_size);
  return size == 0 ? 1 : num_samples / size;
}

// The steps of an earlier phase if nothing ends it before.
long StepsOfShare(const Method& phase, long steps_per_epoch) {
  long steps = std::numeric_limits<long>::max();
  if (phase.num_epochs > 0) steps = phase.num_epochs * steps_per_epoch;
  if (phase.num_steps > 0) steps = std::min<long>(steps, phase.num_steps);
  return steps;
}

// How far a run has come.
struct Position {
  long step = 0;
  double epoch = 0.0;
  double seconds = 0.0;
};

// The shares of an epoch that the steps of several phases are do not add up
// exactly: what rounding leaves is nothing.
double EpochsLeft(const TrainOptions& options, const Position& position) {
  constexpr double kRounding = 1e-12;
  return options.max_num_epochs * (1.0 - kRounding) - position.epoch;
}

// Empty while something of the budget is left.
std::string BudgetMessage(const TrainOptions& options,
                          const Position& position) {
  if (EpochsLeft(options, position) <= 0.0) return "epochs done";
  if (position.step >= options.max_num_steps) return "steps done";
  if (position.seconds >= options.max_time_in_seconds) return "time used up";
  return "";
}

// Turns what a phase says of itself into what the run says: steps, epochs and
// seconds go on counting, and the phase's start is the end of the one before.
class PhaseRecorder final : public ceres::IterationCallback {
 public:
  PhaseRecorder(const TrainOptions& run,
                const Position& start,
                bool is_first,
                History* history)
      : run_(run), start_(start), is_first_(is_first), history_(history) {}

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    ceres::CallbackReturnType verdict = ceres::SOLVER_CONTINUE;
    if (iteration.iteration == 0 && !is_first_) return verdict;
    ceres::IterationSummary counted = iteration;
    counted.iteration += static_cast<int>(start_.step);
    counted.cumulative_time_in_seconds += start_.seconds;
    for (ceres::IterationCallback* callback : run_.callbacks) {
      verdict = (*callback)(counted);
      if (verdict != ceres::SOLVER_CONTINUE) break;
    }
    return verdict;
  }

  // Adds the rows that are new; several, if the phase went on from a
  // checkpoint.
  void Record(const History& of_phase) {
    if (num_read_ == 0 && !is_first_) num_read_ = 1;
    for (; num_read_ < of_phase.size(); ++num_read_) {
      HistoryRow row = of_phase[num_read_];
      row.step += start_.step;
      row.epoch += start_.epoch;
      row.seconds += start_.seconds;
      history_->push_back(row);
    }
  }

  void OnEvaluation(const History& of_phase) {
    const size_t num_rows = history_->size();
    Record(of_phase);
    if (run_.on_evaluation && history_->size() > num_rows) {
      run_.on_evaluation(*history_);
    }
  }

 private:
  const TrainOptions& run_;
  const Position start_;
  const bool is_first_;
  History* const history_;
  size_t num_read_ = 0;
};

TrainOptions OptionsOfPhase(const TrainOptions& run,
                            const Method& phase,
                            bool is_last,
                            long steps_per_epoch,
                            const Position& start,
                            const std::string& checkpoint_file,
                            PhaseRecorder* recorder) {
  TrainOptions options = run;
  options.batch_size = BatchSize(phase, run.batch_size);
  // In steps, as the run's epochs may end within one of the phase.
  if (run.max_num_steps < std::numeric_limits<long>::max()) {
    options.max_num_steps = run.max_num_steps - start.step;
  }
  if (run.max_num_epochs < kNoEpochs) {
    options.max_num_steps = std::min(
        options.max_num_steps,
        static_cast<long>(std::ceil(EpochsLeft(run, start) *
                                    static_cast<double>(steps_per_epoch))));
  }
  if (!is_last) {
    options.max_num_steps =
        std::min(options.max_num_steps, StepsOfShare(phase, steps_per_epoch));
  }
  options.max_num_epochs = kNoEpochs;
  options.max_time_in_seconds = run.max_time_in_seconds - start.seconds;
  options.callbacks = {recorder};
  options.on_evaluation = [recorder](const History& of_phase) {
    recorder->OnEvaluation(of_phase);
  };
  options.checkpoint_path = checkpoint_file;
  return options;
}

bool TrainInPhases(const Method& method,
                   const TrainingTask& task,
                   const TrainingResults& results,
                   std::string* error) {
  const TrainOptions& options = task.options;
  const auto& [weights, history, summary] = results;
  const std::vector<const Method*> phases = method.Phases();
  for (const Method* phase : phases) {
    TrainOptions of_phase = options;
    of_phase.batch_size = BatchSize(*phase, options.batch_size);
    if (!CheckPhase(*phase, WithOptions(of_phase, task), *weights, error)) {
      *error = OwnLabel(*phase) + ": " + *error;
      return false;
    }
  }
  const std::vector<std::string> checkpoints =
      CheckpointFiles(method, options.checkpoint_path);
  const Eigen::VectorXd initial_weights = *weights;
  history->clear();
  *summary = TrainSummary();
  Position position;
  std::string reports;
  for (size_t k = 0; k < phases.size(); ++k) {
    const Method& phase = *phases[k];
    const long steps_per_epoch =
        StepsPerEpoch(phase, task.train.num_samples(), options.batch_size);
    PhaseRecorder recorder(options, position, k == 0, history);
    const TrainOptions own = OptionsOfPhase(options,
                                            phase,
                                            k + 1 == phases.size(),
                                            steps_per_epoch,
                                            position,
                                            checkpoints[k],
                                            &recorder);
    History of_phase;
    TrainSummary end;
    std::string report;
    if (!TrainPhase(phase,
                    WithOptions(own, task),
                    {weights, &of_phase, &end},
                    &report,
                    error)) {
      *error = OwnLabel(phase) + ": " + *error;
      *weights = initial_weights;
      history->clear();
      return false;
    }
    recorder.Record(of_phase);
    position.step += end.num_steps;
    position.epoch += static_cast<double>(end.num_steps) /
                      static_cast<double>(steps_per_epoch);
    position.seconds += end.train_time_in_seconds;
    summary->num_updates += end.num_updates;
    summary->num_taken_back += end.num_taken_back;
    reports += report;
    summary->termination_type = end.termination_type;
    summary->message = "phase " + std::to_string(k + 1) + ": " + end.message;
    if (end.termination_type != ceres::NO_CONVERGENCE) break;
    const std::string budget = BudgetMessage(options, position);
    if (!budget.empty()) {
      summary->message = budget;
      break;
    }
  }
  summary->message += TakenBackText(*summary) + reports;
  summary->num_steps = position.step;
  summary->train_time_in_seconds = position.seconds;
  return true;
}

}  // namespace

bool TrainByMethod(const Method& method,
                   const TrainOptions& options,
                   const Model& model,
                   std::shared_ptr<const InverseSimulator> inverse,
                   const DataSet& train,
                   const DataSet& test,
                   Eigen::VectorXd* weights,
                   History* history,
                   TrainSummary* summary,
                   std::string* error) {
  const TrainingTask task{options, model, train, test, std::move(inverse)};
  const TrainingResults results{weights, history, summary};
  if (!method.earlier.empty()) {
    return TrainInPhases(method, task, results, error);
  }
  TrainOptions own = options;
  own.batch_size = BatchSize(method, options.batch_size);
  std::string report;
  if (!TrainPhase(method, WithOptions(own, task), results, &report, error)) {
    return false;
  }
  summary->message += TakenBackText(*summary) + report;
  return true;
}

double NumEpochs(const Method& method,
                 int num_samples,
                 int batch_size,
                 long num_steps) {
  double epochs = 0.0;
  for (const Method* phase : method.Phases()) {
    const long steps_per_epoch = StepsPerEpoch(*phase, num_samples, batch_size);
    long steps = num_steps;
    if (phase != &method) {
      steps = std::min(steps, StepsOfShare(*phase, steps_per_epoch));
    }
    epochs += static_cast<double>(steps) / static_cast<double>(steps_per_epoch);
    num_steps -= steps;
  }
  return epochs;
}

std::vector<std::string> CheckpointFiles(const Method& method,
                                         const std::string& checkpoint_path) {
  std::vector<std::string> files;
  for (size_t k = 0; k < method.earlier.size(); ++k) {
    files.push_back(checkpoint_path.empty()
                        ? ""
                        : checkpoint_path + "-phase" + std::to_string(k + 1));
  }
  files.push_back(checkpoint_path);
  return files;
}

}  // namespace invgrad
