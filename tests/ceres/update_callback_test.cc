#include "invgrad/ceres/update_callback.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "Eigen/SVD"
#include "ceres/autodiff_cost_function.h"
#include "ceres/evaluation_callback.h"
#include "ceres/local_parameterization.h"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/rotation.h"
#include "ceres/sized_cost_function.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/rules/rules.h"

namespace invgrad {
namespace update_callback_test {

using Options = UpdateCallback::Options;

// step = -eta V S^(-kappa) U^T r, s > 1e-10 s_max, with the eta that minimizes
// the linear model.
class PowerRule final : public UpdateRule {
 public:
  explicit PowerRule(double kappa) : kappa_(kappa) {}
  LinearizationParts Needs() const override {
    LinearizationParts parts;
    parts.jacobian = true;
    return parts;
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string*) override {
    ++num_calls;
    Eigen::MatrixXd J;
    at_x.jacobian->ToDense(&J);
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(
        J, Eigen::ComputeThinU | Eigen::ComputeThinV);
    Eigen::VectorXd c = svd.matrixU().transpose() * at_x.loss_gradient;
    const Eigen::VectorXd& s = svd.singularValues();
    for (int i = 0; i < c.size(); ++i) {
      c[i] = s[i] > 1e-10 * s[0] ? c[i] * std::pow(s[i], -kappa_) : 0.0;
    }
    const Eigen::VectorXd d = -(svd.matrixV() * c);
    const Eigen::VectorXd Jd = J * d;
    *step = -at_x.loss_gradient.dot(Jd) / Jd.squaredNorm() * d;
    return true;
  }
  int num_calls = 0;

 private:
  double kappa_;
};

// A rule made of a function of the linearization.
class FunctionRule final : public UpdateRule {
 public:
  using Function = std::function<bool(
      const Linearization& at_x, Eigen::VectorXd* step, std::string* error)>;
  explicit FunctionRule(Function function) : function_(std::move(function)) {}
  LinearizationParts Needs() const override {
    LinearizationParts parts;
    parts.gradient = true;
    return parts;
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) override {
    return function_(at_x, step, error);
  }

 private:
  Function function_;
};

FunctionRule FailingRule() {
  return FunctionRule([](const auto&, auto*, std::string* error) {
    *error = "no step today";
    return false;
  });
}

struct Rosenbrock {
  template <typename T>
  bool operator()(const T* x, const T* y, T* r) const {
    r[0] = 1.0 - x[0];
    r[1] = 10.0 * (y[0] - x[0] * x[0]);
    return true;
  }
};

// Rosenbrock's function in two blocks, from (-1.2, 1) to (1, 1).
struct TwoBlockRosenbrock {
  double x = -1.2;
  double y = 1.0;
  ceres::Problem problem;
  explicit TwoBlockRosenbrock(
      const ceres::Problem::Options& options = ceres::Problem::Options())
      : problem(options) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Rosenbrock, 2, 1, 1>(new Rosenbrock),
        nullptr,
        &x,
        &y);
  }
};

ceres::Solver::Options SolverOptions(UpdateCallback* callback) {
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 500;
  if (callback != nullptr) callback->AddTo(&options);
  return options;
}

TEST(UpdateCallback, PowerRulesConvergeOnRosenbrock) {
  for (const double kappa : {0.0, 0.5, 1.0}) {
    SCOPED_TRACE(kappa);
    TwoBlockRosenbrock p;
    PowerRule rule(kappa);
    UpdateCallback callback(&rule, &p.problem);
    ceres::Solver::Summary summary;
    ceres::Solve(SolverOptions(&callback), &p.problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE) << summary.message;
    EXPECT_NEAR(p.x, 1.0, 1e-6);
    EXPECT_NEAR(p.y, 1.0, 1e-6);

    const UpdateCallback::Summary counts = callback.summary();
    EXPECT_GT(counts.num_accepted, 0);
    // Every iteration but the start is somebody's. A last one, which Ceres ends
    // on a tolerance, is not among its iterations.
    const int num_iterations = static_cast<int>(summary.iterations.size()) - 1;
    EXPECT_EQ(
        counts.num_accepted + counts.num_rejected + counts.num_ceres_steps,
        num_iterations);
    EXPECT_GE(counts.num_proposed, counts.num_accepted + counts.num_rejected);
    EXPECT_LE(counts.num_proposed,
              counts.num_accepted + counts.num_rejected + 1);
    // The rule is asked at most once an accepted state.
    EXPECT_LE(rule.num_calls, summary.num_successful_steps);
    // The cost never rises.
    double cost = summary.initial_cost;
    for (const ceres::IterationSummary& iteration : summary.iterations) {
      if (!iteration.step_is_successful) continue;
      EXPECT_LE(iteration.cost, cost);
      cost = iteration.cost;
    }
  }
}

