#include "invgrad/rank/smallest_singular.h"

#include <lapacke.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "Eigen/CholmodSupport"
#include "fmt/core.h"
#include "invgrad/core/dense_svd.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/qr.h"
#include "invgrad/rank/decompositions.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using SparseMatrix = Eigen::SparseMatrix<double>;

using Cholesky = Eigen::CholmodDecomposition<SparseMatrix>;

double LargestOfTridiagonal(std::vector<double> diagonal,
                            std::vector<double> off_diagonal) {
  const auto size = static_cast<lapack_int>(diagonal.size());
  CHECK_EQ(LAPACKE_dsterf(size, diagonal.data(), off_diagonal.data()), 0);
  return diagonal.back();
}

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

// L L^T = P (A^T A + shift I) P^T, P a fill-reducing permutation.
bool Factorize(const SparseMatrix& A,
               double s_max,
               Cholesky* cholesky,
               std::string* error) {
  cholmod_common& common = cholesky->cholmod();
  common.print = 0;  // failures are in *error
  common.final_ll = 1;
  const SparseMatrix normal = A.transpose() * A;
  cholesky->analyzePattern(normal);
  if (common.status < CHOLMOD_OK) {
    *error = "J^T J could not be analyzed: it is too large";
    return false;
  }
  if (!FitsInMemory(
          fmt::format("the Cholesky factor of a J with {} columns", A.cols()),
          {{"its entries", sizeof(double) * common.lnz}},
          /*limit=*/0.0,
          error)) {
    return false;
  }
  // The decomposition rounds each pivot by a few 1e-16 s_max^2. The shift keeps
  // the pivots of undetermined directions positive.
  constexpr double kLargestShift = 1e-8;
  for (double shift = 1e-12; shift <= kLargestShift; shift *= 100.0) {
    cholesky->setShift(shift * s_max * s_max);
    cholesky->factorize(normal);
    if (cholesky->info() == Eigen::Success && common.status == CHOLMOD_OK) {
      return true;
    }
  }
  *error = common.status == CHOLMOD_OUT_OF_MEMORY
               ? "there is no memory for the Cholesky factor of J^T J"
               : "J^T J is not positive definite to rounding";
  return false;
}

}  // namespace

double LargestEigenvalue(Index n,
                         const std::function<VectorXd(const VectorXd&)>& times,
                         double threshold) {
  constexpr int kMaxSteps = 100;
  constexpr int kStepsBetweenTests = 8;
  constexpr double kTolerance = 1e-3;
  constexpr int kStepsToPercent = 12;
  std::vector<double> diagonal;
  std::vector<double> off_diagonal;
  // Without symmetries, so that it is unlikely to be orthogonal to a singular
  // vector.
  VectorXd v = VectorXd::NullaryExpr(n, [](Index i) {
    return 1.0 + 0.5 * std::sin(1.7 * static_cast<double>(i + 1));
  });
  v.normalize();
  VectorXd previous = VectorXd::Zero(n);
  double beta = 0.0;
  double largest = 0.0;
  const int max_steps = static_cast<int>(std::min<Index>(kMaxSteps, n));
  for (int step = 1; step <= max_steps; ++step) {
    VectorXd w = times(v);
    const double alpha = v.dot(w);
    if (!std::isfinite(alpha)) return std::numeric_limits<double>::quiet_NaN();
    diagonal.push_back(alpha);
    w -= alpha * v + beta * previous;
    beta = w.norm();
    // The Krylov space is invariant.
    const bool is_exhausted =
        beta <= std::numeric_limits<double>::epsilon() * alpha;
    if (step == kStepsToPercent && threshold > 0.0 &&
        100.0 * LargestOfTridiagonal(diagonal, off_diagonal) <= threshold) {
      return LargestOfTridiagonal(diagonal, off_diagonal);
    }
    if (step % kStepsBetweenTests == 0 || step == max_steps || is_exhausted) {
      const double last = largest;
      largest = LargestOfTridiagonal(diagonal, off_diagonal);
      if (is_exhausted || largest - last <= 2.0 * kTolerance * largest) break;
    }
    off_diagonal.push_back(beta);
    previous = v;
    v = w / beta;
  }
  return std::max(largest, 0.0);
}

double LargestSingularValue(const SparseMatrix& A) {
  return std::sqrt(
      LargestEigenvalue(A.cols(), [&A](const VectorXd& v) -> VectorXd {
        return A.transpose() * (A * v).eval();
      }));
}

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

  Cholesky cholesky;
  if (!Factorize(A, s_max, &cholesky, error)) return false;

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
    V = Orthonormalized(cholesky.solve(V));
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
