// Describes the null space and the weak directions of one group of blocks:
// directions in a readable basis, gauge freedoms by name, equal parameters, and
// blocks to hold constant.
#ifndef INVGRAD_RANK_DESCRIBE_GROUP_H_
#define INVGRAD_RANK_DESCRIBE_GROUP_H_

#include "Eigen/Core"
#include "ceres/problem.h"
#include "invgrad/rank/block_groups.h"
#include "invgrad/rank_report.h"

namespace invgrad {

// null_space and weak: right singular vectors of groups[g].A, orthonormal
// columns. Appends to the report's directions, gauges and suggestions; the
// report's s_max and thresholds must be set.
void DescribeGroup(const RankReport::Options& options,
                   const ceres::Problem& problem,
                   const BlockGroup& group,
                   int g,
                   const Eigen::MatrixXd& null_space,
                   const Eigen::MatrixXd& weak,
                   RankReport* report);

}  // namespace invgrad

#endif  // INVGRAD_RANK_DESCRIBE_GROUP_H_
