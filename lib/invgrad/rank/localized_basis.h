// A readable basis of a subspace: vectors that touch as few blocks of rows as
// possible.
//
//   span(W) = span(V)
//
// Directions within one block are found exactly: if |V_b c| = |c|, then V c is
// zero outside of block b. The others are those of the reduced echelon form on
// the pivot rows of a QR decomposition of V^T with column pivoting, which
// separates parts of disjoint support.
//
// Shapes:  V: n x k with orthonormal columns, rows of comparable units;
//          W: n x k, columns of length one, in general not orthogonal. Block b
//          has rows offsets[b] ... offsets[b + 1] - 1.
#ifndef INVGRAD_RANK_LOCALIZED_BASIS_H_
#define INVGRAD_RANK_LOCALIZED_BASIS_H_

#include <vector>

#include "Eigen/Core"

namespace invgrad {

// A vector of length one touches a block if the norm of its part in the block
// is larger.
constexpr double kNoPart = 1e-5;

struct LocalizedBasis {
  // Directions within one block, columns of length one, and their blocks.
  Eigen::MatrixXd single;
  std::vector<int> single_blocks;
  // The rest of span(V), orthogonal to `single`: an orthonormal basis, and a
  // localized one, sorted by the number of touched blocks.
  Eigen::MatrixXd rest;
  Eigen::MatrixXd localized_rest;
};

LocalizedBasis Localize(const Eigen::Ref<const Eigen::MatrixXd>& V,
                        const std::vector<int>& offsets);

// The number of blocks that a vector of length one touches.
int NumParts(const Eigen::Ref<const Eigen::VectorXd>& v,
             const std::vector<int>& offsets);

// An orthonormal basis of the part of span(V) that is orthogonal to the
// independent columns of U, which lie in span(V).
Eigen::MatrixXd OrthogonalRest(const Eigen::Ref<const Eigen::MatrixXd>& V,
                               const Eigen::Ref<const Eigen::MatrixXd>& U);

}  // namespace invgrad

#endif  // INVGRAD_RANK_LOCALIZED_BASIS_H_