// The candidate is the rule's step and not Ceres', to the last bit.
TEST(UpdateCallback, TheCandidateIsTheRules) {
  TwoBlockRosenbrock p;
  const Eigen::Vector2d wanted(0.125, 0.25);
  FunctionRule rule([&](const auto&, auto* step, std::string*) {
    *step = wanted;
    return true;
  });
  UpdateCallback callback(&rule, &p.problem);
  ceres::Solver::Options solver_options = SolverOptions(&callback);
  solver_options.max_num_iterations = 1;
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options, &p.problem, &summary);
  const UpdateCallback::Summary counts = callback.summary();
  EXPECT_EQ(counts.num_proposed, 1);
  EXPECT_EQ(counts.num_accepted, 1);
  EXPECT_EQ(p.x, -1.2 + 0.125);
  EXPECT_EQ(p.y, 1.0 + 0.25);
}

// r = 1 / x - 1, which notes where it was evaluated.
class Pole final : public ceres::SizedCostFunction<1, 1> {
 public:
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    const double x = parameters[0][0];
    states.push_back(x);
    residuals[0] = 1.0 / x - 1.0;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      jacobians[0][0] = -1.0 / (x * x);
    }
    return true;
  }
  mutable std::vector<double> states;
};

// A step that makes things worse is halved twice, and then it is Ceres' turn.
TEST(UpdateCallback, BacksOffThenLeavesToCeres) {
  double x = 0.5;
  ceres::Problem problem;
  auto* pole = new Pole;
  problem.AddResidualBlock(pole, nullptr, &x);
  int num_asked = 0;
  FunctionRule rule([&](const auto&, auto* step, std::string* error) {
    *error = "asked once is enough";
    *step = Eigen::VectorXd::Constant(1, -0.75);
    return ++num_asked == 1;
  });
  Options options;
  options.min_relative_model_decrease = -1e300;
  UpdateCallback callback(&rule, &problem, options);
  ceres::Solver::Summary summary;
  ceres::Solve(SolverOptions(&callback), &problem, &summary);
  EXPECT_NEAR(x, 1.0, 1e-6);
  const UpdateCallback::Summary counts = callback.summary();
  EXPECT_EQ(counts.num_proposed, 3);
  EXPECT_EQ(counts.num_rejected, 3);
  EXPECT_EQ(counts.num_accepted, 0);
  EXPECT_GT(counts.num_ceres_steps, 0);
  EXPECT_EQ(counts.message, "asked once is enough");
  // Ceres' own steps go up from 0.5, the proposals down.
  std::vector<double> proposals;
  for (const double state : pole->states) {
    if (state < 0.5) proposals.push_back(state);
  }
  EXPECT_EQ(proposals, std::vector<double>({-0.25, 0.125, 0.3125}));
}

struct Offset {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0] - 10.0;
    return true;
  }
};

// From 0: +30 is rejected, +15 is accepted at scale 1/2, and the
// next proposal, -4, is taken whole.
TEST(UpdateCallback, TheScaleRecovers) {
  double x = 0.0;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Offset, 1, 1>(new Offset), nullptr, &x);
  int num_asked = 0;
  FunctionRule rule([&](const auto&, auto* step, std::string*) {
    *step = Eigen::VectorXd::Constant(1, num_asked == 0 ? 30.0 : -4.0);
    return ++num_asked <= 2;
  });
  Options options;
  options.by_merit = false;
  options.min_relative_model_decrease = -1e300;
  UpdateCallback callback(&rule, &problem, options);
  ceres::Solver::Options solver_options = SolverOptions(&callback);
  solver_options.max_num_iterations = 3;
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options, &problem, &summary);
  EXPECT_EQ(x, 11.0);
  EXPECT_EQ(callback.summary().num_accepted, 2);
  EXPECT_EQ(callback.summary().num_rejected, 1);
}

// Steps of `first`, and then of -4, that remembers what became of them.
class JudgingRule final : public UpdateRule {
 public:
  explicit JudgingRule(double first) : first_(first) {}
  LinearizationParts Needs() const override {
    LinearizationParts parts;
    parts.gradient = true;
    return parts;
  }
  bool ComputeStep(const Linearization&,
                   Eigen::VectorXd* step,
                   std::string*) override {
    *step = Eigen::VectorXd::Constant(1, num_asked_ == 0 ? first_ : -4.0);
    return ++num_asked_ <= 2;
  }
  bool JudgesSteps() const override { return true; }
  bool KeepsStep(double cost, double fraction) override {
    judged.emplace_back(cost, fraction);
    return false;  // which is not heard
  }
  std::vector<std::pair<double, double>> judged;

