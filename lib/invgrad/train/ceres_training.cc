#include "invgrad/train/ceres_training.h"

#include <chrono>
#include <cmath>
#include <limits>
#include <memory>

#include "invgrad/ceres/model_cost.h"
#include "invgrad/ceres/update_callback.h"
#include "invgrad/methods/ceres_method.h"
#include "invgrad/train/training_memory.h"

namespace invgrad {

namespace {

// Turns Ceres' iterations into a history, with its own clock, which stands
// while losses are looked at; and keeps the budget.
class TrainingRecorder final : public ceres::IterationCallback {
 public:
  TrainingRecorder(const TrainingTask& task, const TrainingResults& results)
      : options_(task.options),
        model_(task.model),
        train_(task.train),
        test_(task.test),
        weights_(*results.weights),
        history_(results.history),
        summary_(results.summary) {}

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    seconds_ += Seconds(Clock::now() - resumed_);
    summary_->num_steps = iteration.iteration;
    summary_->train_time_in_seconds = seconds_;
    step_norm_ = iteration.step_norm;
    // The weights are those of the lowest cost: a step that was rejected is not
    // in them, nor is one that was taken although the cost rose.
    if (iteration.iteration == 0 || iteration.step_is_successful) {
      const int num_samples = train_.num_samples();
      mean_loss_ = std::fmin(
          mean_loss_,
          iteration.cost / (model_.BatchScale(num_samples) * num_samples));
    }
    if (IsEvaluationEpoch(iteration.iteration)) Record();
    ceres::IterationSummary timed = iteration;
    timed.cumulative_time_in_seconds = seconds_;
    ceres::CallbackReturnType verdict = ceres::SOLVER_CONTINUE;
    for (ceres::IterationCallback* callback : options_.callbacks) {
      verdict = (*callback)(timed);
      if (verdict != ceres::SOLVER_CONTINUE) break;
    }
    if (verdict == ceres::SOLVER_ABORT) {
      Stop(ceres::USER_FAILURE, "aborted by a callback" + AtStep());
    } else if (verdict == ceres::SOLVER_TERMINATE_SUCCESSFULLY) {
      Stop(ceres::USER_SUCCESS, "stopped by a callback" + AtStep());
    } else if (IsDone()) {
      verdict = ceres::SOLVER_TERMINATE_SUCCESSFULLY;
    }
    resumed_ = Clock::now();
    // On SOLVER_ABORT Ceres puts the weights back to the start; they are kept.
    return verdict == ceres::SOLVER_CONTINUE
               ? verdict
               : ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }

  // The last state, unless it is in the history.
  void RecordEnd() {
    if (history_->empty() || history_->back().step != summary_->num_steps) {
      Record();
    }
  }

  // Whether budget, target, patience or a callback ended the run, and then with
  // the summary filled.
  bool has_stopped() const { return has_stopped_; }

 private:
  using Clock = std::chrono::steady_clock;
  static double Seconds(Clock::duration duration) {
    return std::chrono::duration<double>(duration).count();
  }

  void Record() {
    HistoryRow row;
    row.step = summary_->num_steps;
    row.epoch = static_cast<double>(row.step);
    row.seconds = seconds_;
    row.batch_loss = mean_loss_;
    row.train_loss = mean_loss_;
    if (test_.num_samples() > 0) {
      row.test_loss = MeanLoss(model_, weights_, test_);
    }
    row.step_norm = step_norm_;
    if (options_.metric) row.metric = options_.metric(weights_);
    history_->push_back(row);
    const double watched =
        test_.num_samples() > 0 ? row.test_loss : row.train_loss;
    evaluations_since_best_ =
        watched < best_loss_ ? 0 : evaluations_since_best_ + 1;
    best_loss_ = std::fmin(best_loss_, watched);
    if (options_.on_evaluation) options_.on_evaluation(*history_);
  }

  std::string AtStep() const {
    return " at step " + std::to_string(summary_->num_steps);
  }

  void Stop(ceres::TerminationType type, const std::string& message) {
    summary_->termination_type = type;
    summary_->message = message;
    has_stopped_ = true;
  }

