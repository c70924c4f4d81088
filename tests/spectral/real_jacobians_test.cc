// The contract of spectral.h on the Jacobians of the four learning
// problems, with batches so small that long double arithmetic can follow.
#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/spectral.h"
#include "problems/problems.h"
#include "tests/support/spectral_reference.h"
#include "tests/support/spectral_step_of.h"
#include "tests/support/trained_linearization.h"

namespace invgrad {
namespace real_jacobians_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Case {
  std::string problem;
  int batch_size;
  int train_steps;
};

class RealJacobians : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    PhysicsProblem problem;
    std::string error;
    ASSERT_TRUE(CreateProblem(GetParam().problem, nullptr, &problem, &error))
        << error;
    ASSERT_TRUE(LinearizeAfterTraining(*problem.learning,
                                       GetParam().batch_size,
                                       GetParam().train_steps,
                                       &at_weights_,
                                       &error))
        << error;
  }

  Linearization at_weights_;
};

TEST_P(RealJacobians, ErrorIsAtMostItsEstimate) {
  const JacobianOperator& J = *at_weights_.jacobian;
  const VectorXd& g = at_weights_.loss_gradient;
  ASSERT_GE(J.rows(), 64);
  ASSERT_LT(J.rows(), J.cols());
  MatrixXd dense;
  J.ToDense(&dense);
  const SpectralReference reference(dense);
  const bool is_dipole = GetParam().problem.rfind("quantum_dipole", 0) == 0;
  int num_tested = 0;
  for (const double tau : {1e-3, 1e-5, 1e-7, 1e-10}) {
    const SpectralFilter filter = SpectralFilter::HalfInverse(tau);
    const LongVector exact = reference.Step(filter, g);
    const auto rank = (reference.s().array() > tau * reference.s(0)).count();
    for (const SpectralRoute route :
         {SpectralRoute::kAuto, SpectralRoute::kGram, SpectralRoute::kSvd}) {
      SCOPED_TRACE(testing::Message()
                   << SpectralRouteName(route) << ", tau " << tau);
      SpectralStepSummary summary;
      VectorXd d;
      ASSERT_TRUE(SpectralStep(J, g, filter, Take(route), &d, &summary))
          << summary.message;
      if (route != SpectralRoute::kGram) {
        EXPECT_EQ(summary.num_undecided, 0);
      }
      if (summary.num_undecided > 0 || summary.estimated_error > 0.01) {
        continue;
      }
      EXPECT_EQ(summary.rank, rank);
      EXPECT_LE(static_cast<double>((d.cast<long double>() - exact).norm() /
                                    exact.norm()),
                summary.estimated_error);
      ++num_tested;
      // What training asks for, see SpectralStepOptions::ForTraining.
      if (route == SpectralRoute::kAuto) {
        EXPECT_LE(summary.estimated_error, 1e-3);
      }
    }
  }
  EXPECT_GE(num_tested, 8);

  // The norm of the dipole's wave function is conserved: one value a sample is
  // zero, and rounding must not bring it back.
  if (is_dipole) {
    const int zeros = GetParam().batch_size;
    EXPECT_LT(reference.s(J.rows() - zeros), 1e-14 * reference.s(0));
    EXPECT_GT(reference.s(J.rows() - zeros - 1), 1e-10 * reference.s(0));
    SpectralStepSummary summary;
    VectorXd d;
    ASSERT_TRUE(SpectralStep(J,
                             g,
                             SpectralFilter::HalfInverse(1e-10),
                             SpectralStepOptions(),
                             &d,
                             &summary));
    EXPECT_NE(summary.route, SpectralRoute::kGram);
    EXPECT_EQ(summary.rank, J.rows() - zeros);
    EXPECT_EQ(summary.num_undecided, 0);
  }
}

constexpr int kTrained = 200;

INSTANTIATE_TEST_SUITE_P(
    Problems,
    RealJacobians,
    testing::Values(
        Case{"oscillator_chain:num_samples=256", 20, 0},
        Case{"oscillator_chain:num_samples=256", 20, kTrained},
        Case{"oscillator_chain:coupling=cubic:num_samples=256", 20, 0},
        Case{"oscillator_chain:coupling=cubic:num_samples=256", 20, kTrained},
        Case{"quantum_dipole:num_samples=64", 4, 0},
        Case{"quantum_dipole:num_samples=64", 4, kTrained},
        Case{"poisson:num_samples=64", 2, 0},
        Case{"poisson:num_samples=64", 2, kTrained}));

}  // namespace real_jacobians_test
}  // namespace invgrad
