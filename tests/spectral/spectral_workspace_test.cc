// What a spectral step needs and leaves behind: memory, its workspace, the number
// of BLAS threads.

#include <algorithm>
#include <atomic>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "gtest/gtest.h"
#include "invgrad/blas_threads.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/linearization.h"
#include "invgrad/rules.h"
#include "invgrad/spectral.h"
#include "invgrad/stored_jacobian.h"
#include "tests/spectral/graded_jacobians.h"
#include "tests/support/spectral_reference.h"
#include "tests/support/spectral_step_of.h"

namespace invgrad {
namespace spectral_workspace_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(SpectralStep, MemoryLimits) {
  const GradedJacobians jacobians;
  SpectralStepOptions options;
  options.memory_limit = 1000.0;  // bytes
  SpectralWorkspace workspace;
  for (const SpectralRoute route :
       {SpectralRoute::kGram, SpectralRoute::kSvd}) {
    options.route = route;
    const Answer answer =
        AnswerOf(jacobians.accurate, jacobians.g, kFilter, options, &workspace);
    EXPECT_FALSE(answer.success);
    EXPECT_EQ(answer.summary.message.rfind(std::string("route ") +
                                               SpectralRouteName(route) +
                                               " with J 64 x 90 needs ",
                                           0),
              0u)
        << answer.summary.message;
    EXPECT_NE(
        answer.summary.message.find("for its matrices; the limit is 1 kB"),
        std::string::npos)
        << answer.summary.message;
  }
  // Auto takes what fits; an SVD does not.
  options.route = SpectralRoute::kAuto;
  options.memory_limit = 1.01 * SpectralStepBytes(SpectralRoute::kGram, 64, 90);
  ASSERT_LT(options.memory_limit,
            SpectralStepBytes(SpectralRoute::kSvd, 64, 90));
  EXPECT_TRUE(
      AnswerOf(jacobians.accurate, jacobians.g, kFilter, options, &workspace)
          .success);
  const Answer answer =
      AnswerOf(jacobians.undecided, jacobians.g, kFilter, options, &workspace);
  EXPECT_FALSE(answer.success);
  EXPECT_EQ(answer.summary.message.rfind("route svd with J 64 x 90", 0), 0u)
      << answer.summary.message;
}

// A workspace that has been used for other things gives the same bits.
TEST(SpectralStep, NumbersDoNotDependOnTheWorkspace) {
  const GradedJacobians jacobians;
  RandomMatrices random(9);
  SpectralWorkspace used;
  for (const auto& [m, n] :
       {std::pair(80, 100), std::pair(100, 70), std::pair(5, 9)}) {
    const MatrixXd other =
        random.WithSpectrum(m, n, LogUniform(std::min(m, n), 1e-3));
    for (const SpectralRoute route :
         {SpectralRoute::kSvd, SpectralRoute::kGram}) {
      AnswerOf(other, random.Vector(m), kFilter, Take(route), &used);
    }
  }
  for (const SpectralRoute route :
       {SpectralRoute::kGram, SpectralRoute::kSvd}) {
    const Answer fresh = AnswerOf(jacobians.undecided, jacobians.g, route);
    for (int repeat = 0; repeat < 2; ++repeat) {
      const Answer again = AnswerOf(
          jacobians.undecided, jacobians.g, kFilter, Take(route), &used);
      EXPECT_EQ(again.d, fresh.d) << SpectralRouteName(route);
      EXPECT_EQ(again.summary.estimated_error, fresh.summary.estimated_error);
      EXPECT_EQ(again.summary.rank, fresh.summary.rank);
    }
  }
}

TEST(SpectralStep, AutoStaysWithTheSvdForTwentySteps) {
  const GradedJacobians jacobians;
  SpectralWorkspace workspace;
  const auto step = [&](const MatrixXd& J) {
    return AnswerOf(J, jacobians.g, kFilter, SpectralStepOptions(), &workspace);
  };
  EXPECT_EQ(step(jacobians.undecided).summary.route, SpectralRoute::kSvd);
  const Answer expected =
      AnswerOf(jacobians.accurate, jacobians.g, SpectralRoute::kSvd);
  for (int k = 0; k < 20; ++k) {
    const Answer answer = step(jacobians.accurate);
    EXPECT_EQ(answer.summary.route, SpectralRoute::kSvd);
    EXPECT_EQ(answer.d, expected.d);
    EXPECT_EQ(answer.summary.message, "");
  }
  EXPECT_EQ(step(jacobians.accurate).summary.route, SpectralRoute::kGram);
  EXPECT_EQ(step(jacobians.accurate).summary.route, SpectralRoute::kGram);
  // Another shape is another problem.
  EXPECT_EQ(step(jacobians.undecided).summary.route, SpectralRoute::kSvd);
  EXPECT_EQ(step(jacobians.accurate.leftCols(89)).summary.route,
            SpectralRoute::kGram);
}

// A rule that gets the arrays of another one's MutableState, copied at any
// time, continues bit for bit.
TEST(SpectralStep, ARuleResumesFromItsStateBitForBit) {
  const GradedJacobians jacobians;
  const auto linearization = [&](int k) {
    Linearization at_x;
    at_x.jacobian = std::make_shared<DenseJacobian>(
        k % 7 == 0 ? jacobians.undecided : jacobians.accurate);
    at_x.loss_gradient = (1.0 + 0.1 * k) * jacobians.g;
    return at_x;
  };
  const auto create = [] {
    return MakeRule("half_inverse:truncation=1e-10:tolerance=1e-6");
  };
  constexpr int kSteps = 30;
  for (const int stop : {0, 1, 4, 11, 22}) {
    const auto straight = create();
    auto resumed = create();
    std::string error;
    VectorXd step;
    VectorXd resumed_step;
    for (int k = 0; k < kSteps; ++k) {
      if (k == stop) {
        auto restored = create();
        const auto from = resumed->MutableState();
        const auto to = restored->MutableState();
        ASSERT_EQ(from.size(), to.size());
        for (size_t i = 0; i < from.size(); ++i) *to[i] = *from[i];
        resumed = std::move(restored);
      }
      ASSERT_TRUE(straight->ComputeStep(linearization(k), &step, &error));
      ASSERT_TRUE(
          resumed->ComputeStep(linearization(k), &resumed_step, &error));
      EXPECT_EQ(resumed_step, step) << "step " << k;
      EXPECT_EQ(resumed->LastStepReport(), straight->LastStepReport());
    }
  }
}

// Another thread of the program, which uses BLAS too, must not see a change.
TEST(SpectralStep, NeverChangesTheNumberOfBlasThreads) {
  const GradedJacobians jacobians;
  SetBlasThreads(2);
  const int wanted = BlasThreads();  // 1 if BLAS is not OpenBLAS
  std::atomic<bool> is_done{false};
  std::atomic<bool> has_changed{false};
  std::thread watch([&] {
    while (!is_done) {
      if (BlasThreads() != wanted) has_changed = true;
    }
  });
  for (const SpectralRoute route :
       {SpectralRoute::kAuto, SpectralRoute::kSvd, SpectralRoute::kGram}) {
    AnswerOf(jacobians.accurate, jacobians.g, route);
    AnswerOf(jacobians.accurate, VectorXd::Constant(64, kInfinity), route);
  }
  is_done = true;
  watch.join();
  EXPECT_FALSE(has_changed);
  SetBlasThreads(1);
}

}  // namespace spectral_workspace_test
}  // namespace invgrad