  // True, with the summary filled, if the run has to end.
  bool IsDone() {
    const long step = summary_->num_steps;
    if (options_.target_loss > 0.0 && mean_loss_ <= options_.target_loss) {
      Stop(ceres::CONVERGENCE, "target loss reached" + AtStep());
    } else if (options_.patience > 0 &&
               evaluations_since_best_ >= options_.patience) {
      Stop(ceres::CONVERGENCE,
           "no improvement in " + std::to_string(options_.patience) +
               " evaluations");
    } else if (step >= options_.max_num_epochs) {
      Stop(ceres::NO_CONVERGENCE, "epochs done");
    } else if (step >= options_.max_num_steps) {
      Stop(ceres::NO_CONVERGENCE, "steps done");
    } else if (seconds_ >= options_.max_time_in_seconds) {
      Stop(ceres::NO_CONVERGENCE, "time used up");
    }
    return has_stopped_;
  }

  const TrainOptions& options_;
  const Model& model_;
  const DataSet& train_;
  const DataSet& test_;
  const Eigen::VectorXd& weights_;
  History* const history_;
  TrainSummary* const summary_;
  Clock::time_point resumed_ = Clock::now();
  double seconds_ = 0.0;
  double mean_loss_ = HistoryRow::kNone;
  double step_norm_ = HistoryRow::kNone;
  double best_loss_ = std::numeric_limits<double>::infinity();
  int evaluations_since_best_ = 0;
  bool has_stopped_ = false;
};

MinimizerOptions UnboundedOptions() {
  MinimizerOptions options;
  options.max_num_iterations = 1000000000;
  // The budget decides; these only end a run that cannot go on in double
  // precision.
  options.function_tolerance = 1e-16;
  options.gradient_tolerance = 1e-16;
  options.parameter_tolerance = 1e-16;
  return options;
}

}  // namespace

bool CheckCeresTraining(const Method& method,
                        const TrainingTask& task,
                        const Eigen::VectorXd& weights,
                        std::string* error) {
  const Model& model = task.model;
  const DataSet& train = task.train;
  if (method.ceres->is_trust_region &&
      !model.loss().SquaredNormFactor().has_value()) {
    *error = kNeedsLeastSquares;
    return false;
  }
  if (!CheckTrainingInput(task, weights, error)) return false;
  ceres::Solver::Options solver_options;
  ceres::GradientProblemSolver::Options gradient_options;
  ConfigureCeres(method, &solver_options, &gradient_options);
  if (!CeresFits(task,
                 method.ceres->is_trust_region
                     ? TrustRegionMemory(solver_options.linear_solver_type,
                                         model,
                                         train.num_samples())
                     : LineSearchMemory(model, train.num_samples()),
                 error)) {
    return false;
  }
  if (method.rule == nullptr) return true;
  Eigen::VectorXd any_weights = weights;
  ceres::Problem problem;
  AddModelToProblem(&model, &train, &any_weights, &problem);
  return TakesProposals(method, problem, error);
}

bool TrainByCeres(const Method& method,
                  const TrainingTask& task,
                  const TrainingResults& results,
                  std::string* report,
                  std::string* error) {
  if (!CheckCeresTraining(method, task, *results.weights, error)) return false;
  ceres::Problem problem;
  if (method.ceres->is_trust_region) {
    AddModelToProblem(&task.model, &task.train, results.weights, &problem);
  }
  ceres::Solver::Options solver_options;
  ceres::GradientProblemSolver::Options gradient_options;
  ConfigureCeres(method, &solver_options, &gradient_options);
  results.history->clear();
  *results.summary = TrainSummary();
  TrainingRecorder recorder(task, results);
  MinimizerOptions minimizer_options = UnboundedOptions();
  minimizer_options.callbacks.push_back(&recorder);
  MinimizerSummary result;
  report->clear();
  if (method.ceres->is_trust_region) {
    if (method.rule == nullptr) {
      MinimizeWithCeres(minimizer_options, solver_options, &problem, &result);
    } else {
      const std::unique_ptr<UpdateRule> rule = method.MakeRule();
      UpdateCallback callback(rule.get(), &problem);
      minimizer_options.callbacks.insert(minimizer_options.callbacks.begin(),
                                         callback.iteration_callback());
      MinimizeWithCeres(minimizer_options, solver_options, &problem, &result);
      *report = ProposalsText(callback.summary());
    }
  } else {
    MinimizeWithCeres(minimizer_options,
                      gradient_options,
                      new ModelFunction(&task.model, &task.train),
                      results.weights,
                      &result);
  }
  recorder.RecordEnd();
  if (!recorder.has_stopped()) {
    results.summary->termination_type = result.termination_type;
    results.summary->message = result.message;
  }
  return true;
}

}  // namespace invgrad