 private:
  double first_;
  int num_asked_ = 0;
};

// L = 1/2 (x - 10)^2 from 0. The cost of a rejected proposal is the
// candidate's; and the scale, which the rule remembers itself, is not: after
// two rejections -4 is proposed whole.
TEST(UpdateCallback, ARuleThatJudgesIsToldWhatBecameOfItsSteps) {
  double x = 0.0;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Offset, 1, 1>(new Offset), nullptr, &x);
  JudgingRule rule(60.0);
  Options options;
  options.by_merit = false;
  options.min_relative_model_decrease = -1e300;
  UpdateCallback callback(&rule, &problem, options);
  ceres::Solver::Options solver_options = SolverOptions(&callback);
  solver_options.max_num_iterations = 4;
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options, &problem, &summary);
  EXPECT_EQ(rule.judged,
            (std::vector<std::pair<double, double>>{
                {1250.0, 1.0}, {200.0, 0.5}, {12.5, 0.25}, {0.5, 1.0}}));
  EXPECT_EQ(callback.summary().num_accepted, 2);
  EXPECT_EQ(callback.summary().num_rejected, 2);
}

TEST(UpdateCallback, RulesWithControlConvergeOnRosenbrock) {
  for (const char* name :
       {"half_inverse", "gauss_newton", "levenberg_marquardt"}) {
    SCOPED_TRACE(name);
    const auto rule =
        MakeRule(std::string(name) + ":control=gain:step_size=auto:rho=1");
    TwoBlockRosenbrock p;
    UpdateCallback callback(rule.get(), &p.problem);
    ceres::Solver::Summary summary;
    ceres::Solve(SolverOptions(&callback), &p.problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE) << summary.message;
    EXPECT_NEAR(p.x, 1.0, 1e-6);
    EXPECT_NEAR(p.y, 1.0, 1e-6);
    EXPECT_GT(callback.summary().num_accepted, 0);
  }
}

// Rejections shrink Ceres' trust region. A rule that is always wrong must not
// shrink it until Ceres takes its own short steps for convergence.
TEST(UpdateCallback, AWrongRuleDoesNotStopCeres) {
  TwoBlockRosenbrock p;
  // Uphill, as far as ever, although the callback learns to take less of it.
  double length = 1.0;
  FunctionRule rule([&](const auto& at_x, auto* step, std::string*) {
    *step = length * at_x.gradient.normalized();
    length *= 8.0;
    return true;
  });
  Options options;
  options.min_relative_model_decrease = -1e300;
  UpdateCallback callback(&rule, &p.problem, options);
  ceres::Solver::Summary summary;
  ceres::Solve(SolverOptions(&callback), &p.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_NEAR(p.x, 1.0, 1e-6);
  EXPECT_NEAR(p.y, 1.0, 1e-6);
  EXPECT_GE(callback.summary().num_rejected, 3);
}

TEST(UpdateCallback, SmallPromisesAreLeftToCeres) {
  TwoBlockRosenbrock p;
  // Along the gradient, for a relative decrease of 1e-6 by the linear model.
  FunctionRule rule([](const auto& at_x, auto* step, std::string*) {
    *step = -1e-6 * at_x.cost / at_x.gradient.squaredNorm() * at_x.gradient;
    return true;
  });
  UpdateCallback callback(&rule, &p.problem);
  ceres::Solver::Summary summary;
  ceres::Solve(SolverOptions(&callback), &p.problem, &summary);
  EXPECT_NEAR(p.x, 1.0, 1e-6);
  EXPECT_EQ(callback.summary().num_proposed, 0);
  EXPECT_NE(callback.summary().message.find("too small"), std::string::npos);
}

// Two poses that see each other's points: quaternions with a manifold, plain
// blocks, a constant block, robust losses with outliers, and a residual block
// that nothing can change.
struct Sighting {
  template <typename T>
  bool operator()(const T* q, const T* t, const T* p, T* r) const {
    ceres::QuaternionRotatePoint(q, p, r);
    for (int i = 0; i < 3; ++i) r[i] += t[i] - measured[i];
    return true;
  }
  double measured[3];
};

struct Anchor {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    for (int i = 0; i < 3; ++i) r[i] = x[i] - 2.0;
    return true;
  }
};

