#include "invgrad/ceres/variable_cost.h"

#include <cmath>
#include <string>
#include <vector>

namespace invgrad {

double FixedCost(const ceres::Problem& problem,
                 const ProblemStructure& structure) {
  std::vector<ceres::ResidualBlockId> ids;
  problem.GetResidualBlocks(&ids);
  double sum = 0.0;
  for (const auto& block : structure.residual_blocks) {
    double cost = 0.0;
    if (block.row_length == 0 &&
        problem.EvaluateResidualBlock(
            ids[block.index], true, &cost, nullptr, nullptr)) {
      sum += cost;
    }
  }
  return sum;
}

VariableCost::VariableCost(const ceres::Problem& problem,
                           const ProblemLinearizer* linearizer)
    : linearizer_(*linearizer),
      fixed_cost_(FixedCost(problem, linearizer->structure())) {}

double VariableCost::Of(const ceres::IterationSummary& iteration) {
  const double cost = Compute(iteration);
  if (iteration.iteration == 0 || iteration.step_is_successful) cost_ = cost;
  return cost;
}

double VariableCost::Compute(const ceres::IterationSummary& iteration) const {
  constexpr double kDominates = 1e3;
  const double difference = iteration.cost - fixed_cost_;
  if (fixed_cost_ <= kDominates * std::abs(difference)) return difference;
  // The blocks hold another state. Ceres' cost_change has no fixed cost.
  if (iteration.iteration > 0 &&
      (!iteration.step_is_successful || iteration.step_is_nonmonotonic)) {
    return cost_ - iteration.cost_change;
  }
  // Another callback may have changed the blocks.
  constexpr double kCostTolerance = 1e-9;
  double cost = 0.0;
  std::string ignored;
  return linearizer_.Cost(&cost, &ignored) &&
                 std::abs(cost - difference) <= kCostTolerance * iteration.cost
             ? cost
             : difference;
}

}  // namespace invgrad
