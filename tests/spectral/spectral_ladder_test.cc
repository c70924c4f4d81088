// Which route a spectral step takes and what it says about it, for sizes at
// which all routes are open.
#include <algorithm>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "bin/support/spectral_reference.h"
#include "gtest/gtest.h"
#include "invgrad/core/blas.h"
#include "invgrad/core/linearization.h"
#include "invgrad/rules/rules.h"
#include "invgrad/spectral/spectral_step.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kRows = 64;
constexpr int kCols = 90;

// One J for each route that auto takes for tau = 1e-10.
struct Jacobians {
  RandomMatrices random{3};
  MatrixXd for_gram;
  MatrixXd for_cascade;
  MatrixXd for_svd;
  VectorXd g;

  Jacobians() {
    for_gram = random.WithSpectrum(kRows, kCols, LogUniform(kRows, 1e-2));
    VectorXd s = LogUniform(kRows, 1e-2);
    s.tail(10) *= 1e-3;
    for_cascade = random.WithSpectrum(kRows, kCols, s);
    // Three quarters below 1e-3.
    for_svd = random.WithSpectrum(kRows, kCols, LogUniform(kRows, 1e-12));
    g = random.Vector(kRows);
  }
};

const SpectralFilter kFilter = SpectralFilter::HalfInverse(1e-10);

struct Answer {
  bool success = false;
  VectorXd d;
  SpectralStepSummary summary;
};

