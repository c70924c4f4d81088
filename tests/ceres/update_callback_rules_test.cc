// Every update rule inside ceres::Solve, and the blocks, manifolds and failures
// of estimation code.
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/Geometry"
#include "ceres/autodiff_cost_function.h"
#include "ceres/iteration_callback.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/product_manifold.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/rules.h"
#include "invgrad/second_order_cost_function.h"
#include "invgrad/update_callback.h"
#include "tests/ceres/callback_problems.h"
#include "tests/support/rosenbrock.h"

namespace invgrad {
namespace update_callback_rules_test {

// Each of them is asked, and at least one of its steps is taken; where a rule
// is bad at the valley, Ceres' own steps finish it.
TEST(UpdateCallbackRules, EveryRuleOfTheTable) {
  for (const RuleRow& row : Rules()) {
    SCOPED_TRACE(row.name);
    TwoBlockRosenbrock p(
        new AutoDiffSecondOrderCostFunction<Rosenbrock, 2, 1, 1>(
            new Rosenbrock));
    // The whole steps of both blocks, each as if the other stood still, are too
    // long together, and the linear model knows it.
    const std::unique_ptr<UpdateRule> rule =
        MakeRule(row.name == "layer_half_inverse" ? row.name + ":step_size=auto"
                                                  : row.name);
    // The run would end at the result of the plain solve.
    UpdateCallback::Options options;
    options.compare_with_plain = false;
    UpdateCallback callback(rule.get(), &p.problem, options);
    ceres::Solver::Summary summary;
    ceres::Solve(SolverOptions(&callback), &p.problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE) << summary.message;
    EXPECT_NEAR(p.x, 1.0, 1e-4);
    EXPECT_NEAR(p.y, 1.0, 2e-4);
    if (row.name == "kfac_half_inverse" || row.name == "kfac") {
      // Its factors are a network's.
      EXPECT_EQ(callback.summary().num_proposed, 0);
      EXPECT_NE(callback.summary().message.find("network"), std::string::npos)
          << callback.summary().message;
    } else {
      EXPECT_GT(callback.summary().num_accepted, 0)
          << callback.summary().BriefReport() << callback.summary().message;
    }
  }
}

// A pose in one block of seven, on SE(3) as a product of manifolds, a scale of
// which one component is known (subset), and a constant block.
struct PoseAndScale {
  // r = q (scale * p) + t - measured
  struct Sighting {
    Eigen::Vector3d p;
    Eigen::Vector3d measured;
    template <typename T>
    bool operator()(const T* pose, const T* scale, const T* unit, T* r) const {
      const Eigen::Map<const Eigen::Quaternion<T>> q(pose);
      const Eigen::Map<const Eigen::Matrix<T, 3, 1>> t(pose + 4);
      const Eigen::Map<const Eigen::Matrix<T, 3, 1>> s(scale);
      const Eigen::Matrix<T, 3, 1> scaled = unit[0] * s.cwiseProduct(p);
      Eigen::Map<Eigen::Matrix<T, 3, 1>>(r, 3) = q * scaled + t - measured;
      return true;
    }
  };

  double pose[7] = {0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0};
  double scale[3] = {1.0, 1.0, 1.0};
  double unit = 1.0;
  ceres::Problem problem;

  PoseAndScale() {
    const Eigen::Quaterniond q(
        Eigen::AngleAxisd(1.2, Eigen::Vector3d(1.0, 2.0, -1.0).normalized()));
    const Eigen::Vector3d t(0.5, -2.0, 1.0);
    const Eigen::Vector3d s(1.0, 1.3, 0.8);
    for (int k = 0; k < 6; ++k) {
      auto* sighting = new Sighting;
      sighting->p = Eigen::Vector3d(
          std::sin(k), std::cos(2.0 * k), 0.5 * std::sin(3.0 * k + 1.0));
      sighting->measured = q * s.cwiseProduct(sighting->p) + t;
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Sighting, 3, 7, 3, 1>(sighting),
          nullptr,
          pose,
          scale,
          &unit);
    }
    problem.SetManifold(
        pose,
        new ceres::ProductManifold<ceres::EigenQuaternionManifold,
                                   ceres::EuclideanManifold<3>>());
    problem.SetManifold(scale, new ceres::SubsetManifold(3, {0}));
    problem.SetParameterBlockConstant(&unit);
  }
};

TEST(UpdateCallbackRules, ProductAndSubsetManifolds) {
  for (const std::string text :
       {"half_inverse:step_size=auto:rho=1", "gauss_newton", "adam"}) {
    SCOPED_TRACE(text);
    PoseAndScale p;
    const std::unique_ptr<UpdateRule> rule = MakeRule(text);
    UpdateCallback callback(rule.get(), &p.problem);
    ceres::Solver::Options options = SolverOptions(nullptr);
    options.num_threads = 2;
    callback.AddTo(&options);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &p.problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE) << summary.message;
    EXPECT_LT(summary.final_cost, 1e-10);
    EXPECT_NEAR(Eigen::Map<Eigen::Vector4d>(p.pose).norm(), 1.0, 1e-12);
    EXPECT_EQ(p.scale[0], 1.0);
    EXPECT_NEAR(p.scale[1], 1.3, 1e-4);
    EXPECT_GT(callback.summary().num_accepted, 0);
  }
}

