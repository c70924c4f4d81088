#include "invgrad/train/ceres_engine.h"

#include <algorithm>
#include <utility>

#include "invgrad/ceres/model_cost.h"
#include "invgrad/minimize/ceres_minimizer.h"
#include "invgrad/minimize/method_minimization.h"

namespace invgrad {
namespace {

// The budget ends the run; these tolerances end a solve that cannot make
// progress in double precision.
MinimizerOptions UnboundedOptions() {
  MinimizerOptions options;
  options.max_num_iterations = 1000000000;
  options.function_tolerance = 1e-16;
  options.gradient_tolerance = 1e-16;
  options.parameter_tolerance = 1e-16;
  return options;
}

}  // namespace

CeresEngine::CeresEngine(Phase phase, const Model* model, const DataSet* train)
    : phase_(std::move(phase)), model_(*model), train_(*train) {}

CeresEngine::~CeresEngine() { Finish(); }

Engine::StepResult CeresEngine::Step(double /*progress*/,
                                     Eigen::VectorXd* weights) {
  std::unique_lock<std::mutex> lock(mutex_);
  if (!solver_.joinable()) {
    solver_ = std::thread([this, weights] { Solve(weights); });
  }
  is_solving_ = !has_ended_;
  changed_.notify_all();
  changed_.wait(lock, [this] { return !is_solving_; });
  StepResult result;
  if (has_ended_) {
    result.outcome = StepResult::Outcome::kEnded;
    result.termination_type = summary_.termination_type;
    result.message = summary_.message;
    return result;
  }
  result.outcome = StepResult::Outcome::kStepped;
  result.iteration = iteration_;
  result.batch_loss = lowest_cost_;
  return result;
}

std::string CeresEngine::Finish() {
  if (!solver_.joinable()) return proposals_;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_stopped_ = true;
    is_solving_ = true;
  }
  changed_.notify_all();
  solver_.join();
  return proposals_;
}

ceres::CallbackReturnType CeresEngine::Handover::operator()(
    const ceres::IterationSummary& iteration) {
  std::unique_lock<std::mutex> lock(engine_.mutex_);
  // The weights of the lowest cost, without rejected steps and without
  // nonmonotonic steps that raised the cost.
  if (iteration.iteration == 0 || iteration.step_is_successful) {
    engine_.lowest_cost_ = std::min(engine_.lowest_cost_, iteration.cost);
  }
  if (iteration.iteration > 0) {
    engine_.iteration_ = iteration;
    engine_.is_solving_ = false;
    engine_.changed_.notify_all();
    engine_.changed_.wait(lock, [this] { return engine_.is_solving_; });
  }
  // On SOLVER_ABORT Ceres resets the weights to the start.
  return engine_.is_stopped_ ? ceres::SOLVER_TERMINATE_SUCCESSFULLY
                             : ceres::SOLVER_CONTINUE;
}

void CeresEngine::Solve(Eigen::VectorXd* weights) {
  const ceres::Solver::Options solver_options = phase_.CeresOptions();
  Handover handover(this);
  MinimizerOptions options = UnboundedOptions();
  options.callbacks = {&handover};
  MinimizerSummary summary;
  std::string proposals;
  if (phase_.ceres->is_trust_region) {
    ceres::Problem problem;
    AddModelToProblem(&model_, &train_, weights, &problem);
    proposals = MinimizeWithProposals(
        phase_, options, solver_options, &problem, &summary);
  } else {
    MinimizeWithCeres(options,
                      solver_options,
                      new ModelFunction(&model_, &train_),
                      weights,
                      &summary);
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  summary_ = std::move(summary);
  proposals_ = std::move(proposals);
  has_ended_ = true;
  is_solving_ = false;
  changed_.notify_all();
}

}  // namespace invgrad
