// What a spectral step does and says: routes and failures. Its accuracy:
// spectral_accuracy_test.cc.
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "gtest/gtest.h"
#include "invgrad/spectral.h"
#include "tests/spectral/graded_jacobians.h"

namespace invgrad {
namespace spectral_step_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(SpectralStep, AutoTakesTheSvdWhereTheGramMatrixIsNotAccurate) {
  for (const auto& [m, n] : kShapes) {
    SCOPED_TRACE(m);
    const GradedJacobians jacobians(m, n);
    Answer answer =
        AnswerOf(jacobians.accurate, jacobians.g, SpectralRoute::kAuto);
    EXPECT_EQ(answer.summary.route, SpectralRoute::kGram);
    EXPECT_EQ(answer.summary.message, "");
    EXPECT_LE(answer.summary.estimated_error, 1e-6);
    answer = AnswerOf(jacobians.inaccurate, jacobians.g, SpectralRoute::kAuto);
    EXPECT_EQ(answer.summary.route, SpectralRoute::kSvd);
    EXPECT_EQ(answer.summary.message.rfind("gram: estimated error ", 0), 0u)
        << answer.summary.message;
    EXPECT_NE(answer.summary.message.find(" > 1e-06"), std::string::npos)
        << answer.summary.message;
  }
}

// What auto returns is what its last route alone returns, bit for bit.
TEST(SpectralStep, AutoLeavesNoTraceInTheNumbers) {
  const GradedJacobians jacobians;
  for (const auto& [J, route] :
       {std::pair(jacobians.accurate, SpectralRoute::kGram),
        std::pair(jacobians.undecided, SpectralRoute::kSvd)}) {
    const Answer by_auto = AnswerOf(J, jacobians.g, SpectralRoute::kAuto);
    const Answer alone = AnswerOf(J, jacobians.g, route);
    EXPECT_EQ(by_auto.summary.route, route);
    EXPECT_EQ(by_auto.d, alone.d) << SpectralRouteName(route);
    EXPECT_EQ(by_auto.summary.estimated_error, alone.summary.estimated_error);
    EXPECT_EQ(alone.summary.message, "");
  }
}

TEST(SpectralStep, TheToleranceDecides) {
  const GradedJacobians jacobians;
  SpectralStepOptions options;
  const auto route_for = [&](const MatrixXd& J, double tolerance) {
    options.tolerance = tolerance;
    SpectralWorkspace workspace;
    return AnswerOf(J, jacobians.g, kFilter, options, &workspace).summary.route;
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
  Answer answer = AnswerOf(J, g, filter, options, &workspace);
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
  answer = AnswerOf(J, g, filter, options, &other);
  EXPECT_EQ(answer.summary.route, SpectralRoute::kGram);
  EXPECT_EQ(answer.summary.num_undecided, 1);
  EXPECT_GT(answer.summary.threshold_resolution, 1e-3);
  EXPECT_LT(answer.summary.threshold_resolution, 0.01);

  // A threshold of zero is never resolved by a Gram matrix.
  const MatrixXd singular = Eigen::Vector3d(1.0, 0.5, 0.0).asDiagonal();
  answer = AnswerOf(
      singular, g, SpectralFilter::HalfInverse(0.0), options, &workspace);
  EXPECT_EQ(answer.summary.route, SpectralRoute::kSvd);
}

// The route gram alone has nowhere to go: the step fails, and the message names
// estimate, tolerance and what to do.
TEST(SpectralStep, GramFailsWhereItIsNotAccurate) {
  for (const auto& [m, n] : kShapes) {
    SCOPED_TRACE(m);
    const GradedJacobians jacobians(m, n);
    SpectralStepOptions options;
    options.route = SpectralRoute::kGram;
    SpectralWorkspace workspace;
    EXPECT_TRUE(
        AnswerOf(jacobians.accurate, jacobians.g, kFilter, options, &workspace)
            .success);
    Answer answer = AnswerOf(
        jacobians.inaccurate, jacobians.g, kFilter, options, &workspace);
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
        AnswerOf(
            jacobians.inaccurate, jacobians.g, kFilter, options, &workspace)
            .success);
    answer = AnswerOf(
        jacobians.undecided, jacobians.g, kFilter, options, &workspace);
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

TEST(SpectralStep, ZeroJacobianOrZeroDataGiveAZeroStep) {
  for (const auto& [m, n] : kShapes) {
    const GradedJacobians jacobians(m, n);
    for (const SpectralRoute route :
         {SpectralRoute::kAuto, SpectralRoute::kSvd, SpectralRoute::kGram}) {
      for (const bool clamp : {false, true}) {
        SCOPED_TRACE(testing::Message() << SpectralRouteName(route) << " " << m
                                        << (clamp ? " clamped" : ""));
        SpectralFilter filter = SpectralFilter::HalfInverse(1e-3);
        filter.clamp = clamp;
        Answer answer =
            AnswerOf(MatrixXd::Zero(m, n), jacobians.g, route, filter);
        EXPECT_TRUE(answer.success) << answer.summary.message;
        EXPECT_EQ(answer.d, VectorXd::Zero(n));
        EXPECT_EQ(answer.summary.rank, 0);
        answer = AnswerOf(jacobians.accurate, VectorXd::Zero(m), route, filter);
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
    const GradedJacobians jacobians(m, n);
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
        Answer answer = AnswerOf(jacobians.accurate, g, route, filter);
        EXPECT_FALSE(answer.success);
        EXPECT_EQ(answer.summary.message.rfind("g is not finite: row 3 is ", 0),
                  0u)
            << answer.summary.message;
        MatrixXd J = jacobians.accurate;
        J(2, n - 1) = bad;
        answer = AnswerOf(J, jacobians.g, route, filter);
        EXPECT_FALSE(answer.success);
        EXPECT_EQ(answer.summary.message, "J is not finite: row 2");
      }
    }
  }
}

TEST(SpectralStep, RefusesAStepThatOverflows) {
  const Answer answer = AnswerOf(MatrixXd::Constant(1, 1, 1e-200),
                                 VectorXd::Constant(1, 1e200),
                                 SpectralRoute::kAuto,
                                 SpectralFilter::GaussNewton(0.0));
  EXPECT_FALSE(answer.success);
  EXPECT_EQ(answer.summary.message, "the step is not finite: entry 0 is inf");
}

TEST(SpectralStep, WhereSquaresOverOrUnderflowAutoTakesTheSvd) {
  for (const auto& [m, n] : kShapes) {
    const GradedJacobians jacobians(m, n);
    const MatrixXd& J = jacobians.accurate;
    const Answer expected = AnswerOf(J, jacobians.g, SpectralRoute::kSvd);
    for (const double scale : {1e-170, 1e-140, 1e170}) {
      const Answer by_gram =
          AnswerOf(scale * J, jacobians.g, SpectralRoute::kGram);
      EXPECT_FALSE(by_gram.success);
      EXPECT_EQ(by_gram.summary.message.rfind("the squares of J's entries ", 0),
                0u)
          << by_gram.summary.message;
      const Answer answer =
          AnswerOf(scale * J, jacobians.g, SpectralRoute::kAuto);
      EXPECT_EQ(answer.summary.route, SpectralRoute::kSvd);
      EXPECT_LE((answer.d * std::sqrt(scale) - expected.d).norm(),
                1e-12 * expected.d.norm());
    }
  }
}

TEST(SpectralStep, RoutesHaveNames) {
  EXPECT_STREQ(SpectralRouteName(SpectralRoute::kGradient), "gradient");
  std::string names;
  for (const SpectralRoute route : kGeneralSpectralRoutes) {
    names += SpectralRouteName(route) + std::string(" ");
  }
  EXPECT_EQ(names, "auto gram svd ");
}

TEST(SpectralStepDeathTest, CallerBugsAreChecked) {
  // OpenBLAS has threads of its own.
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const MatrixXd J = MatrixXd::Identity(2, 3);
  EXPECT_DEATH(AnswerOf(J, VectorXd::Ones(3), SpectralRoute::kAuto), "g.size");
  EXPECT_DEATH(AnswerOf(J,
                        VectorXd::Ones(2),
                        SpectralRoute::kAuto,
                        SpectralFilter::Power(3.0, 0.0)),
               "kappa=3 is out of range");
  EXPECT_DEATH(AnswerOf(J, VectorXd::Ones(2), SpectralRoute::kGradient),
               "only computes phi");
}

}  // namespace spectral_step_test
}  // namespace invgrad
