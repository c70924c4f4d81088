// Which parameters to hold constant so that a problem becomes determined.
//
//   null directions with rows R held constant:  { N c : N_R c = 0 },
//   so R removes rank(N_R) of them
//
// The choice is greedy: the block that removes most directions; of several, the
// first, unless another one moves a hundred times as much. If single components
// of the block can be held constant, an anchor consists of rank-many
// components.
//
// Shapes:  N: n x k, orthonormal columns, rows of comparable units; block b has
//          rows offsets[b] ... offsets[b + 1] - 1.
// Cost:    O(n k^2) an anchor.
#ifndef INVGRAD_RANK_ANCHOR_H_
#define INVGRAD_RANK_ANCHOR_H_

#include <vector>

#include "Eigen/Core"

namespace invgrad {

struct Anchor {
  int block = 0;
  std::vector<int> rows;  // of the block; all of them: hold the whole block
  int num_removed = 0;    // directions
};

// can_hold_rows[b]: single rows of block b can be held constant. Returns at
// most max_anchors anchors; they suffice if the sum of their num_removed is k.
std::vector<Anchor> ChooseAnchors(Eigen::MatrixXd N,
                                  const std::vector<int>& offsets,
                                  const std::vector<bool>& can_hold_rows,
                                  int max_anchors);

}  // namespace invgrad

#endif  // INVGRAD_RANK_ANCHOR_H_
