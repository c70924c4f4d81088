// The products with the Hessian that training and minimization give to a rule.

#include <memory>
#include <string>

#include "Eigen/Core"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/minimize.h"
#include "invgrad/second_order_cost_function.h"
#include "invgrad/train.h"
#include "invgrad/update_callback.h"
#include "tests/support/function_rule.h"
#include "tests/support/rosenbrock.h"
#include "tests/support/train_options.h"
#include "tests/train/regression.h"

namespace invgrad {
namespace hessian_products_test {

using Eigen::VectorXd;

// Gradient descent that compares H v with the exact H.
FunctionRule Comparing(double step_size, int* num_steps) {
  LinearizationParts parts = LinearizationParts::Gradient();
  parts.hessian = true;
  parts.hessian_times = true;
  return {parts,
          [step_size, num_steps](
              const Linearization& at_x, VectorXd* step, std::string* error) {
            ++*num_steps;
            const auto n = at_x.gradient.size();
            const VectorXd v = VectorXd::LinSpaced(n, -1.0, 2.0);
            const VectorXd expected = at_x.hessian * v;
            VectorXd Hv;
            if (!at_x.hessian_times(v, &Hv, error)) return false;
            EXPECT_LE((Hv - expected).norm(), 1e-8 * expected.norm());
            *step = -step_size * at_x.gradient;
            return true;
          }};
}

TEST(HessianProducts, OfTrainingAreThoseOfTheBatch) {
  const Regression problem;
  TrainOptions options = Epochs(2, 8);
  options.shuffle = true;
  int num_steps = 0;
  FunctionRule rule = Comparing(0.1, &num_steps);
  const TrainResult result = TrainRegression(problem, options, &rule);
  EXPECT_EQ(result.summary.num_steps, 6);
  EXPECT_EQ(num_steps, 6);
}

TEST(HessianProducts, OfMinimizeAreThoseOfTheProblem) {
  RosenbrockProblem p(
      new AutoDiffSecondOrderCostFunction<Rosenbrock, 2, 2>(new Rosenbrock));
  MinimizerOptions options;
  options.max_num_iterations = 5;
  int num_steps = 0;
  FunctionRule rule = Comparing(1e-3, &num_steps);
  MinimizerSummary summary;
  Minimize(options, &rule, &p.problem, &summary);
  EXPECT_EQ(summary.num_steps(), 5) << summary.message;
  EXPECT_EQ(num_steps, 5);
}

TEST(HessianProducts, OfProposalsAreThoseOfTheProblem) {
  RosenbrockProblem p(
      new AutoDiffSecondOrderCostFunction<Rosenbrock, 2, 2>(new Rosenbrock));
  int num_steps = 0;
  FunctionRule rule = Comparing(1e-3, &num_steps);
  UpdateCallback callback(&rule, &p.problem);
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  options.linear_solver_type = ceres::DENSE_QR;
  callback.AddTo(&options);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &p.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE) << summary.message;
  EXPECT_GT(num_steps, 0);
}

// The proxy of a pull-back through the identity is the loss with constant x~:
// its Hessian is that of 1/2 |f - x~|^2.
TEST(HessianProducts, OfAPullBackAreThoseOfTheProxy) {
  const Regression problem;
  TrainOptions options = Epochs(1, 8);
  options.initial_weights = problem.weights;
  const auto train = [&](const std::string& method) {
    return Train(problem.model, {problem.train, problem.test}, method, options);
  };
  // L = |y - y*|^2 has twice the gradient and the Hessian of the proxy: Newton's
  // ratio is the same.
  const TrainResult alone = train("adahessian:epsilon=2e-8");
  const TrainResult proxy = train("newton/adjoint/adahessian:epsilon=1e-8");
  ASSERT_EQ(alone.error, "");
  ASSERT_EQ(proxy.error, "");
  EXPECT_NE(alone.weights, problem.weights);
  EXPECT_LE((alone.weights - proxy.weights).norm(),
            1e-5 * alone.weights.norm());
}

}  // namespace hessian_products_test
}  // namespace invgrad
