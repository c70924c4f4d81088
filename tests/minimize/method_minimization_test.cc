#include "invgrad/minimize/method_minimization.h"

#include <memory>
#include <string>
#include <vector>

#include "ceres/autodiff_cost_function.h"
#include "gtest/gtest.h"
#include "invgrad/loss.h"
#include "invgrad/method.h"
#include "invgrad/minimize.h"
#include "tests/support/parse_method.h"
#include "tests/support/rosenbrock.h"

namespace invgrad {
namespace method_minimization_test {

class ProblemMinimization : public testing::Test {
 protected:
  ProblemMinimization() {
    problem_.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Rosenbrock, 2, 2>(new Rosenbrock),
        nullptr,
        x_);
  }

  bool Run(const Method& method) {
    x_[0] = -1.2;
    x_[1] = 1.0;
    MinimizerOptions options;
    options.max_num_iterations = 500;
    options.function_tolerance = 1e-12;
    return MinimizeProblem(
        method, options, nullptr, &problem_, &summary_, &error_);
  }

  double x_[2] = {-1.2, 1.0};
  ceres::Problem problem_;
  MinimizerSummary summary_;
  std::string error_;
};

TEST_F(ProblemMinimization, TakesRulesCeresAndBoth) {
  for (const char* text : {"gauss_newton",
                           "ceres_lm",
                           "ceres_lm:linear_solver=dense_schur",
                           "ceres_dogleg",
                           "ceres_bfgs",
                           "hessian_free",
                           "ceres_lm+hessian_free",
                           "ceres_lm+half_inverse:step_size=auto:rho=1"}) {
    SCOPED_TRACE(text);
    ASSERT_TRUE(Run(ParseMethod(text))) << error_;
    EXPECT_NEAR(summary_.initial_cost, 0.5 * (2.2 * 2.2 + 4.4 * 4.4), 1e-12);
    EXPECT_LT(summary_.final_cost, 1e-12);
    EXPECT_NEAR(x_[0], 1.0, 1e-5);
    EXPECT_NEAR(x_[1], 1.0, 1e-5);
  }
  EXPECT_NE(summary_.message.find("proposed"), std::string::npos)
      << summary_.message;
}

// A point pulled back through the simulator.
bool PullBack(const std::string& method,
              PointObjective* objective,
              std::string* error) {
  MinimizerOptions options;
  options.max_num_iterations = 1;
  std::vector<Eigen::VectorXd> path;
  MinimizerSummary summary;
  return MinimizeByMethod(
      ParseMethod(method), options, nullptr, objective, &path, &summary, error);
}

TEST(PointMinimization, TheHessianOfAPulledBackChangeIsTheProxys) {
  const Eigen::Vector2d target(1.0, -2.0);
  const Eigen::Vector2d start(0.0, 0.0);
  PointObjective objective(std::make_shared<IdentitySimulator>(2),
                           std::make_shared<SquaredNormLoss>(2, 7.0),
                           target,
                           start);
  std::string error;
  // The proxy 1/2 |x - x~|^2 has the Hessian 1, the loss 14.
  ASSERT_TRUE(PullBack("newton/inverse/adahessian:step_size=0.5:epsilon=1e-12",
                       &objective,
                       &error))
      << error;
  EXPECT_LT((objective.State() - 0.5 * target).norm(), 1e-9);
}

TEST(PointMinimization, APulledBackChangeHasNoCostToCompare) {
  PointObjective objective(std::make_shared<IdentitySimulator>(2),
                           std::make_shared<SquaredNormLoss>(2, 0.5),
                           Eigen::Vector2d::Ones(),
                           Eigen::Vector2d::Zero());
  std::string error;
  for (const std::string rule :
       {"hessian_free", "half_inverse:control=gain", "geodesic", "ssbroyden"}) {
    for (const std::string ways : {"newton/inverse/", "newton/joint/"}) {
      EXPECT_FALSE(PullBack(ways + rule, &objective, &error));
      EXPECT_EQ(error.find("the rule compares costs"), 0u) << error;
    }
    EXPECT_TRUE(PullBack("gradient/joint/" + rule, &objective, &error))
        << error;
  }
}

TEST_F(ProblemMinimization, RefusesWhatNeedsAChain) {
  for (const char* text : {"adam:steps=5>gauss_newton",
                           "newton/inverse/adam",
                           "adam:batch_size=1"}) {
    EXPECT_FALSE(Run(ParseMethod(text))) << text;
    EXPECT_FALSE(error_.empty()) << text;
    EXPECT_EQ(x_[0], -1.2);
  }
}

// Ceres projects onto bounds, and nothing does so after the steps of a rule.
TEST_F(ProblemMinimization, RulesAloneRefuseBounds) {
  problem_.SetParameterUpperBound(x_, 0, 0.5);
  for (const char* text : {"geodesic", "gauss_newton", "adam"}) {
    EXPECT_FALSE(Run(ParseMethod(text))) << text;
    EXPECT_EQ(error_.find("the problem has bounds"), 0u) << error_;
    EXPECT_EQ(x_[0], -1.2);
  }
  for (const char* text : {"ceres_lm", "ceres_lm+geodesic"}) {
    ASSERT_TRUE(Run(ParseMethod(text))) << error_;
    EXPECT_EQ(x_[0], 0.5) << text;
  }
  problem_.SetParameterBlockConstant(x_);
  EXPECT_TRUE(Run(ParseMethod("geodesic"))) << error_;
}

// 200,000 unknowns: 320 GB a dense matrix. Held constant they are none.
TEST_F(ProblemMinimization, RefusesMatricesThatDoNotFit) {
  std::vector<double> many(200000, 0.0);
  for (size_t i = 0; i < many.size(); i += 2) {
    problem_.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Rosenbrock, 2, 2>(new Rosenbrock),
        nullptr,
        &many[i]);
  }
  const std::vector<std::string> methods = {
      "ceres_bfgs",
      "ceres_lm:linear_solver=dense_qr",
      "ceres_dogleg:linear_solver=dense_normal_cholesky"};
  for (const std::string& text : methods) {
    EXPECT_FALSE(Run(ParseMethod(text))) << text;
    EXPECT_NE(error_.find("GB"), std::string::npos) << error_;
  }
  for (size_t i = 0; i < many.size(); i += 2) {
    problem_.SetParameterBlockConstant(&many[i]);
  }
  for (const std::string& text : methods) {
    EXPECT_TRUE(Run(ParseMethod(text))) << text << ": " << error_;
    EXPECT_NEAR(x_[0], 1.0, 1e-5);
  }
}

TEST_F(ProblemMinimization, DefaultsOfAProblemGiveWayToSettings) {
  Method method = ParseMethod("ceres_lm:linear_solver=cgnr");
  method.AddCeresDefaults(
      {{"linear_solver", "dense_schur"}, {"num_threads", "2"}});
  const Settings expected = {{"linear_solver", "cgnr"}, {"num_threads", "2"}};
  EXPECT_EQ(method.last_phase().ceres_settings, expected);
  // A line search has no linear solver, and a rule is not of Ceres.
  for (const char* text : {"ceres_bfgs", "gauss_newton"}) {
    method = ParseMethod(text);
    method.AddCeresDefaults({{"linear_solver", "dense_schur"}});
    EXPECT_TRUE(method.last_phase().ceres_settings.empty()) << text;
  }
}

}  // namespace method_minimization_test
}  // namespace invgrad
