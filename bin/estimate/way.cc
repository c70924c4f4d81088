#include "bin/estimate/way.h"

#include <chrono>
#include <limits>

#include "Eigen/Core"
#include "ceres/solver.h"
#include "invgrad/ceres/problem_structure.h"
#include "invgrad/method.h"
#include "invgrad/methods/ceres_methods.h"
#include "invgrad/separable.h"

namespace invgrad {

std::vector<Way> Ways(const std::vector<Method>& methods,
                      const std::string& separable) {
  std::vector<Way> ways;
  for (const Method& method : methods) {
    if (separable != "on") ways.push_back({method, false, method.label});
    if (separable != "off") {
      ways.push_back({method, true, method.label + " separable"});
    }
  }
  return ways;
}

namespace {

// Relaxes, unless that raises the cost, and minimizes.
bool MinimizeRelaxed(const Way& way,
                     const MinimizerOptions& options,
                     Estimation* estimation,
                     ceres::Problem* problem,
                     MinimizerSummary* summary,
                     std::string* error) {
  Method method = way.method;
  Phase& phase = method.phases.back();
  phase.rule = nullptr;
  if (phase.ceres == nullptr || way.is_separable) {
    *error = "chordal is a start for Ceres: ceres_lm+chordal";
    return false;
  }
  const auto start = std::chrono::steady_clock::now();
  const ProblemStructure structure = ReadStructure(*problem, {});
  const Eigen::VectorXd given = structure.State();
  const auto cost = [problem] {
    double value = 0.0;
    return problem->Evaluate({}, &value, nullptr, nullptr, nullptr)
               ? value
               : std::numeric_limits<double>::infinity();
  };
  const double initial_cost = cost();
  const bool is_relaxed = estimation->Relax();
  const bool takes_it = is_relaxed && cost() < initial_cost;
  if (!takes_it) structure.SetState(given);
  const std::chrono::duration<double> seconds =
      std::chrono::steady_clock::now() - start;
  if (!MinimizeProblem(method,
                       options,
                       estimation->MakeOrdering(),
                       problem,
                       summary,
                       error)) {
    return false;
  }
  summary->initial_cost = initial_cost;
  // The relaxation comes before iteration 0.
  for (ceres::IterationSummary& iteration : summary->iterations) {
    iteration.cumulative_time_in_seconds += seconds.count();
  }
  summary->total_time_in_seconds += seconds.count();
  summary->message += takes_it     ? "; from relaxed poses"
                      : is_relaxed ? "; relaxed poses cost more than the start"
                                   : "; nothing to relax";
  return true;
}

}  // namespace

bool MinimizeByWay(const Way& way,
                   const MinimizerOptions& options,
                   Estimation* estimation,
                   ceres::Problem* problem,
                   MinimizerSummary* summary,
                   std::string* error) {
  const Phase& phase = way.method.last_phase();
  ceres::Solver::Options ignored;
  if (phase.ceres != nullptr &&
      !phase.ceres->configure(phase.ceres_settings, &ignored, error)) {
    return false;  // the problem's own linear solver
  }
  const RuleRow* rule = phase.rule;
  if (rule != nullptr && rule->name == "chordal") {
    return MinimizeRelaxed(way, options, estimation, problem, summary, error);
  }
  if (!way.is_separable) {
    return MinimizeProblem(way.method,
                           options,
                           estimation->MakeOrdering(),
                           problem,
                           summary,
                           error);
  }
  const std::vector<LinearBlock> linear = estimation->LinearParameters();
  if (linear.empty()) {
    *error =
        "no parameter is proved to be linear (those of a --model are not "
        "analysed); use --separable=off";
    return false;
  }
  SeparableProblem::Options separable_options;
  separable_options.block_name = options.block_name;
  const auto separable =
      SeparableProblem::Create(separable_options, linear, problem, error);
  MinimizerOptions reduced_options = options;
  reduced_options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  if (separable == nullptr || !MinimizeProblem(way.method,
                                               reduced_options,
                                               /*elimination_order=*/nullptr,
                                               separable->reduced(),
                                               summary,
                                               error)) {
    return false;
  }
  std::string why;
  if (!separable->SolveLinear(&why)) {
    summary->termination_type = ceres::FAILURE;
    summary->message = why;
  }
  return true;
}

}  // namespace invgrad
