#include <algorithm>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

#include "invgrad/ceres/model_function.h"
#include "invgrad/cost.h"
#include "invgrad/internal/logging.h"
#include "invgrad/linearization.h"
#include "invgrad/method.h"
#include "invgrad/methods/batch_proposal.h"
#include "invgrad/methods/ceres_methods.h"
#include "invgrad/minimize/ceres_minimizer.h"
#include "invgrad/minimize/method_minimization.h"
#include "invgrad/train/engine.h"

namespace invgrad {
namespace {

// Ceres iterates inside ceres::Solve, so the solve runs in a separate thread,
// whose callback waits after each iteration for the next call of Step: only one
// of the two threads runs at a time.
class CeresEngine final : public Engine, private ceres::IterationCallback {
 public:
  CeresEngine(const Phase& phase,
              const Model* model,
              const DataSet* train,
              std::shared_ptr<const InverseSimulator> inverse)
      : Engine(/*steps_per_epoch=*/1, /*has_state=*/false),
        phase_(phase),
        model_(*model),
        train_(*train),
        inverse_(std::move(inverse)) {}
  ~CeresEngine() override { Stop(); }

  StepResult Step(double progress, Eigen::VectorXd* weights) override;
  Counts counts() const override {
    Counts counts;
    counts.batch_size = train_.num_samples();
    return counts;
  }
  std::string Finish() override {
    Stop();
    return proposals_;
  }

 private:
  // Waits in Ceres' thread.
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override;
  void Solve(Eigen::VectorXd* weights);
  void Minimize(Eigen::VectorXd* weights,
                MinimizerSummary* summary,
                std::string* proposals);
  void Stop();

  const Phase phase_;
  const Model& model_;
  const DataSet& train_;
  const std::shared_ptr<const InverseSimulator> inverse_;

  std::thread solver_;
  // Guards the following members; the solver's thread runs while is_solving_.
  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_solving_ = false;
  bool has_ended_ = false;        // the solve
  std::exception_ptr exception_;  // of the solve
  bool is_stopped_ = false;
  ceres::IterationSummary iteration_;
  double lowest_cost_ = std::numeric_limits<double>::infinity();
  MinimizerSummary summary_;
  std::string proposals_;  // a text about the proposals
};

Engine::StepResult CeresEngine::Step(double /*progress*/,
                                     Eigen::VectorXd* weights) {
  std::unique_lock<std::mutex> lock(mutex_);
  if (!solver_.joinable()) {
    solver_ = std::thread([this, weights] { Solve(weights); });
  }
  is_solving_ = !has_ended_;
  changed_.notify_all();
  changed_.wait(lock, [this] { return !is_solving_; });
  if (exception_ != nullptr) std::rethrow_exception(exception_);
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

void CeresEngine::Stop() {
  if (!solver_.joinable()) return;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_stopped_ = true;
    is_solving_ = true;
  }
  changed_.notify_all();
  solver_.join();
}

ceres::CallbackReturnType CeresEngine::operator()(
    const ceres::IterationSummary& iteration) {
  std::unique_lock<std::mutex> lock(mutex_);
  // The weights of the lowest cost, without rejected steps and without
  // nonmonotonic steps that raised the cost.
  if (iteration.iteration == 0 || iteration.step_is_successful) {
    lowest_cost_ = std::min(lowest_cost_, iteration.cost);
  }
  if (iteration.iteration > 0) {
    iteration_ = iteration;
    is_solving_ = false;
    changed_.notify_all();
    changed_.wait(lock, [this] { return is_solving_; });
  }
  // On SOLVER_ABORT Ceres resets the weights to the start.
  return is_stopped_ ? ceres::SOLVER_TERMINATE_SUCCESSFULLY
                     : ceres::SOLVER_CONTINUE;
}

void CeresEngine::Solve(Eigen::VectorXd* weights) {
  MinimizerSummary summary;
  std::string proposals;
  std::exception_ptr exception;
  try {
    Minimize(weights, &summary, &proposals);
  } catch (...) {
    exception = std::current_exception();
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  summary_ = std::move(summary);
  proposals_ = std::move(proposals);
  exception_ = exception;
  has_ended_ = true;
  is_solving_ = false;
  changed_.notify_all();
}

void CeresEngine::Minimize(Eigen::VectorXd* weights,
                           MinimizerSummary* summary,
                           std::string* proposals) {
  const ceres::Solver::Options solver_options = phase_.CeresOptions();
  // The budget ends the run; these tolerances end a solve that cannot make
  // progress in double precision.
  MinimizerOptions options;
  options.max_num_iterations = 1000000000;
  options.function_tolerance = 1e-16;
  options.gradient_tolerance = 1e-16;
  options.parameter_tolerance = 1e-16;
  options.callbacks = {this};
  if (phase_.ceres->is_trust_region) {
    ceres::Problem problem;
    AddModelToProblem(model_, train_, weights->data(), &problem);
    // A run has a budget, which a second solve would exceed.
    UpdateCallback::Options callback_options;
    callback_options.compare_with_plain = false;
    ProposalFunction function;
    if (phase_.pull_back != nullptr) {
      std::string error;
      function = MakeBatchProposal(
          phase_, model_, train_, weights->data(), inverse_, &error);
      CHECK(function != nullptr) << error;  // MakeEngine has made one
    }
    *proposals = MinimizeWithProposals(phase_,
                                       options,
                                       solver_options,
                                       callback_options,
                                       function,
                                       &problem,
                                       summary);
  } else {
    MinimizeWithCeres(options,
                      solver_options,
                      new ModelFunction(&model_, &train_),
                      weights,
                      summary);
  }
  if (summary->termination_type != ceres::FAILURE) return;
  // Ceres does not say which sample has no value or derivative at the start.
  Linearization ignored;
  std::string error;
  const LinearizationParts parts = phase_.ceres->is_trust_region
                                       ? LinearizationParts::Jacobian()
                                       : LinearizationParts::Gradient();
  if (!model_.Linearize(*weights, train_, parts, &ignored, &error)) {
    summary->message = error;
  }
}

}  // namespace

std::unique_ptr<Engine> MakeCeresEngine(
    const Phase& phase,
    const Model* model,
    const DataSet* train,
    std::shared_ptr<const InverseSimulator> inverse) {
  return std::make_unique<CeresEngine>(phase, model, train, std::move(inverse));
}

}  // namespace invgrad
