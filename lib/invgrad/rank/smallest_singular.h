// The largest singular value of a sparse matrix, and its smallest ones with
// their right singular vectors.
//
//   A V = U diag(s),   s <= limit
//
// Two algorithms for the smallest ones, which agree if both resolve the values:
//   dense    QR of A, then the SVD of R: all singular values, to a few
//            roundings of the largest one.
//   sparse   subspace iteration with (A^T A + shift I)^-1 by CHOLMOD [1]. The
//            values are those of A V, not of A^T A, and resolved to about 1e-9
//            s_max.
//
// Shapes:  A: m x n;  s: ascending;  V: n x k, orthonormal columns.
// Cost:    dense: 2 m n^2 + 22 n^3 and m n numbers. Sparse: one decomposition
//          of A^T A with AMD's ordering, then about ten times k + 8 solutions.
// Fails:   returns false with a message if A is not finite or a decomposition
//          fails. If the iteration does not converge, for example with a
//          hundred close values, the result is partial, and `complete` is
//          false.
//
// [1] Chen, Davis, Hager, Rajamanickam. Algorithm 887: CHOLMOD. ACM TOMS 35
//     (2008).
// [2] Paige. Accuracy and effectiveness of the Lanczos algorithm for the
//     symmetric eigenproblem. Linear Algebra Appl. 34 (1980).
// [3] Kuczynski, Wozniakowski. Estimating the largest eigenvalue by the power
//     and Lanczos algorithms with a random start. SIAM J. Matrix Anal. Appl. 13
//     (1992), theorem 4.2.
#ifndef INVGRAD_RANK_SMALLEST_SINGULAR_H_
#define INVGRAD_RANK_SMALLEST_SINGULAR_H_

#include <functional>
#include <string>

#include "Eigen/Core"
#include "Eigen/SparseCore"

namespace invgrad {

// The largest eigenvalue of a symmetric matrix M >= 0, n x n, given by v -> M v:
// by the Lanczos iteration without reorthogonalization, which the largest value
// does not need [2]: a lower bound, to about 2e-3, by 10 to 40 products. NaN if
// a product is not finite; 0 for M = 0. A value below `threshold` is not refined
// where a hundred times the bound of 12 products is below it, too: from a random
// start, 12 products find less than 1 % of the value with a probability of
// 1.65 sqrt(n) e^-23 [3].
double LargestEigenvalue(
    Eigen::Index n,
    const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& times,
    double threshold = 0.0);

// The square root of that of A^T A: a lower bound, to about 1e-3.
double LargestSingularValue(const Eigen::SparseMatrix<double>& A);

struct SmallestSingular {
  // Ascending; dense: all n, including zeros for m < n. Sparse: the values
  // found; values above the limit may not have converged.
  Eigen::VectorXd s;
  // The vectors of all s <= limit.
  Eigen::MatrixXd V;
  // False if there may be further values s <= limit.
  bool complete = true;
};

bool DenseSmallestSingular(const Eigen::SparseMatrix<double>& A,
                           double limit,
                           SmallestSingular* result,
                           std::string* error);

// s_max: the largest singular value of A, to one percent.
bool SparseSmallestSingular(const Eigen::SparseMatrix<double>& A,
                            double s_max,
                            double limit,
                            int max_vectors,
                            SmallestSingular* result,
                            std::string* error);

// All min(m, n) singular values of A, descending, without vectors.
bool DenseSingularValues(const Eigen::SparseMatrix<double>& A,
                         Eigen::VectorXd* s,
                         std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_RANK_SMALLEST_SINGULAR_H_
