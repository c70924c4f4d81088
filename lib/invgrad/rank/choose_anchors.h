// Chooses parameters to hold constant, so that no direction of a subspace
// remains.
//
// Rows R of N held constant leave the directions { N c : N_R c = 0 }, so they
// remove rank(N_R) of them. The choice is greedy: the block that removes most
// directions; of several, the first, unless another one moves a hundred times as
// much.
//
// Shapes:  N: n x k with orthonormal columns, rows of comparable units. Block b
//          has rows offsets[b] ... offsets[b + 1] - 1.
#ifndef INVGRAD_RANK_CHOOSE_ANCHORS_H_
#define INVGRAD_RANK_CHOOSE_ANCHORS_H_

#include <vector>

#include "Eigen/Core"

namespace invgrad {

// Parameters of one block to hold constant.
struct Anchor {
  int block = 0;
  std::vector<int> rows;  // of the block; all of them: hold the whole block
  int num_removed = 0;    // directions
};

// An anchor consists of rank-many rows if can_hold_rows[block], otherwise of all
// rows of the block.
std::vector<Anchor> ChooseAnchors(Eigen::MatrixXd N,
                                  const std::vector<int>& offsets,
                                  const std::vector<bool>& can_hold_rows,
                                  int max_anchors);

}  // namespace invgrad

#endif  // INVGRAD_RANK_CHOOSE_ANCHORS_H_