struct PoseProblem {
  double q[4] = {0.9, 0.1, -0.3, 0.3};
  double t[3] = {0.0, 0.0, 0.0};
  double points[4][3] = {
      {1.0, 0.0, 0.5}, {0.0, 2.0, -1.0}, {-1.0, 0.5, 0.3}, {0.4, -0.6, 1.5}};
  ceres::Problem problem;

  static constexpr double kTruth[4] = {0.5, -0.5, 0.1, 0.7};
  static constexpr double kShift[3] = {0.3, -1.0, 2.0};

  explicit PoseProblem(
      const ceres::Problem::Options& options = ceres::Problem::Options(),
      ceres::Manifold* manifold = new ceres::QuaternionManifold)
      : problem(options) {
    problem.AddParameterBlock(q, 4, manifold);
    for (int k = 0; k < 4; ++k) {
      auto* sighting = new Sighting;
      ceres::QuaternionRotatePoint(kTruth, points[k], sighting->measured);
      for (int i = 0; i < 3; ++i) sighting->measured[i] += kShift[i];
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Sighting, 3, 4, 3, 3>(sighting),
          new ceres::HuberLoss(0.5),
          q,
          t,
          points[k]);
      problem.SetParameterBlockConstant(points[k]);
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Anchor, 3, 3>(new Anchor),
          new ceres::CauchyLoss(1.0),
          points[k]);
    }
    double length = 0.0;
    for (const double v : q) length += v * v;
    for (double& v : q) v /= std::sqrt(length);
  }
};

TEST(UpdateCallback, ManifoldsLossesAndConstantBlocks) {
  for (const double kappa : {0.5, 1.0}) {
    for (const int num_threads : {1, 2}) {
      PoseProblem p;
      PowerRule rule(kappa);
      UpdateCallback callback(&rule, &p.problem);
      ceres::Solver::Options options = SolverOptions(&callback);
      options.num_threads = num_threads;
      // The fixed cost of the anchors would hide the end.
      options.function_tolerance = 1e-16;
      ceres::Solver::Summary summary;
      ceres::Solve(options, &p.problem, &summary);
      EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE)
          << summary.message;
      EXPECT_GT(summary.fixed_cost, 1.0);
      for (int i = 0; i < 4; ++i) EXPECT_NEAR(p.q[i], p.kTruth[i], 1e-6);
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(p.t[i], p.kShift[i], 1e-6);
      EXPECT_GT(callback.summary().num_accepted, 0);
      EXPECT_EQ(p.points[0][0], 1.0);
    }
  }
}

TEST(UpdateCallback, OtherTrustRegions) {
  const std::vector<std::function<void(ceres::Solver::Options*)>> variants = {
      [](auto* o) { o->trust_region_strategy_type = ceres::DOGLEG; },
      [](auto* o) { o->use_inner_iterations = true; },
      [](auto* o) { o->use_nonmonotonic_steps = true; },
      [](auto* o) { o->linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY; },
  };
  for (std::size_t i = 0; i < variants.size(); ++i) {
    SCOPED_TRACE(i);
    TwoBlockRosenbrock p;
    PowerRule rule(0.5);
    UpdateCallback callback(&rule, &p.problem);
    ceres::Solver::Options options = SolverOptions(&callback);
    variants[i](&options);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &p.problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE)
        << summary.message << callback.summary().message;
    EXPECT_NEAR(p.x, 1.0, 1e-5);
    EXPECT_NEAR(p.y, 1.0, 1e-5);
  }
}

// A rule that never has a step changes nothing, to the last bit.
TEST(UpdateCallback, WithoutProposalsItIsPlainCeres) {
  PoseProblem plain;
  ceres::Solver::Summary plain_summary;
  ceres::Solve(SolverOptions(nullptr), &plain.problem, &plain_summary);

  PoseProblem p;
  FunctionRule rule = FailingRule();
  UpdateCallback callback(&rule, &p.problem);
  ceres::Solver::Summary summary;
  ceres::Solve(SolverOptions(&callback), &p.problem, &summary);
  ASSERT_EQ(summary.iterations.size(), plain_summary.iterations.size());
  for (std::size_t i = 0; i < summary.iterations.size(); ++i) {
    EXPECT_EQ(summary.iterations[i].cost, plain_summary.iterations[i].cost);
  }
  for (int i = 0; i < 4; ++i) EXPECT_EQ(p.q[i], plain.q[i]);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(p.t[i], plain.t[i]);
  const UpdateCallback::Summary counts = callback.summary();
  EXPECT_EQ(counts.num_proposed, 0);
  EXPECT_EQ(counts.num_ceres_steps,
            static_cast<int>(summary.iterations.size()) - 1);
  EXPECT_EQ(counts.message, "no step today");
}