Answer Step(const MatrixXd& J,
            const VectorXd& g,
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

Answer Step(const MatrixXd& J,
            const VectorXd& g,
            SpectralRoute route,
            const SpectralFilter& filter = kFilter) {
  SpectralStepOptions options;
  options.route = route;
  SpectralWorkspace workspace;
  return Step(J, g, filter, options, &workspace);
}

TEST(SpectralLadder, AutoStopsAtTheFirstRouteThatIsAccurateEnough) {
  const Jacobians jacobians;
  Answer answer = Step(jacobians.for_gram, jacobians.g, SpectralRoute::kAuto);
  EXPECT_EQ(answer.summary.route, SpectralRoute::kGram);
  EXPECT_EQ(answer.summary.message, "");
  EXPECT_LE(answer.summary.estimated_error, 1e-6);

  answer = Step(jacobians.for_cascade, jacobians.g, SpectralRoute::kAuto);
  EXPECT_EQ(answer.summary.route, SpectralRoute::kCascade);
  EXPECT_EQ(answer.summary.message.rfind("gram: estimated error ", 0), 0u)
      << answer.summary.message;
  EXPECT_NE(answer.summary.message.find(" > 1e-06"), std::string::npos)
      << answer.summary.message;
  EXPECT_EQ(answer.summary.message.find("cascade"), std::string::npos);
  EXPECT_LE(answer.summary.estimated_error, 1e-6);

  answer = Step(jacobians.for_svd, jacobians.g, SpectralRoute::kAuto);
  EXPECT_EQ(answer.summary.route, SpectralRoute::kSvd);
  EXPECT_EQ(answer.summary.message.rfind("gram: ", 0), 0u);
  EXPECT_NE(answer.summary.message.find("; cascade: "), std::string::npos)
      << answer.summary.message;
  EXPECT_NE(answer.summary.message.find("too many for the cascade"),
            std::string::npos)
      << answer.summary.message;

  // The other side.
  answer = Step(jacobians.for_gram.transpose(),
                VectorXd::Ones(kCols),
                SpectralRoute::kAuto);
  EXPECT_EQ(answer.summary.route, SpectralRoute::kParameterGram);
  answer = Step(jacobians.for_cascade.transpose(),
                VectorXd::Ones(kCols),
                SpectralRoute::kAuto);
  EXPECT_EQ(answer.summary.route, SpectralRoute::kCascade);
  EXPECT_EQ(answer.summary.message.rfind("parameter_gram: ", 0), 0u);
}

// Whoever climbs there gets what whoever asks for it gets, bit for bit.
TEST(SpectralLadder, TheClimbLeavesNoTraceInTheNumbers) {
  const Jacobians jacobians;
  for (const auto& [J, route] :
       {std::pair(jacobians.for_gram, SpectralRoute::kGram),
        std::pair(jacobians.for_cascade, SpectralRoute::kCascade),
        std::pair(jacobians.for_svd, SpectralRoute::kSvd)}) {
    const Answer climbed = Step(J, jacobians.g, SpectralRoute::kAuto);
    const Answer forced = Step(J, jacobians.g, route);
    EXPECT_EQ(climbed.summary.route, route);
    EXPECT_EQ(climbed.d, forced.d) << SpectralRouteName(route);
    EXPECT_EQ(climbed.summary.estimated_error, forced.summary.estimated_error);
    EXPECT_EQ(forced.summary.message, "");
  }
}

TEST(SpectralLadder, TheToleranceDecides) {
  const Jacobians jacobians;
  SpectralStepOptions loose;
  loose.tolerance = 1e-1;
  SpectralWorkspace workspace;
  EXPECT_EQ(Step(jacobians.for_cascade,
                 jacobians.g,
                 SpectralFilter::HalfInverse(1e-4),
                 loose,
                 &workspace)
                .summary.route,
            SpectralRoute::kGram);
  SpectralStepOptions strict;
  strict.tolerance = 1e-13;
  SpectralWorkspace other;
  EXPECT_EQ(Step(jacobians.for_gram, jacobians.g, kFilter, strict, &other)
                .summary.route,
            SpectralRoute::kSvd);
}

TEST(SpectralLadder, TheCascadeIsRefusedWhereStated) {
  const Jacobians jacobians;
  Answer answer = Step(jacobians.for_svd, jacobians.g, SpectralRoute::kCascade);
  EXPECT_FALSE(answer.success);
  EXPECT_NE(
      answer.summary.message.find(
          "of 64 values below 0.000298023 s_max: too many for the cascade"),
      std::string::npos)
      << answer.summary.message;

  SpectralFilter clamped = kFilter;
  clamped.clamp = true;
  const std::string limits =
      "the cascade is for at least 64 rows and columns, and no clamping";
  answer =
      Step(jacobians.for_gram, jacobians.g, SpectralRoute::kCascade, clamped);
  EXPECT_FALSE(answer.success);
  EXPECT_EQ(answer.summary.message, limits);
  answer = Step(jacobians.for_gram.topRows(63),
                jacobians.g.head(63),
                SpectralRoute::kCascade);
  EXPECT_FALSE(answer.success);
  EXPECT_EQ(answer.summary.message, limits);
  // Auto goes past it, to the SVD.
  SpectralStepOptions strict;
  strict.tolerance = 1e-15;
  SpectralWorkspace workspace;
  answer = Step(jacobians.for_gram, jacobians.g, clamped, strict, &workspace);
  EXPECT_TRUE(answer.success);
  EXPECT_EQ(answer.summary.route, SpectralRoute::kSvd);
}

TEST(SpectralLadder, MemoryLimits) {
  const Jacobians jacobians;
  SpectralStepOptions options;
  options.memory_limit = 1000.0;  // bytes
  SpectralWorkspace workspace;
  for (const SpectralRoute route : {SpectralRoute::kGram,
                                    SpectralRoute::kParameterGram,
                                    SpectralRoute::kCascade,
                                    SpectralRoute::kSvd}) {
    options.route = route;
    const Answer answer =
        Step(jacobians.for_gram, jacobians.g, kFilter, options, &workspace);
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
  options.memory_limit =
      1.01 * SpectralStepBytes(SpectralRoute::kGram, kRows, kCols);
  ASSERT_LT(options.memory_limit,
            SpectralStepBytes(SpectralRoute::kSvd, kRows, kCols));
  EXPECT_TRUE(
      Step(jacobians.for_gram, jacobians.g, kFilter, options, &workspace)
          .success);
  const Answer answer =
      Step(jacobians.for_svd, jacobians.g, kFilter, options, &workspace);
  EXPECT_FALSE(answer.success);
  EXPECT_EQ(answer.summary.message.rfind("route svd with J 64 x 90", 0), 0u)
      << answer.summary.message;
}

// A workspace that has been used for other things gives the same bits.
TEST(SpectralLadder, NumbersDoNotDependOnTheWorkspace) {
  const Jacobians jacobians;
  RandomMatrices random(9);
  SpectralWorkspace used;
  SpectralStepOptions options;
  for (const auto& [m, n] :
       {std::pair(80, 100), std::pair(100, 70), std::pair(5, 9)}) {
    const MatrixXd other =
        random.WithSpectrum(m, n, LogUniform(std::min(m, n), 1e-3));
    for (const SpectralRoute route : {SpectralRoute::kSvd,
                                      SpectralRoute::kGram,
                                      SpectralRoute::kParameterGram,
                                      SpectralRoute::kCascade}) {
      options.route = route;
      Step(other, random.Vector(m), kFilter, options, &used);
    }
  }
  for (const SpectralRoute route : {SpectralRoute::kGram,
                                    SpectralRoute::kCascade,
                                    SpectralRoute::kSvd,
                                    SpectralRoute::kParameterGram}) {
    options.route = route;
    const Answer fresh = Step(jacobians.for_cascade, jacobians.g, route);
    for (int repeat = 0; repeat < 2; ++repeat) {
      const Answer again =
          Step(jacobians.for_cascade, jacobians.g, kFilter, options, &used);
      EXPECT_EQ(again.d, fresh.d) << SpectralRouteName(route);
      EXPECT_EQ(again.summary.estimated_error, fresh.summary.estimated_error);
      EXPECT_EQ(again.summary.rank, fresh.summary.rank);
    }
  }
}

// The last step's route is where the next one starts, for 20 steps. What that
// route then computes is what it always computes.
TEST(SpectralLadder, StartsWhereTheLastStepEndedForTwentySteps) {
  const Jacobians jacobians;
  for (const auto& [hard, route] :
       {std::pair(jacobians.for_cascade, SpectralRoute::kCascade),
        std::pair(jacobians.for_svd, SpectralRoute::kSvd)}) {
    SpectralWorkspace workspace;
    const SpectralStepOptions options;
    const auto step = [&](const MatrixXd& J) {
      return Step(J, jacobians.g, kFilter, options, &workspace);
    };
    EXPECT_EQ(step(hard).summary.route, route);
    const Answer expected = Step(jacobians.for_gram, jacobians.g, route);
    for (int k = 0; k < 20; ++k) {
      const Answer answer = step(jacobians.for_gram);
      EXPECT_EQ(answer.summary.route, route);
      EXPECT_EQ(answer.d, expected.d);
      EXPECT_EQ(answer.summary.message, "");
    }
    EXPECT_EQ(step(jacobians.for_gram).summary.route, SpectralRoute::kGram);
    EXPECT_EQ(step(jacobians.for_gram).summary.route, SpectralRoute::kGram);
    // Another shape is another problem.
    EXPECT_EQ(step(hard).summary.route, route);
    EXPECT_EQ(Step(jacobians.for_gram.leftCols(kCols - 1),
                   jacobians.g,
                   kFilter,
                   options,
                   &workspace)
                  .summary.route,
              SpectralRoute::kGram);
  }
}

// A rule that gets the arrays of another one's MutableState, copied at any
// time, continues bit for bit.
TEST(SpectralLadder, ARuleResumesFromItsStateBitForBit) {
  const Jacobians jacobians;
  const auto linearization = [&](int k) {
    Linearization at_x;
    at_x.jacobian = std::make_shared<DenseJacobian>(
        k % 7 == 0 ? jacobians.for_svd
                   : (k % 7 == 3 ? jacobians.for_cascade : jacobians.for_gram));
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

TEST(SpectralLadder, ZeroJacobianOrZeroDataGiveAZeroStep) {
  const Jacobians jacobians;
  for (const SpectralRoute route : {SpectralRoute::kAuto,
                                    SpectralRoute::kSvd,
                                    SpectralRoute::kGram,
                                    SpectralRoute::kParameterGram,
                                    SpectralRoute::kCascade}) {
    SCOPED_TRACE(SpectralRouteName(route));
    Answer answer = Step(MatrixXd::Zero(kRows, kCols), jacobians.g, route);
    EXPECT_TRUE(answer.success) << answer.summary.message;
    EXPECT_EQ(answer.d, VectorXd::Zero(kCols));
    EXPECT_EQ(answer.summary.rank, 0);
    // J^T J has kCols - kRows zeros, which tau = 1e-10 does not tell apart.
    const SpectralFilter filter = SpectralFilter::HalfInverse(1e-4);
    answer = Step(jacobians.for_gram, VectorXd::Zero(kRows), route, filter);
    EXPECT_TRUE(answer.success) << answer.summary.message;
    EXPECT_EQ(answer.d, VectorXd::Zero(kCols));
    EXPECT_EQ(answer.summary.rank, kRows);
    EXPECT_EQ(answer.summary.estimated_error, 0.0);
  }
}

TEST(SpectralLadder, RefusesWhatIsNotFinite) {
  const Jacobians jacobians;
  for (const SpectralRoute route : {SpectralRoute::kAuto,
                                    SpectralRoute::kSvd,
                                    SpectralRoute::kGram,
                                    SpectralRoute::kParameterGram,
                                    SpectralRoute::kCascade}) {
    for (const double bad : {std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity()}) {
      VectorXd g = jacobians.g;
      g[41] = bad;
      Answer answer = Step(jacobians.for_gram, g, route);
      EXPECT_FALSE(answer.success);
      EXPECT_EQ(answer.summary.message.rfind("g is not finite: row 41 ", 0),
                0u);
      MatrixXd J = jacobians.for_gram;
      J(37, 80) = bad;
      answer = Step(J, jacobians.g, route);
      EXPECT_FALSE(answer.success);
      EXPECT_EQ(answer.summary.message, "J is not finite: row 37");
    }
  }
}

TEST(SpectralLadder, RestoresTheNumberOfBlasThreads) {
  const Jacobians jacobians;
  const int before = BlasThreads();
  SetBlasThreads(2);
  const int wanted = BlasThreads();
  for (const SpectralRoute route : {SpectralRoute::kAuto,
                                    SpectralRoute::kSvd,
                                    SpectralRoute::kGram,
                                    SpectralRoute::kCascade}) {
    Step(jacobians.for_gram, jacobians.g, route);
    EXPECT_EQ(BlasThreads(), wanted);
    Step(jacobians.for_gram,
         VectorXd::Constant(kRows, std::numeric_limits<double>::infinity()),
         route);
    EXPECT_EQ(BlasThreads(), wanted);
  }
  SetBlasThreads(before);
}

}  // namespace
}  // namespace invgrad
