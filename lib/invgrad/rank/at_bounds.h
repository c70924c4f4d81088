// Tangent directions that move nothing but a component at its bound.
#ifndef INVGRAD_RANK_AT_BOUNDS_H_
#define INVGRAD_RANK_AT_BOUNDS_H_

#include <vector>

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "ceres/problem.h"
#include "invgrad/rank_report.h"

namespace invgrad {

// For each block its directions, ascending.
std::vector<std::vector<int>> DirectionsAtBounds(
    const ceres::Problem& problem,
    const std::vector<RankReport::Block>& blocks);

// Sets the columns of these directions to zero, with their lengths.
void RemoveColumns(const std::vector<RankReport::Block>& blocks,
                   const std::vector<std::vector<int>>& directions,
                   Eigen::SparseMatrix<double>* J,
                   Eigen::VectorXd* lengths);

}  // namespace invgrad

#endif  // INVGRAD_RANK_AT_BOUNDS_H_
