#include "invgrad/minimize/within_bounds.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "ceres/crs_matrix.h"
#include "ceres/manifold.h"
#include "invgrad/ceres/bounds.h"
#include "invgrad/ceres/copy_problem.h"
#include "invgrad/ceres/problem_structure.h"
#include "invgrad/ceres/variable_cost.h"
#include "invgrad/minimize/ceres_minimizer.h"

namespace invgrad {
namespace {

// The held components of each block that has some.
using HeldComponents = std::map<double*, std::vector<int>>;

// A component that a bound stops.
struct Stopped {
  double* block;
  int index;
  double start;     // x_i
  double step;      // -g_i / d_i
  double bound;     // that the step reaches
  bool is_outward;  // |g_i| exceeds the gradient tolerance

  double& value() const { return block[index]; }
  void MoveBy(double t) const {
    const double moved = start + t * step;
    value() = step < 0.0 ? std::max(moved, bound) : std::min(moved, bound);
  }
};

// False if the problem cannot be evaluated.
bool FindStopped(const ProblemStructure& structure,
                 double gradient_tolerance,
                 ceres::Problem* problem,
                 double* cost,
                 std::vector<Stopped>* stopped) {
  ceres::Problem::EvaluateOptions options;
  for (const auto& block : structure.parameter_blocks) {
    if (block.manifold == nullptr) {
      options.parameter_blocks.push_back(block.values);
    }
  }
  std::vector<double> gradient;
  ceres::CRSMatrix jacobian;
  if (options.parameter_blocks.empty() ||
      !problem->Evaluate(options, cost, nullptr, &gradient, &jacobian)) {
    return false;
  }
  std::vector<double> squares(gradient.size(), 0.0);
  for (std::size_t k = 0; k < jacobian.values.size(); ++k) {
    squares[jacobian.cols[k]] += jacobian.values[k] * jacobian.values[k];
  }
  std::size_t column = 0;
  for (double* values : options.parameter_blocks) {
    for (int i = 0; i < problem->ParameterBlockSize(values); ++i, ++column) {
      const double g = gradient[column];
      if (g == 0.0 || squares[column] == 0.0) continue;
      const double step = -g / squares[column];
      const double bound = step < 0.0
                               ? problem->GetParameterLowerBound(values, i)
                               : problem->GetParameterUpperBound(values, i);
      const double end = values[i] + step;
      if (step < 0.0 ? end > bound : end < bound) continue;
      stopped->push_back({values,
                          i,
                          values[i],
                          step,
                          bound,
                          std::abs(g) > gradient_tolerance});
    }
  }
  return true;
}

double Cost(ceres::Problem* problem) {
  double cost;
  return problem->Evaluate({}, &cost, nullptr, nullptr, nullptr)
             ? cost
             : std::numeric_limits<double>::infinity();
}

// Takes the step of the stopped components. Returns the cost after it.
double ProjectedStep(const std::vector<Stopped>& stopped,
                     double cost,
                     ceres::Problem* problem) {
  constexpr double kLeastStep = 1e-6;
  if (std::all_of(stopped.begin(), stopped.end(), [](const auto& component) {
        return component.start == component.bound;
      })) {
    return cost;
  }
  for (double t = 1.0; t > kLeastStep; t *= 0.5) {
    for (const Stopped& component : stopped) component.MoveBy(t);
    const double new_cost = Cost(problem);
    if (new_cost <= cost) return new_cost;
  }
  for (const Stopped& component : stopped) component.value() = component.start;
  return cost;
}

HeldComponents FindHeld(const std::vector<Stopped>& stopped) {
  HeldComponents held;
  for (const Stopped& component : stopped) {
    if (component.is_outward && component.value() == component.bound) {
      held[component.block].push_back(component.index);
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
                    ceres::Solver::Options ceres_options,
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
  // Ceres removes constant blocks from the ordering.
  if (auto& ordering = ceres_options.linear_solver_ordering) {
    ordering = std::make_shared<ceres::ParameterBlockOrdering>(*ordering);
  }
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
  const ProblemStructure structure = ReadStructure(*problem, {});
  if (!Bounds(*problem, structure).any()) return;
  double fixed_cost = 0.0;
  std::string ignored;
  FixedCost(*problem, structure, &fixed_cost, &ignored);
  HeldComponents held;
  std::map<HeldComponents, double> costs;  // before the last solve with these
  while (summary->termination_type == ceres::CONVERGENCE) {
    double cost;
    std::vector<Stopped> stopped;
    if (!FindStopped(
            structure, options.gradient_tolerance, problem, &cost, &stopped)) {
      return;
    }
    const double new_cost = ProjectedStep(stopped, cost, problem);
    // Not negative, although the sums are rounded in another order.
    const double least_decrease =
        options.function_tolerance * std::max(0.0, cost - fixed_cost);
    HeldComponents now = FindHeld(stopped);
    if (costs.empty()) costs[held] = cost;
    const auto last = costs.find(now);
    if (last != costs.end() && last->second - new_cost <= least_decrease) {
      if (now == held) {
        for (const Stopped& component : stopped) {
          component.value() = component.start;
        }
      } else {
        summary->termination_type = ceres::NO_CONVERGENCE;
        summary->message =
            std::string(kNoMinimumWithinBounds) +
            ". The components at bounds change from solve to solve, and the "
            "cost falls by less than the function tolerance.";
      }
      return;
    }
    costs[now] = new_cost;
    held = std::move(now);
    SolveForOthers(options, ceres_options, held, structure, *problem, summary);
  }
}

}  // namespace invgrad