// r = exp(x) - 2, which counts its evaluations.
class CountingExp final : public ceres::SizedCostFunction<1, 1> {
 public:
  explicit CountingExp(int* num_evaluations)
      : num_evaluations_(*num_evaluations) {}
  bool Evaluate(double const* const* x,
                double* r,
                double** jacobians) const override {
    ++num_evaluations_;
    r[0] = std::exp(x[0][0]) - 2.0;
    if (jacobians != nullptr) jacobians[0][0] = std::exp(x[0][0]);
    return true;
  }

 private:
  int& num_evaluations_;
};

// Needs nothing, and has no step.
class ContentRule final : public UpdateRule {
 public:
  LinearizationParts Needs() const override { return {}; }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd*,
                   std::string* error) override {
    EXPECT_EQ(at_x.jacobian, nullptr);
    costs.push_back(at_x.cost);
    *error = "content";
    return false;
  }
  std::vector<double> costs;
};

TEST(UpdateCallback, ARuleThatNeedsNothingIsAskedFirst) {
  int num_evaluations[2] = {0, 0};
  for (const bool has_callback : {false, true}) {
    double x = 5.0;
    ceres::Problem problem;
    problem.AddResidualBlock(
        new CountingExp(&num_evaluations[has_callback]), nullptr, &x);
    ContentRule rule;
    UpdateCallback callback(&rule, &problem);
    ceres::Solver::Summary summary;
    ceres::Solve(
        SolverOptions(has_callback ? &callback : nullptr), &problem, &summary);
    EXPECT_NEAR(x, std::log(2.0), 1e-6);
    if (!has_callback) continue;
    // At the first state and at the fourth.
    ASSERT_GE(rule.costs.size(), 2u);
    EXPECT_EQ(rule.costs[0], summary.iterations[0].cost);
    EXPECT_EQ(rule.costs[1], summary.iterations[3].cost);
  }
  EXPECT_EQ(num_evaluations[0], num_evaluations[1]);
}

// The blocks that have none of their own.
TEST(UpdateCallback, ManifoldsAreThereForItsOwnStepsOnly) {
  class Watch final : public ceres::IterationCallback {
   public:
    explicit Watch(const PoseProblem* p) : p_(*p) {}
    ceres::CallbackReturnType operator()(
        const ceres::IterationSummary&) override {
      EXPECT_TRUE(p_.problem.HasManifold(p_.q));
      has_manifold.push_back(p_.problem.HasManifold(p_.t));
      return ceres::SOLVER_CONTINUE;
    }
    std::vector<bool> has_manifold;  // p.t after each iteration

   private:
    const PoseProblem& p_;
  };
  PoseProblem p;
  PowerRule power(0.5);
  // At every other question.
  int num_questions = 0;
  class Sometimes final : public UpdateRule {
   public:
    Sometimes(PowerRule* rule, int* num_questions)
        : rule_(*rule), num_questions_(*num_questions) {}
    LinearizationParts Needs() const override { return rule_.Needs(); }
    bool ComputeStep(const Linearization& at_x,
                     Eigen::VectorXd* step,
                     std::string* error) override {
      *error = "not now";
      return num_questions_++ % 2 == 0 && rule_.ComputeStep(at_x, step, error);
    }

   private:
    PowerRule& rule_;
    int& num_questions_;
  };
  Sometimes rule(&power, &num_questions);
  UpdateCallback callback(&rule, &p.problem);
  Watch watch(&p);
  ceres::Solver::Options options = SolverOptions(&callback);
  options.callbacks.push_back(&watch);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &p.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  const auto num_staged =
      std::count(watch.has_manifold.begin(), watch.has_manifold.end(), true);
  EXPECT_EQ(num_staged, callback.summary().num_proposed);
  EXPECT_GT(num_staged, 0);
  EXPECT_GT(callback.summary().num_ceres_steps, 0);
  EXPECT_LT(power.num_calls, num_questions);
}