class Aborts final : public ceres::IterationCallback {
 public:
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    return iteration.iteration < 2 ? ceres::SOLVER_CONTINUE
                                   : ceres::SOLVER_ABORT;
  }
};

// Of a solve that fails or is ended, nothing stays behind.
TEST(UpdateCallbackRules, RestoresTheProblemAfterAFailedSolve) {
  PoseAndScale p;
  const ceres::Manifold* of_pose = p.problem.GetManifold(p.pose);
  const std::vector<std::function<void(ceres::Solver::Options*)>> failures = {
      [](auto* options) {
        static Aborts aborts;
        options->callbacks.push_back(&aborts);
      },
      [](auto* options) { options->update_state_every_iteration = false; },
      [](auto* options) { options->minimizer_type = ceres::LINE_SEARCH; },
      [](auto* options) { options->max_num_iterations = -1; },
  };
  for (std::size_t i = 0; i < failures.size(); ++i) {
    SCOPED_TRACE(i);
    const std::unique_ptr<UpdateRule> rule = MakeRule("half_inverse");
    ceres::Solver::Summary summary;
    {
      UpdateCallback callback(rule.get(), &p.problem);
      ceres::Solver::Options options = SolverOptions(&callback);
      failures[i](&options);
      ceres::Solve(options, &p.problem, &summary);
      EXPECT_FALSE(summary.IsSolutionUsable()) << summary.BriefReport();
    }
    EXPECT_EQ(p.problem.GetManifold(p.pose), of_pose);
    EXPECT_EQ(p.pose[3], 1.0) << "Ceres puts the start back";
  }
  ceres::Solver::Options options = SolverOptions(nullptr);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &p.problem, &summary);
  EXPECT_LT(summary.final_cost, 1e-10);
}

// Counts the questions; never has a step.
class Declines final : public UpdateRule {
 public:
  LinearizationParts Needs() const override { return {}; }
  bool ComputeStep(const Linearization& /*at_x*/,
                   Eigen::VectorXd* /*step*/,
                   std::string* error) override {
    ++num_questions;
    *error = "never";
    return false;
  }
  int num_questions = 0;
};

// A rule that fails is asked at the accepted states 0, 3, 8, 17, 34, 51: after
// 2, 4, 8, 16 and again 16 others.
TEST(UpdateCallbackRules, ARuleThatFailsIsAskedLessAndLess) {
  TwoBlockRosenbrock p;
  Declines rule;
  UpdateCallback callback(&rule, &p.problem);
  // A small trust region makes for many accepted steps.
  ceres::Solver::Options options = SolverOptions(nullptr);
  options.initial_trust_region_radius = 1e-3;
  options.max_trust_region_radius = 1e-3;
  options.function_tolerance = 0.0;
  options.parameter_tolerance = 0.0;
  callback.AddTo(&options);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &p.problem, &summary);
  ASSERT_GT(summary.num_successful_steps, 60);
  int expected = 0;
  int wait = 2;
  for (int state = 0; state < summary.num_successful_steps; ++expected) {
    state += 1 + wait;
    wait = std::min(2 * wait, 16);
  }
  EXPECT_NEAR(rule.num_questions, expected, 1);
  EXPECT_EQ(callback.summary().message, "never");
}

}  // namespace update_callback_rules_test
}  // namespace invgrad
