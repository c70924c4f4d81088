// What a spectral step does and says: routes, failures, memory. Its accuracy:
// spectral_accuracy_test.cc.
#include "invgrad/spectral/spectral_step.h"

#include <algorithm>
#include <cmath>
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
#include "tests/support/spectral_step_of.h"

namespace invgrad {
namespace spectral_step_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// All eigenvectors below 64, the tridiagonal form from there on; both sides.
const std::vector<std::pair<int, int>> kShapes = {
    {5, 9}, {9, 5}, {64, 90}, {90, 64}};

// For tau = 1e-10 and a tolerance of 1e-6: one J that the Gram matrix is
// accurate for, one for which its estimated error is too large, and one whose
// small values it cannot place.
struct Jacobians {
  RandomMatrices random{3};
  MatrixXd accurate;
  MatrixXd inaccurate;
  MatrixXd undecided;
  VectorXd g;

  explicit Jacobians(int m = 64, int n = 90) {
    const int k = std::min(m, n);
    accurate = random.WithSpectrum(m, n, LogUniform(k, 1e-2));
    inaccurate = random.WithSpectrum(m, n, LogUniform(k, 1e-6));
    undecided = random.WithSpectrum(m, n, LogUniform(k, 1e-12));
    g = random.Vector(m);
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
  SpectralWorkspace workspace;
  return Step(J, g, filter, Take(route), &workspace);
}

TEST(SpectralStep, AutoTakesTheSvdWhereTheGramMatrixIsNotAccurate) {
  for (const auto& [m, n] : kShapes) {
    SCOPED_TRACE(m);
    const Jacobians jacobians(m, n);
    Answer answer = Step(jacobians.accurate, jacobians.g, SpectralRoute::kAuto);
    EXPECT_EQ(answer.summary.route, SpectralRoute::kGram);
    EXPECT_EQ(answer.summary.message, "");
    EXPECT_LE(answer.summary.estimated_error, 1e-6);
    answer = Step(jacobians.inaccurate, jacobians.g, SpectralRoute::kAuto);
    EXPECT_EQ(answer.summary.route, SpectralRoute::kSvd);
    EXPECT_EQ(answer.summary.message.rfind("gram: estimated error ", 0), 0u)
        << answer.summary.message;
    EXPECT_NE(answer.summary.message.find(" > 1e-06"), std::string::npos)
        << answer.summary.message;
  }
}

// What auto returns is what its last route alone returns, bit for bit.
TEST(SpectralStep, AutoLeavesNoTraceInTheNumbers) {
  const Jacobians jacobians;
  for (const auto& [J, route] :
       {std::pair(jacobians.accurate, SpectralRoute::kGram),
        std::pair(jacobians.undecided, SpectralRoute::kSvd)}) {
    const Answer by_auto = Step(J, jacobians.g, SpectralRoute::kAuto);
    const Answer alone = Step(J, jacobians.g, route);
    EXPECT_EQ(by_auto.summary.route, route);
    EXPECT_EQ(by_auto.d, alone.d) << SpectralRouteName(route);
    EXPECT_EQ(by_auto.summary.estimated_error, alone.summary.estimated_error);
    EXPECT_EQ(alone.summary.message, "");
  }
}

TEST(SpectralStep, TheToleranceDecides) {
  const Jacobians jacobians;
  SpectralStepOptions options;
  const auto route_for = [&](const MatrixXd& J, double tolerance) {
    options.tolerance = tolerance;
    SpectralWorkspace workspace;
    return Step(J, jacobians.g, kFilter, options, &workspace).summary.route;
  };
  EXPECT_EQ(route_for(jacobians.inaccurate, 1e-1), SpectralRoute::kGram);
  EXPECT_EQ(route_for(jacobians.inaccurate, 1e-6), SpectralRoute::kSvd);
  EXPECT_EQ(route_for(jacobians.accurate, 1e-6), SpectralRoute::kGram);
  EXPECT_EQ(route_for(jacobians.accurate, 1e-13), SpectralRoute::kSvd);
}

// s = 1, 1e-6 (1 + 1e-3), 0.5e-6: the Gram matrix resolves a threshold of 1e-6
// to some 2e-3, the SVD much better.
TEST(SpectralStep, TheThresholdToleranceDecides) {
  const MatrixXd J = Eigen::Vector3d(1.0, 1.001e-6, 0.5e-6).asDiagonal();
  const VectorXd g = Eigen::Vector3d(1.0, 1e-9, 1e-9);
  const SpectralFilter filter = SpectralFilter::HalfInverse(1e-6);
  SpectralStepOptions options;
  options.tolerance = 1.0;
  SpectralWorkspace workspace;
  Answer answer = Step(J, g, filter, options, &workspace);
  EXPECT_EQ(answer.summary.route, SpectralRoute::kSvd);
  EXPECT_EQ(answer.summary.rank, 2);
  EXPECT_EQ(answer.summary.num_undecided, 0);
  EXPECT_LT(answer.summary.threshold_resolution, 1e-8);
  EXPECT_EQ(answer.summary.message.rfind(
                "gram: 1 singular values undecided, threshold resolved to ", 0),
            0u)
      << answer.summary.message;

  options.threshold_tolerance = 0.01;
  SpectralWorkspace other;
  answer = Step(J, g, filter, options, &other);
  EXPECT_EQ(answer.summary.route, SpectralRoute::kGram);
  EXPECT_EQ(answer.summary.num_undecided, 1);
  EXPECT_GT(answer.summary.threshold_resolution, 1e-3);
  EXPECT_LT(answer.summary.threshold_resolution, 0.01);

  // A threshold of zero is never resolved by a Gram matrix.
  const MatrixXd singular = Eigen::Vector3d(1.0, 0.5, 0.0).asDiagonal();
  answer =
      Step(singular, g, SpectralFilter::HalfInverse(0.0), options, &workspace);
  EXPECT_EQ(answer.summary.route, SpectralRoute::kSvd);
}

// The route gram alone has nowhere to go: the step fails, and the message names
// estimate, tolerance and what to do.
TEST(SpectralStep, GramFailsWhereItIsNotAccurate) {
  for (const auto& [m, n] : kShapes) {
    SCOPED_TRACE(m);
    const Jacobians jacobians(m, n);
    SpectralStepOptions options;
    options.route = SpectralRoute::kGram;
    SpectralWorkspace workspace;
    EXPECT_TRUE(
        Step(jacobians.accurate, jacobians.g, kFilter, options, &workspace)
            .success);
    Answer answer =
        Step(jacobians.inaccurate, jacobians.g, kFilter, options, &workspace);
    EXPECT_FALSE(answer.success);
    EXPECT_EQ(answer.summary.message.rfind("route gram: estimated error ", 0),
              0u)
        << answer.summary.message;
    EXPECT_NE(answer.summary.message.find(
                  " > 1e-06; take route auto or svd, or a larger tolerance"),
              std::string::npos)
        << answer.summary.message;
    options.tolerance = 10.0 * answer.summary.estimated_error;
    EXPECT_TRUE(
        Step(jacobians.inaccurate, jacobians.g, kFilter, options, &workspace)
            .success);
    answer =
        Step(jacobians.undecided, jacobians.g, kFilter, options, &workspace);
    EXPECT_FALSE(answer.success);
    EXPECT_NE(answer.summary.message.find("undecided, threshold resolved to "),
              std::string::npos)
        << answer.summary.message;
    EXPECT_NE(answer.summary.message.find(
                  "take route auto or svd, or a larger threshold_tolerance"),
              std::string::npos)
        << answer.summary.message;
  }
}

TEST(SpectralStep, MemoryLimits) {
  const Jacobians jacobians;
  SpectralStepOptions options;
  options.memory_limit = 1000.0;  // bytes
  SpectralWorkspace workspace;
  for (const SpectralRoute route :
       {SpectralRoute::kGram, SpectralRoute::kSvd}) {
    options.route = route;
    const Answer answer =
        Step(jacobians.accurate, jacobians.g, kFilter, options, &workspace);
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
      Step(jacobians.accurate, jacobians.g, kFilter, options, &workspace)
          .success);
  const Answer answer =
      Step(jacobians.undecided, jacobians.g, kFilter, options, &workspace);
  EXPECT_FALSE(answer.success);
  EXPECT_EQ(answer.summary.message.rfind("route svd with J 64 x 90", 0), 0u)
      << answer.summary.message;
}

// A workspace that has been used for other things gives the same bits.
TEST(SpectralStep, NumbersDoNotDependOnTheWorkspace) {
  const Jacobians jacobians;
  RandomMatrices random(9);
  SpectralWorkspace used;
  for (const auto& [m, n] :
       {std::pair(80, 100), std::pair(100, 70), std::pair(5, 9)}) {
    const MatrixXd other =
        random.WithSpectrum(m, n, LogUniform(std::min(m, n), 1e-3));
    for (const SpectralRoute route :
         {SpectralRoute::kSvd, SpectralRoute::kGram}) {
      Step(other, random.Vector(m), kFilter, Take(route), &used);
    }
  }
  for (const SpectralRoute route :
       {SpectralRoute::kGram, SpectralRoute::kSvd}) {
    const Answer fresh = Step(jacobians.undecided, jacobians.g, route);
    for (int repeat = 0; repeat < 2; ++repeat) {
      const Answer again =
          Step(jacobians.undecided, jacobians.g, kFilter, Take(route), &used);
      EXPECT_EQ(again.d, fresh.d) << SpectralRouteName(route);
      EXPECT_EQ(again.summary.estimated_error, fresh.summary.estimated_error);
      EXPECT_EQ(again.summary.rank, fresh.summary.rank);
    }
  }
}

TEST(SpectralStep, AutoStaysWithTheSvdForTwentySteps) {
  const Jacobians jacobians;
  SpectralWorkspace workspace;
  const auto step = [&](const MatrixXd& J) {
    return Step(J, jacobians.g, kFilter, SpectralStepOptions(), &workspace);
  };
  EXPECT_EQ(step(jacobians.undecided).summary.route, SpectralRoute::kSvd);
  const Answer expected =
      Step(jacobians.accurate, jacobians.g, SpectralRoute::kSvd);
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
  const Jacobians jacobians;
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

TEST(SpectralStep, ZeroJacobianOrZeroDataGiveAZeroStep) {
  for (const auto& [m, n] : kShapes) {
    const Jacobians jacobians(m, n);
    for (const SpectralRoute route :
         {SpectralRoute::kAuto, SpectralRoute::kSvd, SpectralRoute::kGram}) {
      for (const bool clamp : {false, true}) {
        SCOPED_TRACE(testing::Message() << SpectralRouteName(route) << " " << m
                                        << (clamp ? " clamped" : ""));
        SpectralFilter filter = SpectralFilter::HalfInverse(1e-3);
        filter.clamp = clamp;
        Answer answer = Step(MatrixXd::Zero(m, n), jacobians.g, route, filter);
        EXPECT_TRUE(answer.success) << answer.summary.message;
        EXPECT_EQ(answer.d, VectorXd::Zero(n));
        EXPECT_EQ(answer.summary.rank, 0);
        answer = Step(jacobians.accurate, VectorXd::Zero(m), route, filter);
        EXPECT_TRUE(answer.success) << answer.summary.message;
        EXPECT_EQ(answer.d, VectorXd::Zero(n));
        EXPECT_EQ(answer.summary.rank, std::min(m, n));
        EXPECT_EQ(answer.summary.estimated_error, 0.0);
      }
    }
  }
}

TEST(SpectralStep, RefusesWhatIsNotFinite) {
  for (const auto& [m, n] : kShapes) {
    const Jacobians jacobians(m, n);
    for (const SpectralRoute route : {SpectralRoute::kAuto,
                                      SpectralRoute::kSvd,
                                      SpectralRoute::kGram,
                                      SpectralRoute::kGradient}) {
      const SpectralFilter filter = route == SpectralRoute::kGradient
                                        ? SpectralFilter::GradientDescent()
                                        : kFilter;
      for (const double bad : {kNaN, kInfinity, -kInfinity}) {
        VectorXd g = jacobians.g;
        g[3] = bad;
        Answer answer = Step(jacobians.accurate, g, route, filter);
        EXPECT_FALSE(answer.success);
        EXPECT_EQ(answer.summary.message.rfind("g is not finite: row 3 is ", 0),
                  0u)
            << answer.summary.message;
        MatrixXd J = jacobians.accurate;
        J(2, n - 1) = bad;
        answer = Step(J, jacobians.g, route, filter);
        EXPECT_FALSE(answer.success);
        EXPECT_EQ(answer.summary.message, "J is not finite: row 2");
      }
    }
  }
}

TEST(SpectralStep, RefusesAStepThatOverflows) {
  const Answer answer = Step(MatrixXd::Constant(1, 1, 1e-200),
                             VectorXd::Constant(1, 1e200),
                             SpectralRoute::kAuto,
                             SpectralFilter::GaussNewton(0.0));
  EXPECT_FALSE(answer.success);
  EXPECT_EQ(answer.summary.message, "the step is not finite: entry 0 is inf");
}

TEST(SpectralStep, WhereSquaresOverOrUnderflowAutoTakesTheSvd) {
  for (const auto& [m, n] : kShapes) {
    const Jacobians jacobians(m, n);
    const MatrixXd& J = jacobians.accurate;
    const Answer expected = Step(J, jacobians.g, SpectralRoute::kSvd);
    for (const double scale : {1e-170, 1e-140, 1e170}) {
      const Answer by_gram = Step(scale * J, jacobians.g, SpectralRoute::kGram);
      EXPECT_FALSE(by_gram.success);
      EXPECT_EQ(by_gram.summary.message.rfind("the squares of J's entries ", 0),
                0u)
          << by_gram.summary.message;
      const Answer answer = Step(scale * J, jacobians.g, SpectralRoute::kAuto);
      EXPECT_EQ(answer.summary.route, SpectralRoute::kSvd);
      EXPECT_LE((answer.d * std::sqrt(scale) - expected.d).norm(),
                1e-12 * expected.d.norm());
    }
  }
}

TEST(SpectralStep, GradientDescentNeedsNoFactorization) {
  RandomMatrices random(6);
  const MatrixXd J = random.WithSpectrum(5, 7, LogUniform(5, 1e-9));
  const VectorXd g = random.Vector(5);
  const VectorXd gradient = J.transpose() * g;
  const SpectralFilter filter = SpectralFilter::GradientDescent();
  const Answer answer = Step(J, g, SpectralRoute::kAuto, filter);
  EXPECT_EQ(answer.summary.route, SpectralRoute::kGradient);
  EXPECT_LE((answer.d - gradient).norm(), 8 * kEpsilon * gradient.norm());
  // The other routes agree, as well as their estimate says.
  for (const SpectralRoute route :
       {SpectralRoute::kSvd, SpectralRoute::kGram}) {
    const Answer other = Step(J, g, route, filter);
    EXPECT_LE((other.d - gradient).norm(),
              other.summary.estimated_error * gradient.norm());
  }
}

// J d = g if J is wide; J^T (J d - g) = 0 if it is tall.
TEST(SpectralStep, GaussNewtonIsLeastSquares) {
  for (const auto& [m, n] : kShapes) {
    const Jacobians jacobians(m, n);
    const MatrixXd& J = jacobians.accurate;
    const Answer answer = Step(J,
                               jacobians.g,
                               SpectralRoute::kAuto,
                               SpectralFilter::GaussNewton(1e-9));
    const VectorXd residual = J * answer.d - jacobians.g;
    // |J| = 1, and the product has roundings of its own.
    const double tolerance =
        (answer.summary.estimated_error + 64 * kEpsilon) * answer.d.norm();
    EXPECT_LE(m < n ? residual.norm() : (J.transpose() * residual).norm(),
              tolerance);
  }
}

// Levenberg-Marquardt tends to Gauss-Newton and to short gradient steps.
TEST(SpectralStep, LevenbergMarquardtLimits) {
  RandomMatrices random(10);
  const MatrixXd J = random.WithSpectrum(8, 12, LogUniform(8, 1e-1));
  const VectorXd g = random.Vector(8);
  const auto step = [&](const SpectralFilter& filter) {
    return Step(J, g, SpectralRoute::kAuto, filter).d;
  };
  const VectorXd gauss_newton = step(SpectralFilter::GaussNewton(0.0));
  // s / (s^2 + lambda) = 1 / s (1 - lambda / s^2 + ...), s >= 0.1.
  const VectorXd weak = step(SpectralFilter::LevenbergMarquardt(1e-8, 0.0));
  EXPECT_LE((weak - gauss_newton).norm(), 2e-6 * gauss_newton.norm());
  EXPECT_GE((weak - gauss_newton).norm(), 1e-9 * gauss_newton.norm());
  EXPECT_LE((step(SpectralFilter::LevenbergMarquardt(0.0, 0.0)) - gauss_newton)
                .norm(),
            1e-12 * gauss_newton.norm());
  const VectorXd gradient = J.transpose() * g;
  const VectorXd strong = step(SpectralFilter::LevenbergMarquardt(1e8, 0.0));
  EXPECT_LE((1e8 * strong - gradient).norm(), 2e-8 * gradient.norm());
}

TEST(SpectralStep, RestoresTheNumberOfBlasThreads) {
  const Jacobians jacobians;
  const int before = BlasThreads();
  SetBlasThreads(2);
  const int wanted = BlasThreads();
  for (const SpectralRoute route :
       {SpectralRoute::kAuto, SpectralRoute::kSvd, SpectralRoute::kGram}) {
    Step(jacobians.accurate, jacobians.g, route);
    EXPECT_EQ(BlasThreads(), wanted);
    Step(jacobians.accurate, VectorXd::Constant(64, kInfinity), route);
    EXPECT_EQ(BlasThreads(), wanted);
  }
  SetBlasThreads(before);
}

TEST(SpectralStep, RoutesHaveNames) {
  EXPECT_STREQ(SpectralRouteName(SpectralRoute::kGradient), "gradient");
  std::string names;
  for (const SpectralRoute route : GeneralSpectralRoutes()) {
    names += SpectralRouteName(route) + std::string(" ");
  }
  EXPECT_EQ(names, "auto gram svd ");
}

TEST(SpectralStepDeathTest, CallerBugsAreChecked) {
  // OpenBLAS has threads of its own.
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const MatrixXd J = MatrixXd::Identity(2, 3);
  EXPECT_DEATH(Step(J, VectorXd::Ones(3), SpectralRoute::kAuto), "g.size");
  EXPECT_DEATH(Step(J,
                    VectorXd::Ones(2),
                    SpectralRoute::kAuto,
                    SpectralFilter::Power(3.0, 0.0)),
               "kappa=3 is out of range");
  EXPECT_DEATH(Step(J, VectorXd::Ones(2), SpectralRoute::kGradient),
               "only computes phi");
}

}  // namespace spectral_step_test
}  // namespace invgrad