TEST(UpdateCallback, IsForOneSolve) {
  TwoBlockRosenbrock p;
  PowerRule rule(0.5);
  {
    UpdateCallback callback(&rule, &p.problem);
    ceres::Solver::Summary summary;
    ceres::Solve(SolverOptions(&callback), &p.problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
    p.x = -1.2;
    p.y = 1.0;
    ceres::Solve(SolverOptions(&callback), &p.problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::USER_FAILURE);
    EXPECT_NE(callback.summary().message.find("for one solve"),
              std::string::npos);
    EXPECT_EQ(p.x, -1.2);
    EXPECT_EQ(p.y, 1.0);
  }
  UpdateCallback callback(&rule, &p.problem);
  ceres::Solver::Summary summary;
  ceres::Solve(SolverOptions(&callback), &p.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_NEAR(p.x, 1.0, 1e-6);
}

TEST(UpdateCallback, RestoresManifolds) {
  for (const ceres::Ownership ownership :
       {ceres::TAKE_OWNERSHIP, ceres::DO_NOT_TAKE_OWNERSHIP}) {
    ceres::QuaternionManifold owned_here;
    ceres::Problem::Options problem_options;
    problem_options.manifold_ownership = ownership;
    ceres::Manifold* manifold = ownership == ceres::TAKE_OWNERSHIP
                                    ? new ceres::QuaternionManifold
                                    : &owned_here;
    PoseProblem p(problem_options, manifold);
    // Twice: a second callback after the first.
    for (int i = 0; i < 2; ++i) {
      PowerRule rule(0.5);
      UpdateCallback callback(&rule, &p.problem);
      EXPECT_NE(p.problem.GetManifold(p.q), manifold);
      EXPECT_TRUE(p.problem.HasManifold(p.t));
      ceres::Solver::Summary summary;
      ceres::Solve(SolverOptions(&callback), &p.problem, &summary);
    }
    EXPECT_EQ(p.problem.GetManifold(p.q), manifold);
    EXPECT_FALSE(p.problem.HasManifold(p.t));
    ceres::Solver::Summary summary;
    ceres::Solve(SolverOptions(nullptr), &p.problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  }
}

// Problems that own their manifolds and problems that do not, some of them moved
// or at the address of an earlier one. Freed memory that is used or freed again
// is found by the sanitizers.
TEST(UpdateCallback, ManifoldsAreDeletedOnce) {
  const auto solve = [](double* x, ceres::Problem* problem) {
    *x = 0.0;
    PowerRule rule(0.5);
    UpdateCallback callback(&rule, problem);
    ceres::Solver::Summary summary;
    ceres::Solve(SolverOptions(&callback), problem, &summary);
    EXPECT_NEAR(*x, 10.0, 1e-6);
    EXPECT_GT(callback.summary().num_accepted, 0);
  };
  for (int round = 0; round < 3; ++round) {
    for (const ceres::Ownership ownership :
         {ceres::TAKE_OWNERSHIP, ceres::DO_NOT_TAKE_OWNERSHIP}) {
      ceres::Problem::Options options;
      options.manifold_ownership = ownership;
      const auto new_problem = [&options](double* x) {
        auto problem = std::make_unique<ceres::Problem>(options);
        problem->AddResidualBlock(
            new ceres::AutoDiffCostFunction<Offset, 1, 1>(new Offset),
            nullptr,
            x);
        return problem;
      };
      double x = 0.0;
      double y = 0.0;
      std::unique_ptr<ceres::Problem> first = new_problem(&x);
      solve(&x, first.get());
      // The second object has the first one's manifolds, and the first object
      // becomes another problem.
      ceres::Problem second(std::move(*first));
      *first = std::move(*new_problem(&y));
      solve(&y, first.get());
      solve(&x, &second);
      solve(&y, first.get());
    }
  }
}

// However many callbacks a problem has, one after the other, they use as many
// manifolds as one.
TEST(UpdateCallback, AProblemKeepsItsWrappers) {
  TwoBlockRosenbrock p;
  PowerRule rule(0.5);
  std::vector<const ceres::Manifold*> first;
  for (int i = 0; i < 3; ++i) {
    UpdateCallback callback(&rule, &p.problem);
    const std::vector<const ceres::Manifold*> now = {
        p.problem.GetManifold(&p.x), p.problem.GetManifold(&p.y)};
    if (i == 0) first = now;
    EXPECT_EQ(now, first);
    TwoBlockRosenbrock other;
    UpdateCallback of_other(&rule, &other.problem);
    EXPECT_EQ(
        std::count(
            first.begin(), first.end(), other.problem.GetManifold(&other.x)),
        0);
  }
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

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
TEST(UpdateCallback, RestoresLocalParameterizations) {
  for (const ceres::Ownership ownership :
       {ceres::TAKE_OWNERSHIP, ceres::DO_NOT_TAKE_OWNERSHIP}) {
    ceres::QuaternionParameterization owned_here;
    ceres::Problem::Options problem_options;
    problem_options.manifold_ownership = ownership;
    problem_options.local_parameterization_ownership = ownership;
    ceres::LocalParameterization* parameterization =
        ownership == ceres::TAKE_OWNERSHIP
            ? new ceres::QuaternionParameterization
            : &owned_here;
    PoseProblem p(problem_options, nullptr);
    p.problem.SetParameterization(p.q, parameterization);
    {
      PowerRule rule(0.5);
      UpdateCallback callback(&rule, &p.problem);
      ceres::Solver::Options solver_options = SolverOptions(&callback);
      solver_options.function_tolerance = 1e-16;
      ceres::Solver::Summary summary;
      ceres::Solve(solver_options, &p.problem, &summary);
      for (int i = 0; i < 4; ++i) EXPECT_NEAR(p.q[i], p.kTruth[i], 1e-6);
      EXPECT_GT(callback.summary().num_accepted, 0);
    }
    EXPECT_EQ(p.problem.GetParameterization(p.q), parameterization);
    EXPECT_FALSE(p.problem.HasManifold(p.t));
    EXPECT_EQ(p.problem.ParameterBlockTangentSize(p.q), 3);
  }
}
#pragma GCC diagnostic pop

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
  ASSERT_EQ(options.callbacks.size(), 1u);
  EXPECT_EQ(options.callbacks[0], callback.iteration_callback());
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

TEST(UpdateCallback, RefusesBoundsAndLargeBlocks) {
  TwoBlockRosenbrock p;
  std::string error;
  EXPECT_TRUE(UpdateCallback::IsSupported(Options(), p.problem, &error));
  p.problem.SetParameterUpperBound(&p.y, 0, 2.0);
  EXPECT_FALSE(UpdateCallback::IsSupported(Options(), p.problem, &error));
  EXPECT_NE(error.find("parameter block 1"), std::string::npos) << error;
  EXPECT_NE(error.find("bounds"), std::string::npos) << error;
  PowerRule rule(1.0);
  EXPECT_DEATH(UpdateCallback(&rule, &p.problem), "bounds");
  // Bounds of a constant block do not matter.
  p.problem.SetParameterBlockConstant(&p.y);
  EXPECT_TRUE(UpdateCallback::IsSupported(Options(), p.problem, &error));

  PoseProblem pose;
  Options options;
  options.max_block_size = 3;  // a quaternion's tangent space fits exactly
  EXPECT_TRUE(UpdateCallback::IsSupported(options, pose.problem, &error));
  options.max_block_size = 2;
  EXPECT_FALSE(UpdateCallback::IsSupported(options, pose.problem, &error));
  EXPECT_NE(error.find("max_block_size"), std::string::npos) << error;
}

// A manifold whose Plus fails now and then: the proposal counts as rejected,
// and no block keeps its part of it.
class Moody final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 1; }
  int TangentSize() const override { return 1; }
  bool Plus(const double* x, const double* d, double* y) const override {
    *y = *x + *d;
    return *y < 1000.0;
  }
  bool PlusJacobian(const double*, double* J) const override {
    *J = 1.0;
    return true;
  }
  bool Minus(const double* y, const double* x, double* d) const override {
    *d = *y - *x;
    return true;
  }
  bool MinusJacobian(const double*, double* J) const override {
    *J = 1.0;
    return true;
  }
};

TEST(UpdateCallback, FailingPlus) {
  // Ceres moves the blocks in the order in which they were added.
  for (const bool fails_first : {false, true}) {
    SCOPED_TRACE(fails_first);
    double x = -1.2;
    double y = 1.0;
    ceres::Problem problem;
    if (fails_first) problem.AddParameterBlock(&y, 1);
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Rosenbrock, 2, 1, 1>(new Rosenbrock),
        nullptr,
        &x,
        &y);
    problem.SetManifold(&y, new Moody);
    int num_asked = 0;
    FunctionRule rule([&](const auto&, auto* step, std::string*) {
      *step = Eigen::Vector2d(1e4, 1e4);
      return ++num_asked == 1;
    });
    Options options;
    options.min_relative_model_decrease = -1e300;
    UpdateCallback callback(&rule, &problem, options);
    ceres::Solver::Summary summary;
    ceres::Solve(SolverOptions(&callback), &problem, &summary);
    EXPECT_EQ(callback.summary().num_rejected, 3);
    EXPECT_NEAR(x, 1.0, 1e-6);
    EXPECT_NEAR(y, 1.0, 1e-6);
  }
}

TEST(UpdateCallback, OneOfAProblemAtATime) {
  TwoBlockRosenbrock p;
  PowerRule rule(0.5);
  UpdateCallback callback(&rule, &p.problem);
  EXPECT_DEATH(UpdateCallback(&rule, &p.problem), "still exists");
}

struct FourthPower {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0] * x[0] * x[0] * x[0];
    return true;
  }
};

