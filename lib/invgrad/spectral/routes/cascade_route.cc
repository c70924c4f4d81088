#include <lapacke.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "invgrad/core/blas.h"
#include "invgrad/core/finite.h"
#include "invgrad/spectral/routes/gram_route.h"
#include "invgrad/spectral/routes/tall_svd.h"
#include "invgrad/spectral/step_error.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Singular values above the split, relative to s_max, are left to the Gram
// matrix, whose error there is kGramError / split^2.
constexpr double kGramError = 100.0 * std::numeric_limits<double>::epsilon();
constexpr double kLargestSplit = 1e-3;

// Of the tolerance, for that error.
constexpr double kGramShare = 0.25;

// With a larger share of all values below it, the SVD of the whole J is as
// cheap.
constexpr double kLargestShare = 0.7;

// *X (min(m, n) x count) = the eigenvectors of T of its `count` smallest
// eigenvalues.
bool SmallestEigenvectors(const Tridiagonalization& reduction,
                          int count,
                          SpectralWorkspace* workspace,
                          MatrixXd* X) {
  const int size = static_cast<int>(reduction.diagonal().size());
  // dstemr destroys T, and wants one entry more of its off-diagonal.
  VectorXd& diagonal = workspace->y;
  VectorXd& off_diagonal = workspace->change;
  diagonal = reduction.diagonal();
  off_diagonal.setZero(size);
  off_diagonal.head(size - 1) = reduction.off_diagonal();
  workspace->values.resize(size);
  X->resize(size, count);
  workspace->lapack_numbers.resize(
      std::max<size_t>(workspace->lapack_numbers.size(), 18 * size));
  workspace->lapack_integers.resize(
      std::max<size_t>(workspace->lapack_integers.size(), 12 * size));
  int* support = workspace->lapack_integers.data() + 10 * size;
  int found = 0;
  lapack_logical high_accuracy = 1;
  const int info =
      LAPACKE_dstemr_work(LAPACK_COL_MAJOR,
                          'V',
                          'I',
                          size,
                          diagonal.data(),
                          off_diagonal.data(),
                          0.0,
                          0.0,
                          1,
                          count,
                          &found,
                          workspace->values.data(),
                          X->data(),
                          size,
                          count,
                          support,
                          &high_accuracy,
                          workspace->lapack_numbers.data(),
                          static_cast<int>(workspace->lapack_numbers.size()),
                          workspace->lapack_integers.data(),
                          10 * size);
  return info == 0 && found == count;
}

// *step = V phi(S) U^T g of the values that `cut` keeps, by the Gram matrix;
// Q^T g, or Q^T J^T g on the parameter side, is in workspace->b.
void LargeStep(const SpectralProblem& problem,
               const SpectralFilter& filter,
               double lambda_max,
               const Cut& cut,
               bool parameter_side,
               SpectralWorkspace* workspace,
               VectorXd* step) {
  ApplyCutFunction(filter, lambda_max, cut, parameter_side, workspace);
  VectorXd& y = workspace->y;
  workspace->reduction.ApplyQ(&y);
  y *= GramStepScale(filter, workspace->unit);
  if (parameter_side) {
    *step = y;
  } else {
    problem.J.TransposeTimes(y, step);
  }
}

}  // namespace

