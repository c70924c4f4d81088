#include "invgrad/rank/at_bounds.h"

namespace invgrad {

std::vector<std::vector<int>> DirectionsAtBounds(
    const ceres::Problem& problem,
    const std::vector<RankReport::Block>& blocks) {
  std::vector<std::vector<int>> directions(blocks.size());
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const RankReport::Block& block = blocks[b];
    for (int j = 0; j < block.tangent_size; ++j) {
      const int i = block.components[j];
      if (i < 0) continue;
      const double x = block.values[i];
      if (x <= problem.GetParameterLowerBound(block.values, i) ||
          x >= problem.GetParameterUpperBound(block.values, i)) {
        directions[b].push_back(j);
      }
    }
  }
  return directions;
}

void RemoveColumns(const std::vector<RankReport::Block>& blocks,
                   const std::vector<std::vector<int>>& directions,
                   Eigen::SparseMatrix<double>* J,
                   Eigen::VectorXd* lengths) {
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    for (const int j : directions[b]) (*lengths)[blocks[b].column + j] = 0.0;
  }
  J->prune([lengths](Eigen::Index, Eigen::Index j, double) {
    return (*lengths)[j] != 0.0;
  });
}

}  // namespace invgrad
