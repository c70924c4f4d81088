#include "invgrad/minimize/method_minimization.h"

#include <functional>
#include <memory>
#include <optional>
#include <utility>

#include "invgrad/minimize/ceres_minimizer.h"
#include "invgrad/minimize/problem_minimization.h"
#include "invgrad/minimize/pull_back_objective.h"
#include "invgrad/minimize/trust_region_memory.h"

namespace invgrad {

namespace {

// Returns false, with summary and path of the failure, if the cost is not
// finite at the start. Ceres only checks the residuals, whose squares may
// overflow.
bool HasStart(const ChainObjective& objective,
              std::vector<Eigen::VectorXd>* path,
              MinimizerSummary* summary) {
  double cost = 0.0;
  std::string error;
  if (objective.Cost(&cost, &error)) return true;
  *summary = MinimizerSummary();
  summary->message = "no start: " + error;
  path->push_back(objective.State());
  return false;
}

// Records the points of a minimization.
class PathRecorder final : public ceres::IterationCallback {
 public:
  PathRecorder(std::function<Eigen::VectorXd()> point,
               std::vector<Eigen::VectorXd>* path)
      : point_(std::move(point)), path_(path) {}
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary&) override {
    path_->push_back(point_());
    return ceres::SOLVER_CONTINUE;
  }

 private:
  std::function<Eigen::VectorXd()> point_;
  std::vector<Eigen::VectorXd>* path_;
};

void MinimizeByRule(const Phase& phase,
                    const MinimizerOptions& options,
                    std::shared_ptr<const InverseSimulator> inverse,
                    ChainObjective* objective,
                    std::vector<Eigen::VectorXd>* path,
                    MinimizerSummary* summary) {
  const std::unique_ptr<UpdateRule> rule = phase.MakeRule();
  // The objective that the rule linearizes.
  Objective* seen = objective;
  std::optional<ChainObjective> joint;
  std::optional<PullBackObjective> pulled_back;
  if (phase.pull_back.has_value()) {
    const PullBackMethod& ways = *phase.pull_back;
    if (ways.is_joint()) {
      seen = &joint.emplace(objective->shared_simulator(),
                            ways.MakeLoss(objective->shared_loss()),
                            objective->target(),
                            objective->State());
    } else {
      seen = &pulled_back.emplace(
          objective,
          ways.MakeLossPullBack(objective->shared_loss()),
          ways.MakeSimulatorPullBack(objective->shared_simulator(),
                                     std::move(inverse)));
    }
  }
  MinimizerOptions recorded = options;
  PathRecorder recorder([seen]() { return seen->State(); }, path);
  recorded.callbacks.insert(recorded.callbacks.begin(), &recorder);
  Minimize(recorded, rule.get(), seen, summary);
  if (path->empty()) path->push_back(seen->State());
  objective->SetState(seen->State());
  if (pulled_back.has_value()) {
    const std::string report = pulled_back->counts().Report();
    if (!report.empty()) summary->message += "; " + report;
  }
}

}  // namespace

bool MinimizeByMethod(const Method& method,
                      const MinimizerOptions& options,
                      std::shared_ptr<const InverseSimulator> inverse,
                      ChainObjective* objective,
                      std::vector<Eigen::VectorXd>* path,
                      MinimizerSummary* summary,
                      std::string* error) {
  path->clear();
  const Phase& phase = method.last_phase();
  if (method.phases.size() > 1) {
    *error = "a method in phases needs a network to train";
    return false;
  }
  if (phase.pull_back.has_value() && phase.pull_back->needs_solutions()) {
    *error = "a point has no data to learn from";
    return false;
  }
  if (phase.pull_back.has_value() && phase.pull_back->needs_batches()) {
    *error = "proxy, curvature_weight, updates and max_change need a network";
    return false;
  }
  const bool is_pulled_back =
      phase.pull_back.has_value() && !phase.pull_back->is_joint();
  const std::unique_ptr<UpdateRule> rule = phase.MakeRule();
  if (is_pulled_back
          ? !phase.pull_back->CanPullBack(objective->simulator(), error)
          : rule != nullptr && rule->Needs().hessian &&
                !CheckHasHessian(objective->simulator(), error)) {
    return false;
  }
  if (phase.ceres == nullptr) {
    if (is_pulled_back && rule->JudgesSteps()) {
      *error =
          "control=gain judges by a cost, and the change that is pulled back "
          "to a point has none";
      return false;
    }
    MinimizeByRule(
        phase, options, std::move(inverse), objective, path, summary);
    return true;
  }
  Eigen::VectorXd x = objective->State();
  MinimizerOptions recorded = options;
  PathRecorder recorder([&x]() { return x; }, path);
  recorded.callbacks.insert(recorded.callbacks.begin(), &recorder);
  ceres::Solver::Options solver_options;
  ceres::GradientProblemSolver::Options gradient_options;
  phase.ConfigureCeres(&solver_options, &gradient_options);
  if (!phase.ceres->is_trust_region) {
    // A line search uses the gradient and no Jacobian, which may be large.
    if (!HasStart(*objective, path, summary)) return true;
    MinimizeWithCeres(
        recorded, gradient_options, new ChainFunction(objective), &x, summary);
  } else if (!objective->loss().SquaredNormFactor().has_value()) {
    *error = kNeedsLeastSquares;
    return false;
  } else if (!FitsInMemory(
                 "a trust region",
                 TrustRegionMemory(solver_options.linear_solver_type,
                                   objective->simulator().num_outputs(),
                                   objective->num_parameters()),
                 /*limit=*/0.0,
                 error)) {
    return false;
  } else {
    ceres::Problem problem;
    problem.AddResidualBlock(
        new ChainCostFunction(objective), nullptr, x.data());
    if (!HasStart(*objective, path, summary)) return true;
    if (!MinimizeProblem(method,
                         recorded,
                         /*elimination_order=*/nullptr,
                         &problem,
                         summary,
                         error)) {
      return false;
    }
  }
  objective->SetState(x);
  // Ceres calls no callback after a step that ends the run by a tolerance.
  if (path->empty() || path->back() != x) path->push_back(x);
  return true;
}

}  // namespace invgrad
