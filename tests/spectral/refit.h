// Batches of samples, and steps from all samples but one, for tests.
#ifndef INVGRAD_TESTS_SPECTRAL_REFIT_H_
#define INVGRAD_TESTS_SPECTRAL_REFIT_H_

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/spectral/leave_one_out.h"
#include "tests/support/spectral_reference.h"

namespace invgrad {

inline double LambdaMax(const Eigen::MatrixXd& J) {
  return SymmetricEigen(J.transpose() * J).values.tail<1>()[0];
}

inline SpectralFilter Damped(double kappa, double relative_damping) {
  SpectralFilter filter = SpectralFilter::Power(kappa, 0.0);
  filter.relative_damping = relative_damping;
  return filter;
}

// One of the samples of a batch with these numbers of rows is left out, and the
// others make a step.
struct Refit {
  Eigen::MatrixXd J;
  Eigen::VectorXd g;
  std::vector<int> rows;
  double exponent;
  double damping;  // lambda

  // J_i J_-i^T psi(G_-i,-i) g_-i for all samples i. Values of G_-i,-i below
  // 1e-12 of the largest count as zero, which psi(G) never meets.
  Eigen::VectorXd Changes() const {
    const double resolved = 1e-12 * LambdaMax(J);
    Eigen::VectorXd changes = Eigen::VectorXd::Zero(J.rows());
    for (int i = 0, first = 0; i < static_cast<int>(rows.size());
         first += rows[i++]) {
      const int rest = static_cast<int>(J.rows()) - rows[i];
      Eigen::MatrixXd others(rest, J.cols());
      others << J.topRows(first), J.bottomRows(rest - first);
      Eigen::VectorXd g_others(rest);
      g_others << g.head(first), g.tail(rest - first);
      const SymmetricEigen eigen(others * others.transpose());
      Eigen::VectorXd b = eigen.U.transpose() * g_others;
      for (int k = 0; k < rest; ++k) {
        const double l = eigen.values[k];
        b[k] *= l > resolved ? std::pow(l + damping, -exponent) : 0.0;
      }
      changes.segment(first, rows[i]) =
          J.middleRows(first, rows[i]) * (others.transpose() * (eigen.U * b));
    }
    return changes;
  }
};

inline Refit RefitOf(const Eigen::MatrixXd& J,
                     const Eigen::VectorXd& g,
                     const std::vector<int>& rows,
                     const SpectralFilter& filter) {
  return {J,
          g,
          rows,
          filter.Exponent(),
          filter.damping + (filter.relative_damping + filter.tau * filter.tau) *
                               LambdaMax(J)};
}

inline Eigen::VectorXd ChangeOf(const Eigen::MatrixXd& J,
                                const Eigen::VectorXd& g,
                                const std::vector<int>& rows,
                                const SpectralFilter& filter,
                                LeaveOneOutSummary* summary,
                                const LeaveOneOutOptions& options = {}) {
  Eigen::VectorXd change;
  EXPECT_TRUE(LeaveOneOutChange(
      DenseJacobian(J), g, rows, filter, options, &change, summary))
      << summary->message;
  EXPECT_EQ(change.size(), g.size());
  return change;
}

inline double RelativeDistance(const Eigen::VectorXd& a,
                               const Eigen::VectorXd& b) {
  return (a - b).norm() / b.norm();
}

struct SampleBatch {
  const char* name;
  std::vector<int> rows;
  int n;
};

// |y| = 1 and 4, and blocks of different sizes; m < n, m = n, m > n; a single
// tridiagonal chunk and several.
inline const SampleBatch kSampleBatches[] = {
    {"scalars", std::vector<int>(12, 1), 40},
    {"scalars, square", std::vector<int>(12, 1), 12},
    {"scalars, tall", std::vector<int>(40, 1), 9},
    {"four rows", std::vector<int>(9, 4), 50},
    {"four rows, tall", std::vector<int>(12, 4), 21},
    {"blocks", {3, 1, 2, 5, 1, 4, 2}, 30},
    {"blocks, tall", {3, 1, 2, 5, 1, 4, 2}, 7},
};

// m x n with singular values from 1 to 0.1: G's rounding is 1e-14.
inline Eigen::MatrixXd JacobianOf(const SampleBatch& batch, int seed) {
  const int m = std::accumulate(batch.rows.begin(), batch.rows.end(), 0);
  return RandomMatrices(seed).WithSpectrum(
      m, batch.n, LogUniform(std::min(m, batch.n), 0.1));
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SPECTRAL_REFIT_H_
