// What UpdateCallback refuses, and what it notices when it is used wrongly.

#include <cmath>
#include <memory>
#include <string>
#include <type_traits>

#include "ceres/iteration_callback.h"
#include "ceres/manifold.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"
#include "tests/ceres/callback_problems.h"
#include "tests/support/rosenbrock.h"

namespace invgrad {
namespace update_callback_misuse_test {

using Options = UpdateCallback::Options;

TEST(UpdateCallback, NeedsAddToBeforeEachSolve) {
  TwoBlockRosenbrock p;
  PowerRule rule(0.5);
  UpdateCallback callback(&rule, &p.problem);
  ceres::Solver::Options options = SolverOptions(&callback);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &p.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  p.x = -1.2;
  p.y = 1.0;
  ceres::Solve(options, &p.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::USER_FAILURE);
  EXPECT_NE(callback.summary().message.find("call UpdateCallback::AddTo"),
            std::string::npos)
      << callback.summary().message;
  EXPECT_EQ(p.x, -1.2);
  EXPECT_EQ(p.y, 1.0);
  callback.AddTo(&options);
  ceres::Solve(options, &p.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_NEAR(p.x, 1.0, 1e-6);
}

TEST(UpdateCallback, SaysWhyThereIsNoRule) {
  TwoBlockRosenbrock p;
  std::string error;
  const std::unique_ptr<UpdateRule> rule = MakeRule("half_invers", &error);
  EXPECT_DEATH(UpdateCallback(rule.get(), &p.problem),
               "returns no rule for an invalid specification");
}

TEST(UpdateCallback, NoticesAProblemThatIsDestroyedFirst) {
  EXPECT_DEATH(
      {
        PowerRule rule(0.5);
        auto p = std::make_unique<TwoBlockRosenbrock>();
        UpdateCallback callback(&rule, &p->problem);
        p.reset();
      },
      "destroyed before its UpdateCallback");
}

// The compiler refuses options.callbacks.push_back(&callback), which would
// forget the flag.
static_assert(
    !std::is_convertible_v<UpdateCallback*, ceres::IterationCallback*>);

TEST(UpdateCallback, AddToSetsTheFlag) {
  TwoBlockRosenbrock p;
  PowerRule rule(1.0);
  UpdateCallback callback(&rule, &p.problem);
  ceres::Solver::Options options;
  EXPECT_FALSE(options.update_state_every_iteration);
  callback.AddTo(&options);
  EXPECT_TRUE(options.update_state_every_iteration);
  EXPECT_EQ(options.callbacks.size(), 1u);
}

TEST(UpdateCallback, NoticesAnotherStateAtTheFirstAcceptedStep) {
  TwoBlockRosenbrock p;
  PowerRule rule(1.0);
  UpdateCallback callback(&rule, &p.problem);
  ceres::Solver::Options options = SolverOptions(&callback);
  options.update_state_every_iteration = false;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &p.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::USER_FAILURE);
  EXPECT_NE(callback.summary().message.find("update_state_every_iteration"),
            std::string::npos);
}

TEST(UpdateCallback, NoticesALineSearch) {
  TwoBlockRosenbrock p;
  PowerRule rule(1.0);
  UpdateCallback callback(&rule, &p.problem);
  ceres::Solver::Options options = SolverOptions(&callback);
  options.minimizer_type = ceres::LINE_SEARCH;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &p.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::USER_FAILURE);
  EXPECT_NE(callback.summary().message.find("TRUST_REGION"), std::string::npos);
  EXPECT_EQ(p.x, -1.2);
}

TEST(UpdateCallback, RefusesLargeBlocks) {
  std::string error;
  PoseProblem pose;
  Options options;
  options.max_block_size = 3;  // a quaternion's tangent space fits exactly
  EXPECT_TRUE(UpdateCallback::IsSupported(options, pose.problem, &error));
  options.max_block_size = 2;
  EXPECT_FALSE(UpdateCallback::IsSupported(options, pose.problem, &error));
  EXPECT_NE(error.find("max_block_size"), std::string::npos) << error;
}

TEST(UpdateCallback, OneOfAProblemAtATime) {
  TwoBlockRosenbrock p;
  PowerRule rule(0.5);
  UpdateCallback callback(&rule, &p.problem);
  EXPECT_DEATH(UpdateCallback(&rule, &p.problem), "still exists");
}

// A user who follows the advice of a rank report while the callback exists.
TEST(UpdateCallback, ManifoldsSetMeanwhileAreRefusedAndKept) {
  PoseProblem pose;
  PowerRule rule(0.5);
  auto* fixed_x = new ceres::SubsetManifold(3, {0});
  {
    UpdateCallback callback(&rule, &pose.problem);
    ceres::Solver::Options options;
    callback.AddTo(&options);
    pose.problem.SetManifold(pose.t, fixed_x);
    EXPECT_DEATH(callback.AddTo(&options), "End the callback before");
  }
  EXPECT_EQ(pose.problem.GetManifold(pose.t), fixed_x);
}

TEST(UpdateCallback, BlocksHeldConstantMeanwhileAreRefused) {
  TwoBlockRosenbrock p;
  PowerRule rule(0.5);
  UpdateCallback callback(&rule, &p.problem);
  ceres::Solver::Options options;
  p.problem.SetParameterBlockConstant(&p.x);
  EXPECT_DEATH(callback.AddTo(&options), "End the callback before");
}

TEST(UpdateCallback, LeavesInvalidTolerancesToCeres) {
  for (double ceres::Solver::Options::*tolerance :
       {&ceres::Solver::Options::function_tolerance,
        &ceres::Solver::Options::gradient_tolerance,
        &ceres::Solver::Options::parameter_tolerance}) {
    for (const double value : {-1.0, std::nan("")}) {
      TwoBlockRosenbrock p;
      PowerRule rule(0.5);
      UpdateCallback callback(&rule, &p.problem);
      ceres::Solver::Options options = SolverOptions(nullptr);
      options.*tolerance = value;
      callback.AddTo(&options);
      ceres::Solver::Summary summary;
      ceres::Solve(options, &p.problem, &summary);
      EXPECT_EQ(summary.termination_type, ceres::FAILURE);
      EXPECT_NE(summary.message.find("_tolerance"), std::string::npos)
          << summary.message;
      EXPECT_EQ(p.x, -1.2);
    }
  }
}

// The second solve with the coarse options is as the first.
TEST(UpdateCallback, OptionsKeepTheirOwnTolerances) {
  TwoBlockRosenbrock p;
  PowerRule rule(1.0);
  UpdateCallback callback(&rule, &p.problem);
  ceres::Solver::Options coarse = SolverOptions(nullptr);
  coarse.function_tolerance = coarse.gradient_tolerance =
      coarse.parameter_tolerance = 1e-2;
  ceres::Solver::Options fine = SolverOptions(nullptr);
  fine.function_tolerance = fine.gradient_tolerance = fine.parameter_tolerance =
      1e-14;
  const auto final_cost = [&](ceres::Solver::Options* options) {
    p.x = -1.2;
    p.y = 1.0;
    callback.AddTo(options);
    ceres::Solver::Summary summary;
    ceres::Solve(*options, &p.problem, &summary);
    return summary.final_cost;
  };
  const double first = final_cost(&coarse);
  const double better = final_cost(&fine);
  EXPECT_LT(better, 1e-6 * first);
  EXPECT_EQ(final_cost(&coarse), first);
  // Copies, too, whichever solve came last.
  final_cost(&fine);
  ceres::Solver::Options copy = coarse;
  EXPECT_EQ(final_cost(&copy), first);
}

}  // namespace update_callback_misuse_test
}  // namespace invgrad
