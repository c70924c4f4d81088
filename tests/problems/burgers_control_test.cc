#include "problems/burgers_control.h"

#include <cmath>
#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "problems/problems.h"
#include "tests/support/create_problem.h"
#include "tests/support/random_matrix.h"
#include "tests/support/take_steps.h"
#include "tests/support/train_problem.h"

namespace invgrad {
namespace burgers_control_test {

using Eigen::VectorXd;

// The state after one step, from u at the clock `clock`.
VectorXd Advance(const BurgersControl::Step& step,
                 const VectorXd& u,
                 double clock,
                 const VectorXd& force) {
  VectorXd state(u.size() + 1);
  state << u, clock;
  VectorXd next(state.size());
  EXPECT_TRUE(step(state.data(), force.data(), next.data()));
  EXPECT_NEAR(next.tail(1).value(), clock + 1.0 / step.horizon, 1e-15);
  return next.head(u.size());
}

// Fields of order one on the default grid.
struct Fields {
  BurgersControl::Step step = BurgersControl().MakeStep();
  VectorXd u = 2.0 * RandomMatrix(step.num_cells, 1, 1);
  VectorXd force = RandomMatrix(step.num_cells, 1, 2);
};

// By the transformation of Cole and Hopf, u = -2 nu phi_x / phi with a solution
// phi = a + exp(-nu k^2 t) cos k x of the heat equation.
TEST(BurgersControl, StepIsOfOrderOne) {
  const double nu = 0.03;
  const double end = 0.4;
  const double k = 2.0 * M_PI;
  const auto exact = [=](int n, double t) -> VectorXd {
    const double decay = std::exp(-nu * k * k * t);
    return VectorXd::NullaryExpr(n, [=](Eigen::Index i) {
      const double x = (i + 0.5) / n;
      return 2.0 * nu * k * decay * std::sin(k * x) /
             (1.05 + decay * std::cos(k * x));
    });
  };
  const auto error_at = [&](int n) {
    BurgersControl::Step step = {n, 1, end, nu, 0};
    step.num_substeps =
        static_cast<int>(std::ceil(end * n * (6.0 + 2.0 * n * nu)));
    const VectorXd u = Advance(step, exact(n, 0.0), 0.0, VectorXd::Zero(n));
    return (u - exact(n, end)).norm() / std::sqrt(n);
  };
  EXPECT_LT(error_at(64), 0.02 * exact(64, end).maxCoeff());
  EXPECT_NEAR(std::log2(error_at(32) / error_at(64)), 1.0, 0.05);
}

TEST(BurgersControl, OnlyTheForceChangesTheMean) {
  const Fields at;
  const VectorXd next = Advance(at.step, at.u, 0.0, at.force);
  EXPECT_NEAR(next.mean(), at.u.mean() + at.step.dt * at.force.mean(), 1e-14);
  EXPECT_GT((next - at.u).norm(), 1.0);
}

TEST(BurgersControl, NoExtremumGrowsWithoutForce) {
  const Fields at;
  const VectorXd next =
      Advance(at.step, at.u, 0.0, VectorXd::Zero(at.u.size()));
  EXPECT_LE(next.maxCoeff(), at.u.maxCoeff());
  EXPECT_GE(next.minCoeff(), at.u.minCoeff());
}

// x -> -x, u -> -u, f -> -f; and a shift by five cells.
TEST(BurgersControl, StepKeepsTheSymmetriesOfTheEquation) {
  const Fields at;
  const VectorXd next = Advance(at.step, at.u, 0.0, at.force);
  EXPECT_LT((Advance(at.step, -at.u.reverse(), 0.0, -at.force.reverse()) +
             next.reverse())
                .norm(),
            1e-13);
  const auto shifted = [](const VectorXd& v) -> VectorXd {
    return VectorXd::NullaryExpr(
        v.size(), [&](Eigen::Index i) { return v[(i + 5) % v.size()]; });
  };
  EXPECT_EQ(Advance(at.step, shifted(at.u), 0.0, shifted(at.force)),
            shifted(next));
}

TEST(BurgersControl, OnlyTheLastStepHasNoForce) {
  const Fields at;
  const VectorXd none = VectorXd::Zero(at.u.size());
  for (int t = 0; t < at.step.horizon; ++t) {
    const double clock = static_cast<double>(t) / at.step.horizon;
    EXPECT_EQ(Advance(at.step, at.u, clock, at.force) ==
                  Advance(at.step, at.u, clock, none),
              t == at.step.horizon - 1);
  }
}

// The force that made u* reaches it, at the cost of its square alone.
TEST(BurgersControl, ForceOfTheDataReachesTheTarget) {
  BurgersControl options;
  options.num_samples = 3;
  LearningProblem problem;
  std::string error;
  ASSERT_TRUE(options.Create(&problem, &error)) << error;
  const Eigen::MatrixXd& x = problem.train.solutions;
  EXPECT_EQ(problem.metric->evaluate(x, problem.train), 0.0);
  EXPECT_GT(problem.metric->evaluate(0.0 * x, problem.train), 1e-3);
  const double dt = BurgersControl::kEndTime / options.horizon;
  for (int s = 0; s < 3; ++s) {
    VectorXd y(problem.model->simulator().num_outputs());
    double loss = 0.0;
    ASSERT_TRUE(problem.model->simulator().Evaluate(
        x.col(s).data(), problem.train.Context(s).data(), y.data(), nullptr));
    ASSERT_TRUE(
        problem.model->loss().Evaluate(y.data(),
                                       problem.train.targets.col(s).data(),
                                       &loss,
                                       nullptr,
                                       nullptr));
    EXPECT_NEAR(loss,
                options.control_weight * dt * x.col(s).squaredNorm() /
                    options.num_cells,
                1e-14);
  }
}

TEST(BurgersControl, ShortTrainingBeatsNoForce) {
  const LearningProblem problem = CreateLearningProblem(
      "burgers_control:num_cells=16:horizon=3:num_samples=64");
  std::string error;
  double no_force = 0.0;  // all weights zero
  ASSERT_TRUE(problem.model->Cost(VectorXd::Zero(problem.model->num_weights()),
                                  problem.train,
                                  &no_force,
                                  &error))
      << error;
  VectorXd weights = InitialWeights(problem, 0);
  TakeSteps(problem, "half_inverse:step_size=auto", 8, 40, &weights);
  double trained = 0.0;
  ASSERT_TRUE(problem.model->Cost(weights, problem.train, &trained, &error));
  EXPECT_LT(trained, 0.6 * no_force);
}

TEST(BurgersControl, DataWithAnInfiniteStateAreRefused) {
  LearningProblem problem;
  problem.data = Eigen::MatrixXd::Constant(2, 9, 1e3);
  std::string error;
  EXPECT_FALSE(BurgersControl().Create(&problem, &error));
  EXPECT_NE(error.find("not finite"), std::string::npos) << error;
}

}  // namespace burgers_control_test
}  // namespace invgrad
