#include "invgrad/ceres/bounds.h"

#include <limits>

namespace invgrad {

Bounds::Bounds(const ceres::Problem& problem,
               const ProblemStructure& structure) {
  // "If the parameter is not bounded by the user" (ceres/problem.h).
  constexpr double kUnbounded = std::numeric_limits<double>::max();
  lower_.setConstant(structure.num_ambient, -kUnbounded);
  upper_.setConstant(structure.num_ambient, kUnbounded);
  for (const auto& block : structure.parameter_blocks) {
    for (int i = 0; i < block.ambient_size; ++i) {
      lower_[block.offset + i] =
          problem.GetParameterLowerBound(block.values, i);
      upper_[block.offset + i] =
          problem.GetParameterUpperBound(block.values, i);
    }
  }
  const bool is_bounded = (lower_.array() > -kUnbounded).any() ||
                          (upper_.array() < kUnbounded).any();
  if (is_bounded) return;
  lower_.resize(0);
  upper_.resize(0);
}

void Bounds::Project(Eigen::VectorXd* state) const {
  if (any()) *state = state->cwiseMax(lower_).cwiseMin(upper_);
}

bool IsWithoutBounds(const ceres::Problem& problem,
                     const ProblemStructure& structure,
                     std::string* error) {
  if (!Bounds(problem, structure).any()) return true;
  *error =
      "the problem has bounds, which the steps of a rule alone do not keep; "
      "take its steps as proposals to Ceres, as in ceres_lm+geodesic";
  return false;
}

}  // namespace invgrad