// With X the eigenvectors of the Gram matrix (of J J^T, say) below the split
// and P the projector on the others:
//
//   d = J^T f(P J J^T P) g + V_W phi(S_W) U_W^T g,
//   J^T X = V_W S_W (X^T U_W)^T
//
// J^T X is computed from J itself: its singular values have lost nothing to
// squaring. But X is rotated towards the large values' vectors by epsilon
// s_max^2 / s^2, and their share of g would leak into the small ones', which
// phi may raise. So it is taken off first: U_W^T is applied to g - J w, w =
// J^T (P J J^T P)^-1 g.
bool CascadeRoute(const SpectralProblem& problem,
                  double tolerance,
                  bool reduced,
                  SpectralWorkspace* workspace,
                  VectorXd* d,
                  SpectralStepSummary* summary) {
  *summary = SpectralStepSummary();
  summary->route = SpectralRoute::kCascade;
  const Index m = problem.m();
  const Index n = problem.n();
  const bool parameter_side = n < m;
  const SpectralFilter& filter = problem.filter;
  if (!GramIsReduced(problem)) {
    summary->message =
        "the cascade is for at least 64 rows and columns, and no clamping";
    return false;
  }

  if (!reduced) {
    const SpectralRoute side =
        parameter_side ? SpectralRoute::kParameterGram : SpectralRoute::kGram;
    switch (FormGram(problem, side, workspace, summary)) {
      case GramResult::kFailed:
        return false;
      case GramResult::kZero:
        d->setZero(n);
        return true;
      case GramResult::kDone:
        break;
    }
    workspace->reduction.Compute(&workspace->gram,
                                 Tridiagonalization::Method::kOneStage);
    workspace->tridiagonal.Set(workspace->reduction.diagonal(),
                               workspace->reduction.off_diagonal());
  }
  const double unit = workspace->unit;
  const Tridiagonal& T = workspace->tridiagonal;
  const double lambda_max = T.Eigenvalue(T.size() - 1);
  const double s_max = std::sqrt(lambda_max) * std::sqrt(unit);
  // The threshold is left to the SVD, which resolves it better.
  const double split = std::max(
      std::min(kLargestSplit, std::sqrt(kGramError / (kGramShare * tolerance))),
      4.0 * filter.tau);
  // A value at the split may be on either side of it.
  const Cut cut = FindCut(
      T, split * split * lambda_max, 0.1 * split * split * lambda_max, 0.0);
  const int count = cut.num_below;
  if (count > kLargestShare * T.size()) {
    std::ostringstream message;
    message << count << " of " << T.size() << " values below " << split
            << " s_max: too many for the cascade";
    summary->message = message.str();
    return false;
  }

  if (parameter_side) {
    problem.J.TransposeTimes(problem.g, &workspace->b);
  } else {
    workspace->b = problem.g;
  }
  workspace->reduction.ApplyQTranspose(&workspace->b);
  LargeStep(problem, filter, lambda_max, cut, parameter_side, workspace, d);
  // Nothing is lost across the split, where one part takes over from the
  // other: what counts is the slope of f there.
  const double large_error = kGramError / (split * split) * d->norm();
  summary->s_max = s_max;
  summary->s_min_kept = std::sqrt(cut.above) * std::sqrt(unit);

  double small_error = 0.0;
  int num_kept = 0;
  if (count > 0) {
    VectorXd w;
    LargeStep(problem,
              SpectralFilter::GaussNewton(0.0),
              lambda_max,
              cut,
              parameter_side,
              workspace,
              &w);
    VectorXd image;
    problem.J.Times(w, &image);
    const VectorXd g_small = problem.g - image;

    MatrixXd& X = workspace->basis;
    if (!SmallestEigenvectors(workspace->reduction, count, workspace, &X)) {
      summary->message =
          "the eigenvectors of J's Gram matrix (dstemr) did not converge";
      return false;
    }
    workspace->reduction.ApplyQ(&X);
    MatrixXd& W = workspace->dense;
    W.resize(parameter_side ? m : n, count);
    VectorXd column;
    for (int k = 0; k < count; ++k) {
      column = X.col(k);
      if (parameter_side) {
        problem.J.Times(column, &image);
      } else {
        problem.J.TransposeTimes(column, &image);
      }
      W.col(k) = image;
    }
    TallSvd svd(workspace);
    if (!svd.Compute(&summary->message)) return false;
    // W = L S R^T with (L, X R) = (V, U) of J, or (U, V) on the parameter side.
    VectorXd c;
    VectorXd x(count);
    double outside = 0.0;
    if (parameter_side) {
      svd.LeftTransposeTimes(g_small, &c);
      outside =
          std::sqrt(std::max(0.0, g_small.squaredNorm() - c.squaredNorm()));
    } else {
      Gemv(Op::kTranspose, 1.0, X, g_small, 0.0, x);
      svd.RightTransposeTimes(x, &c);
    }
    const VectorXd s = svd.s();
    VectorXd phi(count);
    for (int i = 0; i < count; ++i) phi[i] = filter(s[i], s_max);
    const VectorXd filtered = phi.cwiseProduct(c);
    VectorXd small(n);
    if (parameter_side) {
      svd.RightTimes(filtered, &x);
      Gemv(Op::kNone, 1.0, X, x, 0.0, small);
    } else {
      svd.LeftTimes(filtered, &small);
    }
    const double norm_small = small.norm();
    *d += small;
    SummarizeSpectrum(filter, s, s_max, 1, SvdResolution(m, n), summary);
    num_kept = summary->rank;
    if (num_kept == 0) {
      summary->s_min_kept = std::sqrt(cut.above) * std::sqrt(unit);
    }
    if (norm_small > 0.0 && s[0] > 0.0) {
      const double entry = BackwardError(T.size());
      small_error =
          norm_small * SvdStepError(filter, s, s_max, c, outside, n > m);
      // X is rotated towards a large value's vector by epsilon s_max^2 /
      // s_i^2, which is how much of the others' steps is missing there.
      double squared = 0.0;
      for (int j = 0; j < count; ++j) {
        if (filtered[j] == 0.0) continue;
        squared += std::pow(filtered[j] * s_max / s[j], 2);
      }
      small_error +=
          entry / split * std::sqrt(0.3 * (T.size() - count) * squared);
      // And the roundings of J w.
      small_error += entry * s_max * w.norm() * phi.norm();
    }
  }
  summary->rank = num_kept + T.size() - count;

  const double norm = d->norm();
  summary->estimated_error =
      norm == 0.0
          ? 0.0
          : RoundingError() + std::hypot(small_error, large_error) / norm;
  return CheckFinite("the step", *d, &summary->message);
}

}  // namespace invgrad
