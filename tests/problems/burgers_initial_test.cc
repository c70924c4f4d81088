#include "problems/burgers_initial.h"

#include <cmath>
#include <string>
#include <vector>

#include "Eigen/SVD"
#include "gtest/gtest.h"
#include "invgrad/method.h"
#include "invgrad/minimize.h"
#include "invgrad/minimize/method_minimization.h"
#include "tests/support/simulator_identities.h"

namespace invgrad {
namespace burgers_initial_test {

using Eigen::VectorXd;

PointProblem Create(const std::string& target) {
  PointProblem problem;
  std::string error;
  EXPECT_TRUE(BurgersInitial{target}.Create(&problem, &error)) << error;
  return problem;
}

MinimizerSummary Minimize(const std::string& target,
                          const std::string& method,
                          int num_steps) {
  const PointProblem problem = Create(target);
  std::vector<Method> methods;
  std::string error;
  EXPECT_TRUE(ParseMethods(method, &methods, &error)) << error;
  MinimizerOptions options;
  options.max_num_iterations = num_steps;
  PointObjective objective = problem.MakeObjective();
  std::vector<VectorXd> path;
  MinimizerSummary summary;
  EXPECT_TRUE(MinimizeByMethod(
      methods.at(0), options, nullptr, &objective, &path, &summary, &error))
      << error;
  return summary;
}

// PBDL, diffphys-code-burgers, as printed.
TEST(BurgersInitial, GradientDescentGivesThePublishedLosses) {
  const MinimizerSummary summary =
      Minimize("published", "gradient_descent:step_size=5", 45);
  const struct {
    int step;
    double loss;
  } printed[] = {{0, 0.382915},
                 {1, 0.326882},
                 {2, 0.281032},
                 {3, 0.242804},
                 {4, 0.210666},
                 {10, 0.096224},
                 {25, 0.020334},
                 {45, 0.003263}};
  for (const auto& [step, loss] : printed) {
    EXPECT_NEAR(summary.iterations.at(step).cost, loss, 2e-6) << step;
  }
}

TEST(BurgersInitial, SecondOrderMethodsFindTheSimulatedTarget) {
  for (const char* method : {"ceres_lm",
                             "half_inverse:step_size=64:truncation=1e-3",
                             "krylov:step_size=64"}) {
    EXPECT_LT(Minimize("simulated", method, 10).final_cost, 1e-8) << method;
  }
}

// After 10 steps the loss is 6e-9 to 1.6e-8, by the roundings of OpenBLAS'
// Prescott, Haswell, Zen and SkylakeX kernels.
TEST(BurgersInitial, TruncatedGaussNewtonFindsThePublishedTargetIn10Steps) {
  for (const char* iterations : {"20", "30", "40"}) {
    EXPECT_LT(Minimize("published",
                       std::string("krylov:kappa=1:step_size=40:iterations=") +
                           iterations,
                       10)
                  .final_cost,
              2e-8)
        << iterations;
  }
}

TEST(BurgersInitial, HalfInverseFindsThePublishedTarget) {
  EXPECT_LT(
      Minimize("published", "half_inverse:step_size=40:truncation=3e-3", 20)
          .final_cost,
      1e-8);
}

// Why the published target needs short steps: the first one makes the shock.
TEST(BurgersInitial, TheShockTakesHalfOfTheSingularValues) {
  const PointProblem problem = Create("published");
  const auto singular_values = [&problem](const VectorXd& x) {
    Eigen::MatrixXd J(128, 128);  // transposed
    VectorXd y(128);
    EXPECT_TRUE(
        problem.simulator->Evaluate(x.data(), nullptr, y.data(), J.data()));
    return VectorXd(Eigen::JacobiSVD<Eigen::MatrixXd>(J).singularValues());
  };
  const VectorXd smooth = singular_values(problem.start);
  EXPECT_GT(smooth[127], 0.8);
  EXPECT_LE(smooth[0], 1.0 + 1e-12);
  const VectorXd shock = singular_values(40.0 / 64.0 * problem.target);
  const auto num_small = (shock.array() < 1e-2 * shock[0]).count();
  EXPECT_GT(num_small, 40);
  EXPECT_LT(num_small, 70);
}

TEST(BurgersInitial, DerivativesAgree) {
  const PointProblem problem = Create("simulated");
  ExpectAdjointIdentity(*problem.simulator, NormalVector(128, 1), nullptr);
  // A smooth state that moves to the right: no look-up stays on a cell centre.
  const VectorXd x = VectorXd::NullaryExpr(128, [](Eigen::Index i) {
    return 0.3 + 0.1 * std::sin(2.0 * M_PI * (i + 0.1) / 128.0);
  });
  ExpectTangentIsDifference(*problem.simulator, x, nullptr, 1e-7, 1e-6);
}

TEST(BurgersInitial, UniformFlowStays) {
  const PointProblem problem = Create("published");
  const VectorXd x = VectorXd::Constant(128, 0.7);
  VectorXd y(128);
  ASSERT_TRUE(
      problem.simulator->Evaluate(x.data(), nullptr, y.data(), nullptr));
  EXPECT_LT((y - x).norm(), 1e-13);
}

TEST(BurgersInitial, ReportsNoFiniteValue) {
  const PointProblem problem = Create("published");
  VectorXd x = VectorXd::Zero(128), y(128);
  x[3] = std::nan("");
  EXPECT_FALSE(
      problem.simulator->Evaluate(x.data(), nullptr, y.data(), nullptr));
  EXPECT_EQ(problem.simulator->Linearize(x.data(), nullptr, y.data()), nullptr);
}

}  // namespace burgers_initial_test
}  // namespace invgrad
