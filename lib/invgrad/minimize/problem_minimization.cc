#include "invgrad/minimize/problem_minimization.h"

#include <utility>
#include <vector>

#include "ceres/types.h"
#include "invgrad/ceres/problem_structure.h"
#include "invgrad/ceres/update_callback.h"
#include "invgrad/minimize/ceres_minimizer.h"

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
  double rows = 0.0;
  for (const auto& block : structure.residual_blocks) {
    if (block.row_length > 0) rows += block.size;
  }
  std::vector<MemoryPart> parts;
  if (!phase.ceres->is_trust_region) {
    if (options.line_search_direction_type != ceres::BFGS) return true;
    parts = {{"inverse Hessian", 2.0 * sizeof(double) * cols * cols}};
  } else if (options.linear_solver_type == ceres::DENSE_QR ||
             options.linear_solver_type == ceres::DENSE_NORMAL_CHOLESKY) {
    parts = TrustRegionMemory(options.linear_solver_type, rows, cols);
  }
  return FitsInMemory(phase.label, std::move(parts), /*limit=*/0.0, error);
}

}  // namespace

bool IsForProblems(const Method& method, std::string* error) {
  if (method.phases.size() > 1) {
    *error = "a method in phases needs a network to train";
  } else if (method.last_phase().pull_back.has_value()) {
    *error = "nothing can be pulled back part by part: there is no chain";
  } else if (method.last_phase().batch_size >= 0) {
    *error = "batch_size needs a network to train";
  } else {
    return true;
  }
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
    ceres::Problem* problem,
    MinimizerSummary* summary) {
  if (phase.rule == nullptr) {
    MinimizeWithCeres(options, ceres_options, problem, summary);
    return "";
  }
  const std::unique_ptr<UpdateRule> rule = phase.MakeRule();
  UpdateCallback callback(rule.get(), problem, callback_options);
  MinimizeWithCeres(options, ceres_options, problem, summary, &callback);
  return "; " + callback.summary().BriefReport();
}

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
    Minimize(options, phase.MakeRule().get(), problem, summary);
    return true;
  }
  ceres::Solver::Options solver_options = phase.CeresOptions();
  if (!CeresFitsInMemory(phase, solver_options, *problem, error) ||
      !TakesProposals(phase, *problem, error)) {
    return false;
  }
  if (ceres::IsSchurType(solver_options.linear_solver_type)) {
    solver_options.linear_solver_ordering = std::move(elimination_order);
  }
  const std::string proposals = MinimizeWithProposals(
      phase, options, solver_options, {}, problem, summary);
  summary->message += proposals;
  return true;
}

}  // namespace invgrad
