#include "invgrad/rank/smallest_singular.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "Eigen/QR"
#include "invgrad/core/blas.h"
#include "invgrad/core/jacobian_operator.h"
#include "invgrad/core/small_svd.h"
#include "invgrad/rank/sparse_cholesky.h"
#include "lapacke.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using SparseMatrix = Eigen::SparseMatrix<double>;

// Matrices with fewer columns are decomposed faster by one thread (blas.h).
constexpr Index kThreads = 1000;

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

// A, or its R if A is much taller than wide: the same s and V. Rows of zeros
// are added if A is wide, so that V is complete.
bool Triangle(const SparseMatrix& A, MatrixXd* R, std::string* error) {
  const Index m = A.rows();
  const Index n = A.cols();
  R->setZero(std::max(m, n), n);
  R->topRows(m) = A;
  if (m < n + n / 4) return true;
  VectorXd tau(n);
  if (LAPACKE_dgeqrf(LAPACK_COL_MAJOR,
                     static_cast<lapack_int>(m),
                     static_cast<lapack_int>(n),
                     R->data(),
                     static_cast<lapack_int>(m),
                     tau.data()) != 0) {
    *error = "LAPACK's QR decomposition failed";
    return false;
  }
  const MatrixXd triangle =
      R->topRows(n).triangularView<Eigen::Upper>().toDenseMatrix();
  *R = triangle;
  return true;
}

// The SVD of A, which is overwritten; VT is empty if it is not wanted.
bool Svd(bool with_vectors,
         MatrixXd* A,
         VectorXd* s,
         MatrixXd* VT,
         std::string* error) {
  const auto rows = static_cast<lapack_int>(A->rows());
  const auto cols = static_cast<lapack_int>(A->cols());
  s->resize(std::min(rows, cols));
  if (with_vectors) VT->resize(cols, cols);
  double unused = 0.0;
  if (LAPACKE_dgesdd(LAPACK_COL_MAJOR,
                     with_vectors ? 'O' : 'N',  // U overwrites A
                     rows,
                     cols,
                     A->data(),
                     rows,
                     s->data(),
                     &unused,
                     with_vectors ? rows : 1,
                     with_vectors ? VT->data() : &unused,
                     with_vectors ? cols : 1) != 0) {
    *error = "LAPACK's SVD did not converge";
    return false;
  }
  return true;
}

MatrixXd Orthonormalized(const MatrixXd& X) {
  const Eigen::HouseholderQR<MatrixXd> qr(X);
  return qr.householderQ() * MatrixXd::Identity(X.rows(), X.cols());
}

// Replaces V by the right singular vectors of A on its span, s ascending.
void RayleighRitz(const SparseMatrix& A, MatrixXd* V, VectorXd* s) {
  const MatrixXd AV = A * *V;
  SmallSvd svd;
  if (AV.rows() > AV.cols()) {
    const Eigen::HouseholderQR<MatrixXd> qr(AV);
    svd.Compute(qr.matrixQR()
                    .topRows(AV.cols())
                    .triangularView<Eigen::Upper>()
                    .toDenseMatrix());
  } else {
    MatrixXd padded = MatrixXd::Zero(AV.cols(), AV.cols());
    padded.topRows(AV.rows()) = AV;
    svd.Compute(padded);
  }
  *s = svd.s.reverse();
  *V = *V * svd.V.rowwise().reverse();
}

}  // namespace

bool DenseSmallestSingular(const SparseMatrix& A,
                           double limit,
                           SmallestSingular* result,
                           std::string* error) {
  const Index n = A.cols();
  *result = SmallestSingular();
  if (n == 0) return true;
  const SingleBlasThread single_thread(n < kThreads);
  MatrixXd R;
  MatrixXd VT;
  VectorXd s;
  if (!IsFinite(A, error) || !Triangle(A, &R, error) ||
      !Svd(true, &R, &s, &VT, error)) {
    return false;
  }
  result->s = s.reverse();
  const Index k = (s.array() <= limit).count();
  result->V = VT.bottomRows(k).transpose().rowwise().reverse();
  return true;
}

bool DenseSingularValues(const SparseMatrix& A,
                         VectorXd* s,
                         std::string* error) {
  s->resize(0);
  if (A.rows() == 0 || A.cols() == 0) return true;
  const SingleBlasThread single_thread(A.cols() < kThreads);
  MatrixXd R;
  if (!IsFinite(A, error) || !Triangle(A, &R, error) ||
      !Svd(false, &R, s, nullptr, error)) {
    return false;
  }
  s->conservativeResize(std::min(A.rows(), A.cols()));
  return true;
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

  // The decomposition rounds by a few 1e-16 s_max^2 a pivot; the shift keeps
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

  // More columns than wanted vectors, so that the wanted ones converge fast,
  // and so that one value above the limit shows that none is missing.
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
    RayleighRitz(A, &V, &s);
    if (!s.allFinite()) {
      *error = "subspace iteration is not finite";
      return false;
    }
    const Index num_small = (s.array() <= limit).count();
    // Values that are still falling towards the limit count, too.
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
