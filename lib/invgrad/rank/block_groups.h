// Groups of parameter blocks that residuals couple, and the Jacobian of each
// group.
//
//   A = J D^-1,   D = diag(|J e_i|), or as RankReport::Options::group_sizes say
//
// Columns of components at their bounds may be left out, as if the components
// were constant.
//
// Two blocks are in one group if a row of J has nonzero entries in both, or if
// a chain of such pairs connects them. Columns of zeros belong to no group.
//
// Cost:    one linearization of the problem, and O(entries of J).
#ifndef INVGRAD_RANK_BLOCK_GROUPS_H_
#define INVGRAD_RANK_BLOCK_GROUPS_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "ceres/problem.h"
#include "invgrad/rank_report.h"

namespace invgrad {

// Of a residual block.
struct BlockArgument {
  const double* values = nullptr;
  int block = -1;  // of the report; -1: constant
};

struct BlockGroup {
  std::vector<int> blocks;        // of the report
  std::vector<int> columns;       // of the problem's J
  Eigen::VectorXd lengths;        // D, of these columns
  std::vector<int> offsets;       // first column of each block, and the end
  Eigen::SparseMatrix<double> A;  // J D^-1, rows and columns of the group
  // The residual blocks that use a block of the group.
  std::vector<std::vector<BlockArgument>> arguments;
};

// Whether A has few enough entries for dense decompositions; and whether it is
// small enough by the options, too.
bool MayBeDense(const BlockGroup& group);
bool IsDense(const RankReport::Options& options, const BlockGroup& group);

// Linearizes the problem and fills the report's sizes, blocks, unused
// parameters, short columns and lengths of columns. Returns false, with a
// message, if a cost function fails or is not finite, if memory does not
// suffice, or if group_sizes do not fit to a block. `at_bound`: for each block
// of the report its tangent directions that move a component at its bound
// alone; they count as unused. Null: bounds do not matter.
bool GroupBlocks(const RankReport::Options& options,
                 const ceres::Problem& problem,
                 RankReport* report,
                 std::vector<std::vector<int>>* at_bound,
                 std::vector<BlockGroup>* groups,
                 std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_RANK_BLOCK_GROUPS_H_