// Dogleg's radius, which starts at 1e4, need never be as large again.
TEST(UpdateCallback, ABadProposalDoesNotSilenceTheRule) {
  for (const auto strategy : {ceres::LEVENBERG_MARQUARDT, ceres::DOGLEG}) {
    SCOPED_TRACE(strategy);
    double x = 1.0;
    ceres::Problem problem;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<FourthPower, 1, 1>(new FourthPower),
        nullptr,
        &x);
    int num_asked = 0;
    FunctionRule rule([&](const auto& at_x, auto* step, std::string*) {
      Eigen::MatrixXd J;
      at_x.jacobian->ToDense(&J);
      *step = (num_asked++ == 0 ? 100.0 : -1.0) * at_x.loss_gradient / J(0, 0);
      return true;
    });
    Options options;
    options.by_merit = false;
    options.min_relative_model_decrease = -1e300;
    UpdateCallback callback(&rule, &problem, options);
    ceres::Solver::Options solver_options = SolverOptions(&callback);
    solver_options.trust_region_strategy_type = strategy;
    solver_options.max_num_iterations = 30;
    ceres::Solver::Summary summary;
    ceres::Solve(solver_options, &problem, &summary);
    EXPECT_EQ(callback.summary().num_rejected, 3);
    EXPECT_GT(callback.summary().num_accepted, 5);
  }
}

