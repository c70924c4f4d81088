#include "invgrad/minimize/ceres_minimizer.h"

#include <cmath>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/first_order_function.h"
#include "ceres/iteration_callback.h"
#include "ceres/problem.h"
#include "gtest/gtest.h"
#include "invgrad/methods/ceres_methods.h"
#include "tests/support/rosenbrock.h"

namespace invgrad {
namespace ceres_minimizer_test {

// Rosenbrock's function, as one function.
class RosenbrockFunction final : public ceres::FirstOrderFunction {
 public:
  bool Evaluate(const double* x,
                double* cost,
                double* gradient) const override {
    const double a = 1.0 - x[0];
    const double b = 10.0 * (x[1] - x[0] * x[0]);
    *cost = 0.5 * (a * a + b * b);
    if (gradient != nullptr) {
      gradient[0] = -a - 20.0 * x[0] * b;
      gradient[1] = 10.0 * b;
    }
    return true;
  }
  int NumParameters() const override { return 2; }
};

MinimizerOptions Patient() {
  MinimizerOptions options;
  // Steepest descent needs its time.
  options.max_num_iterations = 20000;
  options.function_tolerance = 1e-14;
  return options;
}

void ExpectConsistent(const MinimizerSummary& summary) {
  ASSERT_FALSE(summary.iterations.empty());
  EXPECT_DOUBLE_EQ(summary.initial_cost, 12.1);
  EXPECT_EQ(summary.iterations[0].iteration, 0);
  EXPECT_EQ(summary.iterations[0].cost, summary.initial_cost);
  EXPECT_EQ(summary.num_steps(), summary.iterations.back().iteration);
  EXPECT_GT(summary.total_time_in_seconds, 0.0);
}

class EveryMethod : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryMethod, SolvesRosenbrock) {
  const CeresMethodRow* row = FindCeresMethod(GetParam());
  ASSERT_NE(row, nullptr);
  EXPECT_FALSE(row->formula.empty());
  ceres::Solver::Options solver_options;
  std::string error;
  ASSERT_TRUE(row->configure({}, &solver_options, &error)) << error;
  EXPECT_EQ(solver_options.num_threads, 1);
  EXPECT_EQ(solver_options.minimizer_type == ceres::TRUST_REGION,
            row->is_trust_region);

  RosenbrockProblem p;
  MinimizerSummary summary;
  MinimizeWithCeres(Patient(), solver_options, &p.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE)
      << summary.BriefReport();
  EXPECT_NEAR(p.x[0], 1.0, 1e-3);
  EXPECT_NEAR(p.x[1], 1.0, 1e-3);
  EXPECT_LT(summary.final_cost, 1e-6);
  ExpectConsistent(summary);

  if (row->is_trust_region) return;
  Eigen::VectorXd x = Eigen::Vector2d(-1.2, 1.0);
  MinimizeWithCeres(
      Patient(), solver_options, new RosenbrockFunction, &x, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE)
      << summary.BriefReport();
  EXPECT_NEAR(x[0], 1.0, 1e-3);
  EXPECT_NEAR(x[1], 1.0, 1e-3);
  ExpectConsistent(summary);
}

TEST_P(EveryMethod, RefusesWhatItDoesNotKnow) {
  const CeresMethodRow* row = FindCeresMethod(GetParam());
  ASSERT_NE(row, nullptr);
  ceres::Solver::Options solver_options;
  std::string error;
  EXPECT_FALSE(row->configure({{"colour", "blue"}}, &solver_options, &error));
  EXPECT_NE(error.find("colour"), std::string::npos) << error;
  // Every option's default is a value that it takes.
  for (const OptionSet::Row& option : row->options()) {
    EXPECT_TRUE(row->configure(
        {{option.name, option.default_value}}, &solver_options, &error))
        << error;
  }
}

INSTANTIATE_TEST_SUITE_P(CeresMinimizer,
                         EveryMethod,
                         ::testing::Values("ceres_lm",
                                           "ceres_dogleg",
                                           "ceres_bfgs",
                                           "ceres_lbfgs",
                                           "ceres_nonlinear_cg",
                                           "ceres_steepest_descent"),
                         [](const auto& info) { return info.param; });

TEST(CeresMinimizer, Table) {
  EXPECT_EQ(CeresMethods().size(), 6u);
  EXPECT_EQ(FindCeresMethod("ceres_newton"), nullptr);
}

TEST(CeresMinimizer, SettingsArrive) {
  ceres::Solver::Options options;
  std::string error;
  ASSERT_TRUE(FindCeresMethod("ceres_lm")
                  ->configure({{"initial_trust_region_radius", "10"},
                               {"linear_solver", "cgnr"}},
                              &options,
                              &error));
  EXPECT_EQ(options.initial_trust_region_radius, 10.0);
  EXPECT_EQ(options.linear_solver_type, ceres::CGNR);
  EXPECT_EQ(options.trust_region_strategy_type, ceres::LEVENBERG_MARQUARDT);

  ASSERT_TRUE(
      FindCeresMethod("ceres_dogleg")
          ->configure({{"dogleg", "subspace_dogleg"}}, &options, &error));
  EXPECT_EQ(options.trust_region_strategy_type, ceres::DOGLEG);
  EXPECT_EQ(options.dogleg_type, ceres::SUBSPACE_DOGLEG);
  EXPECT_EQ(options.linear_solver_type, ceres::DENSE_QR);
  EXPECT_FALSE(FindCeresMethod("ceres_dogleg")
                   ->configure({{"linear_solver", "cgnr"}}, &options, &error));

  ASSERT_TRUE(FindCeresMethod("ceres_lbfgs")
                  ->configure({{"rank", "7"}}, &options, &error));
  EXPECT_EQ(options.max_lbfgs_rank, 7);
  EXPECT_EQ(options.line_search_direction_type, ceres::LBFGS);

  ASSERT_TRUE(FindCeresMethod("ceres_nonlinear_cg")
                  ->configure({{"type", "polak_ribiere"}}, &options, &error));
  EXPECT_EQ(options.nonlinear_conjugate_gradient_type, ceres::POLAK_RIBIERE);
}

// Notes what it sees; ends the run at iteration 2.
class Watcher final : public ceres::IterationCallback {
 public:
  Watcher(const double* x, std::vector<std::string>* log, std::string name)
      : x_(x), log_(log), name_(std::move(name)) {}
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    log_->push_back(name_);
    states.push_back(*x_);
    return iteration.iteration == 2 ? ceres::SOLVER_TERMINATE_SUCCESSFULLY
                                    : ceres::SOLVER_CONTINUE;
  }
  std::vector<double> states;

