#include "invgrad/minimize/method_minimization.h"

#include <functional>
#include <memory>
#include <optional>
#include <utility>

#include "ceres/types.h"
#include "invgrad/ceres/bounds.h"
#include "invgrad/ceres/model_function.h"
#include "invgrad/ceres/problem_structure.h"
#include "invgrad/cost.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/method.h"
#include "invgrad/methods/batch_proposal.h"
#include "invgrad/methods/ceres_methods.h"
#include "invgrad/methods/phase_objective.h"
#include "invgrad/methods/pull_back_method.h"
#include "invgrad/minimize/ceres_minimizer.h"
#include "invgrad/minimize/pull_back_objective.h"
#include "invgrad/minimize/within_bounds.h"

namespace invgrad {

namespace {

bool CeresFitsInMemory(const Phase& phase,
                       const ceres::Solver::Options& options,
                       const ceres::Problem& problem,
                       std::string* error) {
  // Ceres solves for the blocks that are not constant, and omits residual blocks
  // that do not depend on them.
  const ProblemStructure structure = ReadStructure(problem, {});
  const double cols = structure.num_parameters;
  const double rows = structure.num_variable_residuals;
  const auto num_entries = static_cast<double>(structure.num_entries);
  // J and its copies in the linear solver, if that stores no zeros.
  std::vector<MemoryPart> parts = {{"J", 3.0 * sizeof(double) * num_entries}};
  if (!phase.ceres->is_trust_region) {
    if (options.line_search_direction_type != ceres::BFGS) return true;
    parts = {{"inverse Hessian", 2.0 * sizeof(double) * cols * cols}};
  } else if (options.linear_solver_type == ceres::DENSE_QR ||
             options.linear_solver_type == ceres::DENSE_NORMAL_CHOLESKY) {
    parts = TrustRegionMemory(options.linear_solver_type, rows, cols);
  }
  return FitsInMemory(phase.label, std::move(parts), /*limit=*/0.0, error);
}

// Returns false, with summary and path of the failure, if the cost is not
// finite at the start. Ceres only checks the residuals, whose squares may
// overflow.
bool HasStart(const PointObjective& objective,
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
                    PointObjective* objective,
                    std::vector<Eigen::VectorXd>* path,
                    MinimizerSummary* summary) {
  const std::unique_ptr<UpdateRule> rule = phase.MakeRule();
  // The objective that the rule linearizes.
  Objective* seen = objective;
  std::optional<PointObjective> joint;
  std::optional<PullBackObjective> pulled_back;
  if (phase.pull_back != nullptr) {
    const PullBackMethod& ways = *phase.pull_back;
    if (ways.is_joint()) {
      seen = &joint.emplace(objective->model().shared_simulator(),
                            ways.MakeLoss(objective->model().shared_loss()),
                            objective->target(),
                            objective->State());
    } else {
      seen = &pulled_back.emplace(
          objective,
          ways.MakeLossPullBack(objective->model().shared_loss()),
          ways.MakeSimulatorPullBack(objective->model().shared_simulator(),
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

// False, with *error set, if the phase cannot minimize the objective.
bool IsForPoints(const Phase& phase,
                 const PointObjective& objective,
                 std::string* error) {
  const std::unique_ptr<UpdateRule> rule = phase.MakeRule();
  if (phase.pull_back == nullptr || phase.pull_back->is_joint()) {
    if (rule == nullptr) return true;
    if (phase.pull_back != nullptr && !phase.pull_back->lowers_loss() &&
        ComparesCosts(rule.get())) {
      *error = std::string(kComparesCosts) + kJointStepHasNoCost;
      return false;
    }
    return objective.model().CanLinearize(rule->Needs(), error);
  }
  if (phase.pull_back->needs_solutions()) {
    *error = "a point has no data to learn from";
  } else if (phase.ceres != nullptr) {
    return true;  // MakeBatchProposal checks the rest
  } else if (phase.pull_back->needs_batches()) {
    *error = "proxy, curvature_weight, updates and max_change need a network";
  } else if (ComparesCosts(rule.get())) {
    *error = std::string(kComparesCosts) +
             "the change that is pulled back to a point has none";
  } else {
    return phase.pull_back->CanPullBack(objective.model().simulator(), error);
  }
  return false;
}

// True, with *error set, if the method's phases or batches need samples.
bool NeedsNetwork(const Method& method, std::string* error) {
  if (method.phases.size() > 1) {
    *error = "a method in phases needs a network to train";
  } else if (method.last_phase().batch_size >= 0) {
    *error = "batch_size needs a network to train";
  } else if (method.last_phase().solves_output_layer()) {
    *error = "output_layer needs a network to train";
  } else {
    return false;
  }
  return true;
}

}  // namespace

bool IsForProblems(const Method& method, std::string* error) {
  if (NeedsNetwork(method, error)) return false;
  if (method.last_phase().pull_back == nullptr) return true;
  *error = "nothing can be pulled back part by part: there is no chain";
  return false;
}

bool TakesProposals(const Phase& phase,
                    const ceres::Problem& problem,
                    std::string* error) {
  return phase.rule == nullptr ||
         UpdateCallback::IsSupported(UpdateCallback::Options(), problem, error);
}

std::string MinimizeWithProposals(
    const Phase& phase,
    const MinimizerOptions& options,
    const ceres::Solver::Options& ceres_options,
    const UpdateCallback::Options& callback_options,
    const ProposalFunction& function,
    ceres::Problem* problem,
    MinimizerSummary* summary) {
  if (phase.rule == nullptr) {
    MinimizeWithCeres(options, ceres_options, problem, summary);
    return "";
  }
  std::unique_ptr<UpdateRule> rule;
  std::optional<UpdateCallback> callback;
  if (function != nullptr) {
    callback.emplace(function, problem, callback_options);
  } else {
    rule = phase.MakeRule();
    callback.emplace(rule.get(), problem, callback_options);
  }
  MinimizeWithCeres(options, ceres_options, problem, summary, &*callback);
  return "; " + callback->summary().BriefReport();
}

namespace {

// MinimizeProblem for a phase with a minimizer of Ceres.
bool MinimizePhase(
    const Phase& phase,
    const MinimizerOptions& options,
    std::shared_ptr<ceres::ParameterBlockOrdering> elimination_order,
    const ProposalFunction& function,
    ceres::Problem* problem,
    MinimizerSummary* summary,
    std::string* error) {
  ceres::Solver::Options solver_options = phase.CeresOptions();
  if (!CeresFitsInMemory(phase, solver_options, *problem, error) ||
      !TakesProposals(phase, *problem, error)) {
    return false;
  }
  if (ceres::IsSchurType(solver_options.linear_solver_type)) {
    solver_options.linear_solver_ordering = std::move(elimination_order);
  }
  UpdateCallback::Options callback_options;
  callback_options.block_name = options.block_name;
  callback_options.evaluation_callback = options.evaluation_callback;
  callback_options.manifold_ownership = options.manifold_ownership;
  const std::string proposals = MinimizeWithProposals(phase,
                                                      options,
                                                      solver_options,
                                                      callback_options,
                                                      function,
                                                      problem,
                                                      summary);
  GoOnWithinBounds(options, solver_options, problem, summary);
  summary->message += proposals;
  return true;
}

}  // namespace

bool MinimizeProblem(
    const Method& method,
    const MinimizerOptions& options,
    std::shared_ptr<ceres::ParameterBlockOrdering> elimination_order,
    ceres::Problem* problem,
    MinimizerSummary* summary,
    std::string* error) {
  if (!IsForProblems(method, error)) return false;
  const Phase& phase = method.last_phase();
  if (phase.ceres == nullptr) {
    if (!IsWithoutBounds(*problem, ReadStructure(*problem, {}), error)) {
      return false;
    }
    Minimize(options, phase.MakeRule().get(), problem, summary);
    return true;
  }
  if (elimination_order != nullptr) {
    // Ceres removes constant blocks from it.
    elimination_order =
        std::make_shared<ceres::ParameterBlockOrdering>(*elimination_order);
  }
  return MinimizePhase(phase,
                       options,
                       std::move(elimination_order),
                       /*function=*/nullptr,
                       problem,
                       summary,
                       error);
}

bool MinimizeByMethod(const Method& method,
                      const MinimizerOptions& options,
                      std::shared_ptr<const InverseSimulator> inverse,
                      PointObjective* objective,
                      std::vector<Eigen::VectorXd>* path,
                      MinimizerSummary* summary,
                      std::string* error) {
  path->clear();
  const Phase& phase = method.last_phase();
  if (NeedsNetwork(method, error) || !IsForPoints(phase, *objective, error)) {
    return false;
  }
  if (phase.ceres == nullptr) {
    MinimizeByRule(
        phase, options, std::move(inverse), objective, path, summary);
    return true;
  }
  Eigen::VectorXd x = objective->State();
  MinimizerOptions recorded = options;
  PathRecorder recorder([&x]() { return x; }, path);
  recorded.callbacks.insert(recorded.callbacks.begin(), &recorder);
  const ceres::Solver::Options ceres_options = phase.CeresOptions();
  if (!phase.ceres->is_trust_region) {
    // A line search uses the gradient and no Jacobian, which may be large.
    if (!HasStart(*objective, path, summary)) return true;
    MinimizeWithCeres(
        recorded,
        ceres_options,
        new ModelFunction(&objective->model(), &objective->data()),
        &x,
        summary);
  } else if (!objective->model().loss().SquaredNormFactor().has_value()) {
    *error = kNeedsLeastSquares;
    return false;
  } else {
    ceres::Problem problem;
    AddModelToProblem(
        objective->model(), objective->data(), x.data(), &problem);
    ProposalFunction function;
    if (phase.pull_back != nullptr) {
      function = MakeBatchProposal(phase,
                                   objective->model(),
                                   objective->data(),
                                   x.data(),
                                   std::move(inverse),
                                   error);
      if (function == nullptr) return false;
    }
    if (!HasStart(*objective, path, summary)) return true;
    if (!MinimizePhase(phase,
                       recorded,
                       /*elimination_order=*/nullptr,
                       function,
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
