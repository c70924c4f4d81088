// A run with proposals ends where the run without them ends, or lower.

#include <cmath>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/random.h"
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"
#include "tests/ceres/callback_problems.h"
#include "tests/ceres/prepared_problem.h"
#include "tests/support/function_rule.h"
#include "tests/support/rosenbrock.h"

namespace invgrad {
namespace safeguard_test {

struct Outcome {
  ceres::Solver::Summary solver;
  UpdateCallback::Summary proposals;
};

// ceres::Solve with the options as AddTo leaves them.
Outcome Solve(UpdateRule* rule,
              ceres::Solver::Options options,
              ceres::Problem* problem,
              const UpdateCallback::Options& callback_options = {}) {
  Outcome outcome;
  UpdateCallback callback(rule, problem, callback_options);
  callback.AddTo(&options);
  ceres::Solve(options, problem, &outcome.solver);
  outcome.proposals = callback.summary();
  return outcome;
}

// y = a exp(-b t), a = 1e6, b = 1e-6: a proposal that changes b alone is short.
struct Decay {
  static constexpr double kA = 1e6;
  static constexpr double kB = 1e-6;

  template <typename T>
  bool operator()(const T* x, T* residual) const {
    using std::exp;
    residual[0] = x[0] * exp(-x[1] * t) - kA * std::exp(-kB * t);
    return true;
  }
  double t;
};

// LM alone solves all starts with Ceres' default options.
TEST(Safeguard, ParametersOfUnlikeSize) {
  for (const std::string text : {"half_inverse:step_size=auto:rho=1",
                                 "gauss_newton",
                                 "power:step_size=auto:control=gain"}) {
    NumpyRandom random(1);
    for (int start = 0; start < 20; ++start) {
      double x[2] = {Decay::kA * random.Uniform(0.3, 3.0),
                     Decay::kB * random.Uniform(0.3, 3.0)};
      ceres::Problem problem;
      for (int i = 0; i < 20; ++i) {
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Decay, 1, 2>(
                                     new Decay{0.2 * i / Decay::kB}),
                                 nullptr,
                                 x);
      }
      const Outcome outcome =
          Solve(MakeRule(text).get(), SolverOptions(nullptr), &problem);
      EXPECT_EQ(outcome.solver.termination_type, ceres::CONVERGENCE);
      EXPECT_NEAR(x[0] / Decay::kA, 1.0, 1e-3) << text << ", start " << start;
      EXPECT_NEAR(x[1] / Decay::kB, 1.0, 1e-3) << text << ", start " << start;
    }
  }
}

// r = (1e9 x - 1, y - 1e3) from (0, 1e3).
struct Unlike {
  template <typename T>
  bool operator()(const T* x, T* residual) const {
    residual[0] = 1e9 * x[0] - 1.0;
    residual[1] = x[1] - 1e3;
    return true;
  }
};

// A proposal of nine tenths of the way is within Ceres' tolerance of x, and
// within a function tolerance of 0.995 of the cost.
TEST(Safeguard, AProposalMeetsNoTolerance) {
  for (const bool is_parameter : {false, true}) {
    double x[2] = {0.0, 1e3};
    ceres::Problem problem;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Unlike, 2, 2>(new Unlike), nullptr, x);
    int num_calls = 0;
    FunctionRule rule([&](const auto&, auto* step, std::string*) {
      *step = Eigen::Vector2d(0.9e-9, 0.0);
      return ++num_calls == 1;
    });
    ceres::Solver::Options options = SolverOptions(nullptr);
    if (!is_parameter) {
      options.parameter_tolerance = 0.0;
      options.function_tolerance = 0.995;
    }
    UpdateCallback::Options callback_options;
    callback_options.compare_with_plain = false;
    const Outcome outcome = Solve(&rule, options, &problem, callback_options);
    EXPECT_EQ(outcome.proposals.num_accepted, 1);
    EXPECT_FALSE(outcome.proposals.ended_on_proposal);
    EXPECT_GE(outcome.proposals.num_ceres_steps, 1);
    EXPECT_EQ(outcome.solver.termination_type, ceres::CONVERGENCE);
    EXPECT_NEAR(x[0], 1e-9, 1e-12);
  }
}

// r = (x^2 - 1, (x - 2) / 10): minima near 1, the lower one, and near -1.
struct Wells {
  template <typename T>
  bool operator()(const T* x, T* residual) const {
    residual[0] = x[0] * x[0] - 1.0;
    residual[1] = 0.1 * (x[0] - 2.0);
    return true;
  }
};

struct TwoWells {
  explicit TwoWells(double start) : x(start) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Wells, 2, 1>(new Wells), nullptr, &x);
  }
  double x;
  ceres::Problem problem;
};

// Each tolerance of the user ends the run after the same step of Ceres as
// without a callback; that step, which Ceres alone discards, is kept.
TEST(Safeguard, TolerancesMeanWhatTheyMean) {
  const std::vector<double ceres::Solver::Options::*> tolerances = {
      &ceres::Solver::Options::function_tolerance,
      &ceres::Solver::Options::gradient_tolerance,
      &ceres::Solver::Options::parameter_tolerance};
  for (const auto tolerance : tolerances) {
    for (const double value : {1e-1, 1e-3, 1e-6}) {
      ceres::Solver::Options options = SolverOptions(nullptr);
      for (const auto other : tolerances) options.*other = 0.0;
      options.*tolerance = value;
      TwoWells plain(3.0);
      ceres::Solver::Summary plain_summary;
      ceres::Solve(options, &plain.problem, &plain_summary);
      ASSERT_EQ(plain_summary.termination_type, ceres::CONVERGENCE);

      TwoWells p(3.0);
      FunctionRule rule([](const auto&, auto*, std::string*) { return false; });
      const Outcome outcome = Solve(&rule, options, &p.problem);
      SCOPED_TRACE(plain_summary.message);
      EXPECT_EQ(outcome.solver.termination_type, ceres::CONVERGENCE);
      EXPECT_LE(outcome.solver.final_cost, plain_summary.final_cost);
      const std::size_t more =
          tolerance == &ceres::Solver::Options::gradient_tolerance ? 0 : 1;
      ASSERT_EQ(outcome.solver.iterations.size(),
                plain_summary.iterations.size() + more);
      for (std::size_t i = 0; i < plain_summary.iterations.size(); ++i) {
        EXPECT_EQ(outcome.solver.iterations[i].cost,
                  plain_summary.iterations[i].cost);
      }
    }
  }
}