// Cannot be evaluated below 99.99 the first 12 times.
class Closed final : public ceres::SizedCostFunction<1, 1> {
 public:
  bool Evaluate(double const* const* x,
                double* r,
                double** jacobians) const override {
    r[0] = x[0][0] - 10.0;
    if (jacobians != nullptr && jacobians[0] != nullptr) jacobians[0][0] = 1.0;
    return x[0][0] > 99.99 || ++num_failures_ > 12;
  }

 private:
  mutable int num_failures_ = 0;
};

// Four turns are rejected, until 2^-12 of the exact step is left, which
// promises 2^-11 of the cost: less than the 1e-3 that are asked for.
TEST(UpdateCallback, TheScaleRecoversFromSmallPromises) {
  double x = 100.0;
  ceres::Problem problem;
  problem.AddResidualBlock(new Closed, nullptr, &x);
  FunctionRule rule([](const auto& at_x, auto* step, std::string*) {
    *step = -at_x.gradient;
    return true;
  });
  Options options;
  options.by_merit = false;
  UpdateCallback callback(&rule, &problem, options);
  ceres::Solver::Options solver_options = SolverOptions(&callback);
  // Ceres' own steps are short enough for 50 of them to stay above 99.99.
  solver_options.initial_trust_region_radius = 1e-6;
  solver_options.max_trust_region_radius = 1e-6;
  solver_options.function_tolerance = 0.0;
  solver_options.parameter_tolerance = 0.0;
  solver_options.max_num_iterations = 100;
  ceres::Solver::Summary summary;
  ceres::Solve(solver_options, &problem, &summary);
  EXPECT_EQ(callback.summary().num_rejected, 12);
  EXPECT_GT(callback.summary().num_accepted, 3);
  EXPECT_NEAR(x, 10.0, 1e-9);
}

// Cost functions that read what the problem's evaluation callback prepared.
struct Doubled final : public ceres::EvaluationCallback {
  void PrepareForEvaluation(bool, bool) override { value = 2.0 * *x; }
  const double* x = nullptr;
  double value = 0.0;
};

class PreparedCost final : public ceres::SizedCostFunction<1, 1> {
 public:
  explicit PreparedCost(const Doubled* prepared) : prepared_(prepared) {}
  bool Evaluate(double const* const*,
                double* residuals,
                double** jacobians) const override {
    const double v = prepared_->value;
    residuals[0] = std::exp(v) - 3.0;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      jacobians[0][0] = 2.0 * std::exp(v);
    }
    return true;
  }

 private:
  const Doubled* prepared_;
};

TEST(UpdateCallback, EvaluationCallback) {
  double x = 2.0;
  Doubled prepared;
  prepared.x = &x;
  ceres::Problem::Options problem_options;
  problem_options.evaluation_callback = &prepared;
  ceres::Problem problem(problem_options);
  problem.AddResidualBlock(new PreparedCost(&prepared), nullptr, &x);
  PowerRule rule(0.5);
  UpdateCallback callback(&rule, &problem);
  ceres::Solver::Summary summary;
  ceres::Solve(SolverOptions(&callback), &problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE)
      << callback.summary().message;
  EXPECT_NEAR(x, 0.5 * std::log(3.0), 1e-6);
  EXPECT_GT(callback.summary().num_accepted, 0);
}

}  // namespace update_callback_test
}  // namespace invgrad
