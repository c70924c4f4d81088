#include "invgrad/rank/smallest_singular.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "invgrad/core/jacobian_operator.h"
#include "invgrad/rank/decompositions.h"
#include "invgrad/rank/sparse_cholesky.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using SparseMatrix = Eigen::SparseMatrix<double>;

// Entries in [-1, 1], the same on every machine.
MatrixXd RandomMatrix(Index rows, Index cols, std::mt19937* generator) {
  MatrixXd result(rows, cols);
  for (Index j = 0; j < cols; ++j) {
    for (Index i = 0; i < rows; ++i) {
      result(i, j) = static_cast<double>((*generator)()) / 2147483648.0 - 1.0;
    }
  }
  return result;
}

bool IsFinite(const SparseMatrix& A, std::string* error) {
  const Eigen::Map<const VectorXd> values(A.valuePtr(), A.nonZeros());
  if (values.allFinite()) return true;
  *error = "the matrix is not finite";
  return false;
}

bool HasConverged(const VectorXd& s, std::string* error) {
  if (s.allFinite()) return true;
  *error = "LAPACK's singular value decomposition did not converge";
  return false;
}

}  // namespace

bool DenseSmallestSingular(const SparseMatrix& A,
                           double limit,
                           SmallestSingular* result,
                           std::string* error) {
  *result = SmallestSingular();
  if (A.cols() == 0) return true;
  if (!IsFinite(A, error)) return false;
  const RightSvd svd = ComputeRightSvd(A);
  if (!HasConverged(svd.s, error)) return false;
  const Index k = (svd.s.array() <= limit).count();
  result->s = svd.s.reverse();
  result->V = svd.V.rightCols(k).rowwise().reverse();
  return true;
}

bool DenseSingularValues(const SparseMatrix& A,
                         VectorXd* s,
                         std::string* error) {
  if (!IsFinite(A, error)) return false;
  *s = SingularValues(A);
  return HasConverged(*s, error);
}

bool SparseSmallestSingular(const SparseMatrix& A,
                            double s_max,
                            double limit,
                            int max_vectors,
                            SmallestSingular* result,
                            std::string* error) {
  *result = SmallestSingular();
  const Index n = A.cols();
  if (n == 0) return true;
  if (!IsFinite(A, error)) return false;

  // The decomposition rounds each pivot by a few 1e-16 s_max^2. The shift keeps
  // the pivots of undetermined directions positive.
  const SparseJacobian rows{SparseJacobian::Matrix(A)};
  SparseCholesky cholesky;
  if (!cholesky.Analyze(rows, /*memory_limit=*/0.0, error)) return false;
  double shift = 1e-12 * s_max * s_max;
  constexpr double kLargestShift = 1e-8;
  while (!cholesky.Factorize(shift, error)) {
    shift *= 100.0;
    if (shift > kLargestShift * s_max * s_max) return false;
  }

  // More columns than wanted vectors, for fast convergence, and because one
  // value above the limit shows that no smaller one is missing.
  constexpr Index kGuard = 8;
  constexpr Index kFirstBlock = 16;
  constexpr int kMaxIterations = 100;
  const Index largest_block = std::min<Index>(n, max_vectors + kGuard);
  std::mt19937 generator(1);
  MatrixXd V = Orthonormalized(
      RandomMatrix(n, std::min(kFirstBlock, largest_block), &generator));
  VectorXd s;
  VectorXd last;
  for (int iteration = 1;; ++iteration) {
    cholesky.Solve(V);
    V = Orthonormalized(V);
    // Rayleigh-Ritz: the right singular vectors of A on the span of V.
    const RightSvd svd = ComputeRightSvd(A * V);
    if (!HasConverged(svd.s, error)) return false;
    s = svd.s.reverse();
    V *= svd.V.rowwise().reverse();
    const Index num_small = (s.array() <= limit).count();
    // Includes values above the limit that may still fall below it.
    bool settled = last.size() == s.size();
    for (Index i = 0; settled && i < s.size() && s[i] <= 2.0 * limit; ++i) {
      settled = std::abs(s[i] - last[i]) <= 1e-3 * s[i] + 1e-9 * s_max;
    }
    const bool is_last = iteration == kMaxIterations;
    if (settled || is_last) {
      const bool is_all = V.cols() == n;
      if (is_last || is_all || num_small + kGuard / 2 <= V.cols() ||
          V.cols() == largest_block) {
        result->complete = settled && (is_all || num_small < V.cols());
        result->s = s;
        result->V = V.leftCols(num_small);
        return true;
      }
      const Index more = std::min(V.cols(), largest_block - V.cols());
      MatrixXd wider(n, V.cols() + more);
      wider << V, RandomMatrix(n, more, &generator);
      V = std::move(wider);
    }
    last = s;
  }
}

}  // namespace invgrad
