// Blocks of the pseudo-inverse of J^T J for one group of parameter blocks.
//
//   C = (J^T J)^+,   A = J D^-1,   D = diag(|J e_i|)                        [1]
//
// The rank is that of A, whose singular values s <= limit count as zero. Of
// their right singular vectors V_0, rows with an undetermined share |V_0^T e_i|^2
// of rounding errors are set to zero. With an orthonormal basis N of J's null
// space, D N = V_0 T, and P = I - N N^T:
//
//   dense    C = P D^-1 V S^-2 V^T D^-1 P, over s > limit
//   sparse   C = P G P, G = the inverse of J^T J without the rows and columns
//            of k anchors, and zero there. k anchors are rows of V_0 that are
//            as independent as possible, so that holding them constant removes
//            the k undetermined directions. Every symmetric G with
//            J^T J G J^T J = J^T J gives the same C.
//
// The null space of the sparse case is a guess (gauge freedoms) that the
// factorization confirms: the largest eigenvalue of D C D is at most limit^-2.
// Without that, it is searched for (smallest_singular.h).
//
// Null vectors of the SVD are mixed with weak ones by 1e-16 s_max / s, which
// different units of the parameters enlarge. One step of iterative refinement
// takes that away, as far as A V_0 is known:
//
//   V_0 -= A^+ A V_0
//
// Shapes:  A: m x n;  V_0, N: n x k;  a block: range a x range b.
// Cost:    dense: 2 m n^2 + 22 n^3. Sparse: one decomposition of A^T A, about
//          15 + k solutions, and the entries of G (sparse_cholesky.h, or
//          schur_complement.h where few columns couple the others); entries
//          outside of the decomposition's pattern, and rows of blocks, cost one
//          solution a column.
// Fails:   returns false with a message if A is not finite, if a decomposition
//          fails or if there are more undetermined directions than
//          max_directions.
// Limits:  a variance has a relative error of about 1e-16 (s_max / s)^2 in the
//          sparse case, and of 1e-16 s_max / s in the dense one. In the sparse
//          case the variance of a parameter that is determined in part has
//          that error relative to the largest term of P G P, which other units
//          of the parameters enlarge; it is never below 0.
//
// [1] Ben-Israel, Greville. Generalized Inverses. 2003, section 2.3.
#ifndef INVGRAD_COVARIANCE_PSEUDO_INVERSE_H_
#define INVGRAD_COVARIANCE_PSEUDO_INVERSE_H_

#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "invgrad/rank/block_groups.h"
#include "invgrad/rank/decompositions.h"

namespace invgrad {

// Blocks of a group, counted in BlockGroup::blocks.
using GroupPair = std::pair<int, int>;

// Of the singular values of A.
struct SingularLimits {
  double zero = 0.0;  // s <= zero count as zero
  double weak = 0.0;  // zero < s <= weak: weak directions
};

struct PseudoInverse {
  Eigen::MatrixXd V_0;
  // Of the dense case, one a column: what weak directions add to the diagonal of
  // C, and what directions whose s counts as zero, but is not zero to rounding,
  // would add where the undetermined share is zero.
  Eigen::VectorXd weak_variances;
  Eigen::VectorXd omitted_variances;
  std::vector<Eigen::MatrixXd> blocks;  // one a pair
};

// svd: of the group's A.
PseudoInverse DensePseudoInverse(const BlockGroup& group,
                                 const RightSvd& svd,
                                 const SingularLimits& limits,
                                 const std::vector<GroupPair>& pairs);

// s_max: the largest singular value of A, to one percent. V: a guess of the null
// space of A, n x any, independent columns, all with |A v| <= limit |v|.
bool SparsePseudoInverse(const BlockGroup& group,
                         double s_max,
                         double limit,
                         int max_directions,
                         const Eigen::MatrixXd& V,
                         const std::vector<GroupPair>& pairs,
                         PseudoInverse* result,
                         std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_COVARIANCE_PSEUDO_INVERSE_H_