 private:
  const double* x_;
  std::vector<std::string>* log_;
  std::string name_;
};

TEST(CeresMinimizer, CallbacksSeeTheStateInOrder) {
  RosenbrockProblem p;
  std::vector<std::string> log;
  Watcher first(p.x, &log, "first");
  Watcher second(p.x, &log, "second");
  MinimizerOptions options;
  options.callbacks = {&first, &second};
  ceres::Solver::Options ceres_options;
  ceres_options.minimizer_type = ceres::LINE_SEARCH;
  MinimizerSummary summary;
  MinimizeWithCeres(options, ceres_options, &p.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::USER_SUCCESS);
  EXPECT_EQ(log,
            std::vector<std::string>(
                {"first", "second", "first", "second", "first"}));
  EXPECT_EQ(first.states[0], -1.2);
  EXPECT_NE(first.states[1], -1.2);
  EXPECT_EQ(first.states[2], p.x[0]);

  Eigen::VectorXd x = Eigen::Vector2d(-1.2, 1.0);
  log.clear();
  Watcher third(x.data(), &log, "third");
  options.callbacks = {&third};
  MinimizeWithCeres(
      options, ceres_options, new RosenbrockFunction, &x, &summary);
  EXPECT_EQ(summary.termination_type, ceres::USER_SUCCESS);
  EXPECT_NE(third.states[1], -1.2);
  EXPECT_EQ(third.states[2], x[0]);
}

TEST(CeresMinimizer, Budget) {
  RosenbrockProblem p;
  MinimizerOptions options;
  options.max_num_iterations = 3;
  MinimizerSummary summary;
  MinimizeWithCeres(options, ceres::Solver::Options(), &p.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::NO_CONVERGENCE);
  EXPECT_EQ(summary.num_steps(), 3);
  EXPECT_FALSE(summary.message.empty());
}

TEST(CeresMinimizer, NothingToChange) {
  RosenbrockProblem p;
  p.problem.SetParameterBlockConstant(p.x);
  MinimizerSummary summary;
  MinimizeWithCeres(
      MinimizerOptions(), ceres::Solver::Options(), &p.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  ExpectConsistent(summary);
}

// r = log x + 3 from x = 1: the first step leads to x = -2.
struct Logarithm {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    using std::log;
    r[0] = log(x[0]) + 3.0;
    return true;
  }
};

// Ends the solve at its first accepted step.
struct EndEarly final : public ceres::IterationCallback {
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    const bool is_first =
        iteration.iteration > 0 && iteration.step_is_successful;
    return is_first ? ceres::SOLVER_TERMINATE_SUCCESSFULLY
                    : ceres::SOLVER_CONTINUE;
  }
};

TEST(CeresMinimizer, ExplainsTheFirstStepOutsideTheDomain) {
  for (const bool ends_early : {false, true}) {
    double x = 1.0;
    ceres::Problem problem;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Logarithm, 1, 1>(new Logarithm),
        nullptr,
        &x);
    MinimizerOptions options;
    options.block_name = [](const double*) { return "gain"; };
    EndEarly end_early;
    if (ends_early) options.callbacks.push_back(&end_early);
    MinimizerSummary summary;
    MinimizeWithCeres(options, ceres::Solver::Options(), &problem, &summary);
    EXPECT_GT(summary.num_outside_domain, 0);
    ASSERT_TRUE(summary.first_outside_domain.has_value());
    if (!ends_early) {
      EXPECT_NEAR(x, std::exp(-3.0), 1e-9);
    }
    const DomainFailure& failure = *summary.first_outside_domain;
    ASSERT_EQ(failure.parameters.size(), 1u);
    EXPECT_EQ(failure.parameters[0].name, "gain");
    EXPECT_EQ(failure.parameters[0].was, 1.0);
    // LM's step is shorter than Gauss-Newton's by its damping, 1e-4.
    EXPECT_NEAR(failure.parameters[0].value, -2.0, 1e-3);
  }
}

}  // namespace ceres_minimizer_test
}  // namespace invgrad
