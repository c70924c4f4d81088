// Golub-Kahan steps of matrices whose exact steps are known, for tests.
#ifndef INVGRAD_TESTS_SPECTRAL_GOLUB_KAHAN_STEP_OF_H_
#define INVGRAD_TESTS_SPECTRAL_GOLUB_KAHAN_STEP_OF_H_

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/spectral.h"
#include "invgrad/spectral/golub_kahan.h"
#include "tests/support/spectral_reference.h"

namespace invgrad {

// J = U diag(s) V^T, whose exact steps are known by construction.
struct Factored {
  Eigen::MatrixXd U;
  Eigen::VectorXd s;  // largest first
  Eigen::MatrixXd V;

  Factored(int m, int n, const Eigen::VectorXd& values, RandomMatrices* random)
      : U(random->Orthonormal(m, values.size()).cast<double>()),
        s(values),
        V(random->Orthonormal(n, values.size()).cast<double>()) {}

  Eigen::MatrixXd J() const { return U * s.asDiagonal() * V.transpose(); }

  // The step's components along the columns of V.
  Eigen::VectorXd Components(const SpectralFilter& filter,
                             const Eigen::VectorXd& g) const {
    Eigen::VectorXd c = U.transpose() * g;
    for (Eigen::Index i = 0; i < s.size(); ++i) c[i] *= filter(s[i], s[0]);
    return c;
  }
  double RelativeError(const SpectralFilter& filter,
                       const Eigen::VectorXd& g,
                       const Eigen::VectorXd& d) const {
    const Eigen::VectorXd exact = V * Components(filter, g);
    return (d - exact).norm() / exact.norm();
  }
};

inline GolubKahanOptions WithTolerance(double tolerance) {
  GolubKahanOptions options;
  options.tolerance = tolerance;
  return options;
}

inline GolubKahanSummary StepOf(const JacobianOperator& J,
                                const Eigen::VectorXd& g,
                                const SpectralFilter& filter,
                                const GolubKahanOptions& options,
                                Eigen::VectorXd* d) {
  Eigen::MatrixXd basis;
  GolubKahanSummary summary;
  EXPECT_TRUE(GolubKahanStep(J, g, filter, options, &basis, d, &summary))
      << summary.message;
  EXPECT_EQ(d->size(), J.cols());
  EXPECT_EQ(summary.converged, summary.message.empty());
  return summary;
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SPECTRAL_GOLUB_KAHAN_STEP_OF_H_
