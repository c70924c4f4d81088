// A readable basis of a subspace: vectors that touch as few blocks of rows as
// possible.
//
//   span(W) = span(V)
//
// A null space comes out of an SVD as any rotation of itself. Directions within
// one block are found exactly: c with |V_b c| = |c| is one of block b alone.
// The others are those of the reduced echelon form on pivot rows that a QR
// decomposition of V^T with column pivoting chooses: parts of the space with
// disjoint support come apart.
//
// Shapes:  V: n x k with orthonormal columns;  W: n x k, columns of length one,
//          in general not orthogonal. Blocks are rows offsets[b] ...
//          offsets[b + 1] - 1.
// Cost:    n k^2.
// Units:   judges sizes of entries, so rows should have comparable units.
#ifndef INVGRAD_RANK_LOCALIZED_BASIS_H_
#define INVGRAD_RANK_LOCALIZED_BASIS_H_

#include <vector>

#include "Eigen/Core"

namespace invgrad {

// A block takes part in a vector of length one if its part is longer.
constexpr double kNoPart = 1e-5;

struct LocalizedBasis {
  // Directions within one block, columns of length one, and their blocks.
  Eigen::MatrixXd single;
  std::vector<int> single_blocks;
  // The rest of span(V), orthogonal to `single`: orthonormal, and localized,
  // those that touch the fewest blocks first.
  Eigen::MatrixXd rest;
  Eigen::MatrixXd localized_rest;
};

LocalizedBasis Localize(const Eigen::Ref<const Eigen::MatrixXd>& V,
                        const std::vector<int>& offsets);

// The number of blocks that take part in a vector of length one.
int NumParts(const Eigen::Ref<const Eigen::VectorXd>& v,
             const std::vector<int>& offsets);

// An orthonormal basis of the part of span(V) that is orthogonal to the
// independent columns of U, which lie in span(V).
Eigen::MatrixXd OrthogonalRest(const Eigen::Ref<const Eigen::MatrixXd>& V,
                               const Eigen::Ref<const Eigen::MatrixXd>& U);

}  // namespace invgrad

#endif  // INVGRAD_RANK_LOCALIZED_BASIS_H_
