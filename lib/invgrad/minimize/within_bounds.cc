#include "invgrad/minimize/within_bounds.h"

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "ceres/manifold.h"
#include "invgrad/ceres/bounds.h"
#include "invgrad/ceres/copy_problem.h"
#include "invgrad/ceres/problem_structure.h"
#include "invgrad/minimize/ceres_minimizer.h"

namespace invgrad {
namespace {

// The held components of each block that has some.
using HeldComponents = std::map<double*, std::vector<int>>;

HeldComponents FindHeld(const ProblemStructure& structure,
                        double gradient_tolerance,
                        ceres::Problem* problem) {
  ceres::Problem::EvaluateOptions options;
  for (const auto& block : structure.parameter_blocks) {
    if (block.manifold == nullptr) {
      options.parameter_blocks.push_back(block.values);
    }
  }
  std::vector<double> gradient;
  if (options.parameter_blocks.empty() ||
      !problem->Evaluate(options, nullptr, nullptr, &gradient, nullptr)) {
    return {};
  }
  HeldComponents held;
  const double* g = gradient.data();
  for (double* values : options.parameter_blocks) {
    for (int i = 0; i < problem->ParameterBlockSize(values); ++i, ++g) {
      if ((values[i] <= problem->GetParameterLowerBound(values, i) &&
           *g > gradient_tolerance) ||
          (values[i] >= problem->GetParameterUpperBound(values, i) &&
           *g < -gradient_tolerance)) {
        held[values].push_back(i);
      }
    }
  }
  return held;
}

void Append(const MinimizerSummary& next, MinimizerSummary* summary) {
  const int num_before = summary->num_steps();
  const double seconds = summary->total_time_in_seconds;
  for (std::size_t k = 1; k < next.iterations.size(); ++k) {
    summary->iterations.push_back(next.iterations[k]);
    ceres::IterationSummary& last = summary->iterations.back();
    last.iteration += num_before;
    last.cumulative_time_in_seconds += seconds;
  }
  summary->total_time_in_seconds += next.total_time_in_seconds;
  summary->num_outside_domain += next.num_outside_domain;
  if (!summary->first_outside_domain) {
    summary->first_outside_domain = next.first_outside_domain;
  }
  summary->termination_type = next.termination_type;
  summary->message = next.message;
  if (!next.iterations.empty()) summary->final_cost = next.final_cost;
}

// Solves for all components but those that are held.
void SolveForOthers(const MinimizerOptions& options,
                    const ceres::Solver::Options& ceres_options,
                    const HeldComponents& held,
                    ProblemStructure structure,
                    const ceres::Problem& problem,
                    MinimizerSummary* summary) {
  std::vector<std::unique_ptr<ceres::Manifold>> manifolds;
  std::vector<double*> constant;
  for (auto& block : structure.parameter_blocks) {
    const auto found = held.find(block.values);
    if (found == held.end()) continue;
    if (static_cast<int>(found->second.size()) == block.ambient_size) {
      constant.push_back(block.values);
      continue;
    }
    manifolds.push_back(std::make_unique<ceres::SubsetManifold>(
        block.ambient_size, found->second));
    block.manifold = manifolds.back().get();
  }
  ceres::Problem copy =
      CopyProblem(problem, structure, options.evaluation_callback);
  for (double* values : constant) copy.SetParameterBlockConstant(values);
  MinimizerOptions rest = options;
  rest.max_num_iterations =
      std::max(0, options.max_num_iterations - summary->num_steps());
  rest.max_time_in_seconds = std::max(
      0.0, options.max_time_in_seconds - summary->total_time_in_seconds);
  MinimizerSummary next;
  MinimizeWithCeres(rest, ceres_options, &copy, &next);
  Append(next, summary);
}

}  // namespace

void GoOnWithinBounds(const MinimizerOptions& options,
                      const ceres::Solver::Options& ceres_options,
                      ceres::Problem* problem,
                      MinimizerSummary* summary) {
  constexpr int kMaxSolves = 10;
  const ProblemStructure structure = ReadStructure(*problem, {});
  if (!Bounds(*problem, structure).any()) return;
  HeldComponents held;
  for (int k = 0; summary->termination_type == ceres::CONVERGENCE; ++k) {
    HeldComponents now =
        FindHeld(structure, options.gradient_tolerance, problem);
    if (now == held) return;
    if (k == kMaxSolves) {
      summary->termination_type = ceres::NO_CONVERGENCE;
      summary->message = std::string(kNoMinimumWithinBounds) + ". " +
                         "The components at bounds change from solve to solve.";
      return;
    }
    held = std::move(now);
    SolveForOthers(options, ceres_options, held, structure, *problem, summary);
  }
}

}  // namespace invgrad