// The rule leads into the wrong well, from which the cost alone shows no way.
TEST(Safeguard, AProposalIntoAWorseWellIsTakenBack) {
  for (const bool compares : {false, true}) {
    TwoWells wells(2.0);
    int num_calls = 0;
    FunctionRule rule([&](const auto&, auto* step, std::string*) {
      *step = Eigen::VectorXd::Constant(1, -3.2);
      return ++num_calls == 1;
    });
    UpdateCallback::Options options;
    options.compare_with_plain = compares;
    options.min_relative_model_decrease = -1e300;
    const Outcome outcome =
        Solve(&rule, SolverOptions(nullptr), &wells.problem, options);
    EXPECT_EQ(outcome.proposals.num_accepted, 1);
    EXPECT_EQ(outcome.solver.termination_type, ceres::CONVERGENCE);
    EXPECT_EQ(outcome.proposals.took_plain_result, compares);
    EXPECT_NEAR(wells.x, compares ? 1.0 : -1.0, 0.02);
    if (compares) {
      EXPECT_GT(outcome.proposals.num_plain_iterations, 0);
      EXPECT_NE(outcome.proposals.BriefReport().find("without proposals"),
                std::string::npos);
    }
  }
}

struct Root {
  template <typename T>
  bool operator()(const T* x, T* residual) const {
    using std::sqrt;
    residual[0] = sqrt(x[0]) - 1.0;
    return true;
  }
};

// From 9 the rule leads to 0, where the cost is lower, and J is infinite: Ceres
// would fail there. Its half is proposed.
TEST(Safeguard, AStateWithoutAFiniteJacobianIsNotProposed) {
  double x = 9.0;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Root, 1, 1>(new Root), nullptr, &x);
  int num_calls = 0;
  FunctionRule rule([&](const auto&, auto* step, std::string*) {
    *step = Eigen::VectorXd::Constant(1, -9.0);
    return ++num_calls == 1;
  });
  UpdateCallback::Options options;
  options.compare_with_plain = false;
  const Outcome outcome =
      Solve(&rule, SolverOptions(nullptr), &problem, options);
  EXPECT_EQ(outcome.solver.termination_type, ceres::CONVERGENCE);
  EXPECT_NEAR(x, 1.0, 1e-6);
  EXPECT_EQ(outcome.proposals.num_withheld, 1);
  EXPECT_EQ(outcome.proposals.num_accepted, 1);
}

// The limits on iterations and time end both solves: the result is not called
// converged, and it is not worse.
TEST(Safeguard, LimitsOfTheSolver) {
  for (const double seconds : {0.0, 1e9}) {
    ceres::Solver::Options options = SolverOptions(nullptr);
    options.max_num_iterations = 12;
    options.max_solver_time_in_seconds = seconds;
    TwoBlockRosenbrock plain;
    ceres::Solver::Summary plain_summary;
    ceres::Solve(options, &plain.problem, &plain_summary);
    TwoBlockRosenbrock p;
    FunctionRule rule([](const auto& at_x, auto* step, std::string*) {
      *step = -1e-3 * at_x.gradient;
      return true;
    });
    const Outcome outcome = Solve(&rule, options, &p.problem);
    EXPECT_EQ(plain_summary.termination_type, ceres::NO_CONVERGENCE);
    EXPECT_EQ(outcome.solver.termination_type, ceres::NO_CONVERGENCE);
    EXPECT_LE(outcome.solver.final_cost, plain_summary.final_cost);
    EXPECT_EQ(outcome.proposals.took_plain_result, seconds > 0.0);
  }
}

// A proposal that is not made changes nothing: there is nothing to compare.
TEST(Safeguard, APlainRunIsNotRepeated) {
  PoseProblem p;
  FunctionRule rule([](const auto&, auto*, std::string*) { return false; });
  const Outcome outcome = Solve(&rule, SolverOptions(nullptr), &p.problem);
  EXPECT_EQ(outcome.proposals.num_plain_iterations, 0);
}

TEST(Safeguard, ComparesIfItKnowsTheEvaluationCallback) {
  for (const bool is_known : {false, true}) {
    PreparedProblem p(20.0);
    PowerRule rule(0.5);
    UpdateCallback::Options options;
    if (is_known) options.evaluation_callback = &p;
    const Outcome outcome =
        Solve(&rule, SolverOptions(nullptr), &p.problem, options);
    EXPECT_EQ(outcome.solver.termination_type, ceres::CONVERGENCE);
    EXPECT_NEAR(p.x, std::sqrt(2.0), 1e-6);
    EXPECT_GT(outcome.proposals.num_accepted, 0);
    EXPECT_EQ(outcome.proposals.num_plain_iterations > 0, is_known);
    EXPECT_EQ(outcome.proposals.message.find("evaluation callback") ==
                  std::string::npos,
              is_known)
        << outcome.proposals.message;
  }
}

}  // namespace safeguard_test
}  // namespace invgrad
