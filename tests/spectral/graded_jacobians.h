// Jacobians that the Gram matrix is accurate for and others, and their steps, for
// tests.
#ifndef INVGRAD_TESTS_SPECTRAL_GRADED_JACOBIANS_H_
#define INVGRAD_TESTS_SPECTRAL_GRADED_JACOBIANS_H_

#include <algorithm>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "invgrad/jacobian_operator.h"
#include "invgrad/spectral.h"
#include "invgrad/stored_jacobian.h"
#include "tests/support/spectral_reference.h"
#include "tests/support/spectral_step_of.h"

namespace invgrad {

// All eigenvectors below 64, the tridiagonal form from there on; both sides.
inline const std::vector<std::pair<int, int>> kShapes = {
    {5, 9}, {9, 5}, {64, 90}, {90, 64}};

// For tau = 1e-10 and a tolerance of 1e-6: one J that the Gram matrix is
// accurate for, one for which its estimated error is too large, and one whose
// small values it cannot place.
struct GradedJacobians {
  RandomMatrices random{3};
  Eigen::MatrixXd accurate;
  Eigen::MatrixXd inaccurate;
  Eigen::MatrixXd undecided;
  Eigen::VectorXd g;

  explicit GradedJacobians(int m = 64, int n = 90) {
    const int k = std::min(m, n);
    accurate = random.WithSpectrum(m, n, LogUniform(k, 1e-2));
    inaccurate = random.WithSpectrum(m, n, LogUniform(k, 1e-6));
    undecided = random.WithSpectrum(m, n, LogUniform(k, 1e-12));
    g = random.Vector(m);
  }
};

inline const SpectralFilter kFilter = SpectralFilter::HalfInverse(1e-10);

struct Answer {
  bool success = false;
  Eigen::VectorXd d;
  SpectralStepSummary summary;
};

inline Answer AnswerOf(const Eigen::MatrixXd& J,
                       const Eigen::VectorXd& g,
                       const SpectralFilter& filter,
                       const SpectralStepOptions& options,
                       SpectralWorkspace* workspace) {
  Answer answer;
  answer.success = SpectralStep(DenseJacobian(J),
                                g,
                                filter,
                                options,
                                workspace,
                                &answer.d,
                                &answer.summary);
  return answer;
}

inline Answer AnswerOf(const Eigen::MatrixXd& J,
                       const Eigen::VectorXd& g,
                       SpectralRoute route,
                       const SpectralFilter& filter = kFilter) {
  SpectralWorkspace workspace;
  return AnswerOf(J, g, filter, Take(route), &workspace);
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SPECTRAL_GRADED_JACOBIANS_H_
