// Which parameters to hold constant so that a problem becomes determined.
//
//   null directions left after holding the rows R:  { N c : N_R c = 0 },
//   so R takes rank(N_R) of them away
//
// Chosen greedily: the block that takes the most away, and of those the first
// unless another moves a hundred times as much.
// Held is no more than its rank, so that nothing is held that the residuals do
// determine, wherever components of the block can be held one by one.
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

// can_hold_rows[b]: rows of block b can be held one by one. At most
// max_anchors; the sum of their num_removed tells whether they are enough.
std::vector<Anchor> ChooseAnchors(Eigen::MatrixXd N,
                                  const std::vector<int>& offsets,
                                  const std::vector<bool>& can_hold_rows,
                                  int max_anchors);

}  // namespace invgrad

#endif  // INVGRAD_RANK_ANCHOR_H_
