#include "invgrad/ceres/variable_cost.h"

#include <cmath>
#include <string>
#include <vector>

#include "fmt/core.h"

namespace invgrad {

bool FixedCost(const ceres::Problem& problem,
               const ProblemStructure& structure,
               double* cost,
               std::string* error) {
  std::vector<ceres::ResidualBlockId> ids;
  problem.GetResidualBlocks(&ids);
  *cost = 0.0;
  for (const auto& block : structure.residual_blocks) {
    if (block.row_length > 0) continue;
    double of_block = 0.0;
    if (!problem.EvaluateResidualBlock(
            ids[block.index], true, &of_block, nullptr, nullptr) ||
        !std::isfinite(of_block)) {
      *error = fmt::format(
          "residual block {}, whose parameter blocks are constant, has no "
          "finite cost",
          block.index);
      return false;
    }
    *cost += of_block;
  }
  return true;
}

VariableCost::VariableCost(const ceres::Problem& problem,
                           const ProblemLinearizer* linearizer)
    : linearizer_(*linearizer) {
  std::string ignored;  // Ceres fails with it
  FixedCost(problem, linearizer->structure(), &fixed_cost_, &ignored);
}

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
