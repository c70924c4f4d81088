// Spectral steps of sparse Jacobians by Cholesky factors, against the SVD.
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "bin/support/spectral_reference.h"
#include "gtest/gtest.h"
#include "invgrad/spectral/routes/sparse_cholesky.h"
#include "invgrad/spectral/spectral_step.h"

namespace invgrad {
namespace cholesky_route_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// A path of n nodes with springs between neighbours, a few long ones, and a
// weak anchor: m = n + n / 10 rows, and a wide spectrum.
SparseJacobian Springs(int n, double anchor = 1e-3) {
  std::vector<Eigen::Triplet<double>> entries;
  int row = 0;
  const auto spring = [&](int a, int b, double stiffness) {
    entries.emplace_back(row, a, -stiffness);
    entries.emplace_back(row, b, stiffness);
    ++row;
  };
  for (int i = 0; i + 1 < n; ++i) spring(i, i + 1, 1.0 + 0.5 * std::sin(i));
  for (int i = 0; i + 7 < n; i += 10) spring(i, i + 7, 0.1);
  entries.emplace_back(row++, 0, anchor);
  SparseJacobian::Matrix J(row, n);
  J.setFromTriplets(entries.begin(), entries.end());
  return SparseJacobian(J);
}

VectorXd Covector(const JacobianOperator& J) {
  return RandomMatrices(5).Vector(J.rows());
}

SpectralFilter Damped(double kappa, double relative_damping) {
  SpectralFilter filter = SpectralFilter::Power(kappa, 0.0);
  filter.relative_damping = relative_damping;
  return filter;
}

SpectralStepSummary Step(const JacobianOperator& J,
                         const VectorXd& g,
                         const SpectralFilter& filter,
                         SpectralRoute route,
                         double tolerance,
                         VectorXd* d,
                         bool expected = true) {
  SpectralStepOptions options;
  options.route = route;
  options.tolerance = tolerance;
  SpectralStepSummary summary;
  EXPECT_EQ(SpectralStep(J, g, filter, options, d, &summary), expected)
      << summary.message;
  return summary;
}

TEST(CholeskyRoute, IsTheStepOfTheSvd) {
  const SparseJacobian J = Springs(120);
  const VectorXd g = Covector(J);
  for (const double kappa : {-0.5, 0.0, 0.5, 0.75, 1.0}) {
    for (const double damping : {1e-2, 1e-6, 1e-9}) {
      const SpectralFilter filter = Damped(kappa, damping);
      VectorXd exact;
      Step(J, g, filter, SpectralRoute::kSvd, 1e-6, &exact);
      for (const double tolerance : {1e-2, 1e-5}) {
        VectorXd d;
        const SpectralStepSummary summary =
            Step(J, g, filter, SpectralRoute::kCholesky, tolerance, &d);
        EXPECT_EQ(summary.route, SpectralRoute::kCholesky);
        EXPECT_LE(summary.estimated_error, tolerance);
        // s_max is known to 1e-3 from below, and lambda with it to 2e-3, of
        // which the step feels at most a share of (1 + kappa) / 2.
        EXPECT_LE((d - exact).norm(),
                  (tolerance + 2e-3 * filter.Exponent()) * exact.norm())
            << "kappa " << kappa << ", damping " << damping;
      }
    }
  }
}

// With damping in absolute units nothing depends on s_max but the nodes.
TEST(CholeskyRoute, AbsoluteDampingIsExact) {
  const SparseJacobian J = Springs(120);
  const VectorXd g = Covector(J);
  SpectralFilter filter = SpectralFilter::HalfInverse(0.0);
  filter.damping = 1e-5;
  VectorXd exact;
  VectorXd d;
  Step(J, g, filter, SpectralRoute::kSvd, 1e-6, &exact);
  Step(J, g, filter, SpectralRoute::kCholesky, 1e-7, &d);
  EXPECT_LE((d - exact).norm(), 1e-7 * exact.norm());
}

// Columns without entries: a gauge freedom, or an unused parameter.
TEST(CholeskyRoute, RankDeficient) {
  const SparseJacobian J = Springs(90, /*anchor=*/0.0);
  const VectorXd g = Covector(J);
  const SpectralFilter filter = Damped(0.5, 1e-8);
  VectorXd exact;
  VectorXd d;
  Step(J, g, filter, SpectralRoute::kSvd, 1e-6, &exact);
  Step(J, g, filter, SpectralRoute::kCholesky, 1e-4, &d);
  EXPECT_LE((d - exact).norm(), 2e-3 * exact.norm());
  // J d = 0 for a shift of all nodes, and the step has no part of it.
  EXPECT_LE(std::abs(d.sum()), 1e-6 * d.lpNorm<1>());
}

TEST(CholeskyRoute, AutoTakesItForLargeSparseProblems) {
  const SparseJacobian J = Springs(600);
  const VectorXd g = Covector(J);
  VectorXd d;
  EXPECT_EQ(Step(J, g, Damped(0.5, 1e-6), SpectralRoute::kAuto, 1e-2, &d).route,
            SpectralRoute::kCholesky);
  // Truncation is not for it, nor damping that J^T J cannot resolve.
  EXPECT_EQ(Step(J,
                 g,
                 SpectralFilter::HalfInverse(1e-3),
                 SpectralRoute::kAuto,
                 1e-2,
                 &d)
                .route,
            SpectralRoute::kParameterGram);
  const SpectralStepSummary summary =
      Step(J, g, Damped(0.5, 1e-14), SpectralRoute::kAuto, 1e-2, &d);
  EXPECT_NE(summary.route, SpectralRoute::kCholesky);
  EXPECT_NE(summary.message.find("too small"), std::string::npos)
      << summary.message;
}

TEST(CholeskyRoute, Refusals) {
  const SparseJacobian J = Springs(20);
  const VectorXd g = Covector(J);
  VectorXd d;
  const SpectralStepSummary truncated = Step(J,
                                             g,
                                             SpectralFilter::HalfInverse(1e-3),
                                             SpectralRoute::kCholesky,
                                             1e-2,
                                             &d,
                                             false);
  EXPECT_NE(truncated.message.find("without truncation"), std::string::npos);
  MatrixXd dense;
  J.ToDense(&dense);
  Step(DenseJacobian(dense),
       g,
       Damped(0.5, 1e-3),
       SpectralRoute::kCholesky,
       1e-2,
       &d,
       false);
}

TEST(CholeskyRoute, NotFiniteNamesTheRow) {
  SparseJacobian J = Springs(30);
  J.mutable_values()[J.matrix().outerIndexPtr()[4]] =
      std::numeric_limits<double>::quiet_NaN();
  VectorXd d;
  const SpectralStepSummary summary = Step(J,
                                           VectorXd::Ones(J.rows()),
                                           Damped(0.5, 1e-3),
                                           SpectralRoute::kCholesky,
                                           1e-2,
                                           &d,
                                           false);
  EXPECT_NE(summary.message.find("row 4"), std::string::npos)
      << summary.message;
}

TEST(SparseCholesky, SolvesForEveryShiftAndAnotherJ) {
  SparseCholesky cholesky;
  std::string error;
  for (const double anchor : {1.0, 0.5}) {
    const SparseJacobian J = Springs(50, anchor);
    MatrixXd A;
    J.ToDense(&A);
    ASSERT_TRUE(cholesky.Analyze(J, 0.0, &error)) << error;
    for (const double shift : {1e-3, 1.0, 1e3}) {
      ASSERT_TRUE(cholesky.Factorize(shift, &error)) << error;
      const VectorXd expected = VectorXd::LinSpaced(50, -1.0, 1.0);
      VectorXd x = A.transpose() * (A * expected) + shift * expected;
      cholesky.Solve(x);
      // A condition number of at most 1e4 times some roundings.
      EXPECT_LE((x - expected).norm(), 1e-11 * expected.norm());
    }
  }
  // A path is factorized without fill, but for the long springs.
  EXPECT_LE(cholesky.num_entries(), 6.0 * 50.0);
}

TEST(SparseCholesky, Failures) {
  SparseCholesky cholesky;
  std::string error;
  const SparseJacobian J = Springs(50, 0.0);
  EXPECT_FALSE(cholesky.Analyze(J, 100.0, &error));
  EXPECT_NE(error.find("the limit is"), std::string::npos) << error;
  ASSERT_TRUE(cholesky.Analyze(J, 0.0, &error)) << error;
  // J^T J is singular, and not by rounding alone: a column of zeros.
  SparseJacobian::Matrix zero(3, 2);
  zero.insert(0, 0) = 1.0;
  zero.makeCompressed();
  const SparseJacobian singular(zero);
  ASSERT_TRUE(cholesky.Analyze(singular, 0.0, &error)) << error;
  EXPECT_FALSE(cholesky.Factorize(0.0, &error));
  EXPECT_NE(error.find("not positive definite"), std::string::npos) << error;
  EXPECT_TRUE(cholesky.Factorize(1.0, &error)) << error;
}

}  // namespace cholesky_route_test
}  // namespace invgrad
