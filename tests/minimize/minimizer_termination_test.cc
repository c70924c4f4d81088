// How a minimization ends, and who is told on the way.

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "ceres/iteration_callback.h"
#include "gtest/gtest.h"
#include "invgrad/minimize.h"
#include "invgrad/rules.h"
#include "tests/minimize/parabola.h"
#include "tests/support/function_rule.h"

namespace invgrad {
namespace minimizer_termination_test {

TEST(Minimizer, GradientTolerance) {
  Line line;
  line.Add(1.0, 0.0);  // the gradient is x
  MinimizerOptions options = NoTolerances(100);
  options.gradient_tolerance = 0.75;  // reached exactly, by halving
  FunctionRule rule = GradientDescent(0.5);
  MinimizerSummary summary;
  Minimize(options, &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(line.x, 0.75);
  EXPECT_NE(summary.message.find("Gradient tolerance"), std::string::npos);

  // At the start there is nothing to do.
  Minimize(options, &rule, &line.problem, &summary);
  EXPECT_EQ(summary.num_steps(), 0);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
}

TEST(Minimizer, FunctionTolerance) {
  Line line;
  line.Add(1.0, 0.0);
  FunctionRule rule = GradientDescent(0.5);
  MinimizerSummary summary;
  MinimizerOptions options = NoTolerances(7);
  // A step takes three quarters of the cost.
  options.function_tolerance = 0.74;
  Minimize(options, &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::NO_CONVERGENCE);
  EXPECT_EQ(summary.num_steps(), 7);
  options.function_tolerance = 0.75;
  Minimize(options, &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(summary.num_steps(), 1);
  EXPECT_NE(summary.message.find("Function tolerance"), std::string::npos);
}

TEST(Minimizer, ParameterTolerance) {
  Line line;
  line.Add(1.0, 0.0);
  FunctionRule rule = GradientDescent(0.5);
  MinimizerSummary summary;
  MinimizerOptions options = NoTolerances(7);
  options.parameter_tolerance = 0.4;  // |step| = |x| / 2 until |x| <= 1.6
  Minimize(options, &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(summary.num_steps(), 2);
  EXPECT_NE(summary.message.find("Parameter tolerance"), std::string::npos);
}

// sqrt(x) + 1, which has no value for x < 0.
struct Root {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    using std::sqrt;
    if (!(x[0] > 0.0)) return false;
    r[0] = sqrt(x[0]) + 1.0;
    return true;
  }
};

TEST(Minimizer, WithoutAFiniteTrialARuleHasNotConverged) {
  for (const std::string rule : {"geodesic", "ssbroyden"}) {
    double x = 1e-60;  // every trial is longer
    ceres::Problem problem;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Root, 1, 1>(new Root), nullptr, &x);
    MinimizerSummary summary;
    Minimize(MinimizerOptions(), MakeRule(rule).get(), &problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::NO_CONVERGENCE) << rule;
    EXPECT_EQ(summary.message.find("The rule has found no step"), 0u)
        << summary.message;
    EXPECT_EQ(x, 1e-60);
  }
}

// Where trials have values and none is lower, this is a minimum up to rounding.
TEST(Minimizer, WithFiniteTrialsAZeroStepIsConvergence) {
  Line line;
  line.Add(1.0, 0.0);
  LinearizationParts needs = LinearizationParts::Gradient();
  needs.after = true;
  FunctionRule rule(
      needs, [](const Linearization& at_x, auto* step, std::string* error) {
        Linearization after;
        step->setZero(1);
        return at_x.after(*step, LinearizationParts(), &after, error);
      });
  MinimizerSummary summary;
  Minimize(MinimizerOptions(), &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE) << summary.message;
}

TEST(Minimizer, TimeBudget) {
  Line line;
  line.Add(1.0, 0.0);
  FunctionRule rule = GradientDescent(0.5);
  MinimizerSummary summary;
  MinimizerOptions options;
  options.max_time_in_seconds = 0.0;
  Minimize(options, &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::NO_CONVERGENCE);
  EXPECT_EQ(summary.num_steps(), 0);
  EXPECT_NE(summary.message.find("time"), std::string::npos);
}

// A factorization of 4000 unknowns takes 7e11 operations, about 70 s: with less
// time it does not begin.
TEST(Minimizer, AStepThatTakesLongerThanTheBudgetIsNotMade) {
  for (const double seconds : {50.0, 1000.0}) {
    std::vector<double> x(4000, 1.0);
    ceres::Problem problem;
    for (double& value : x) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Offset, 1, 1>(new Offset{1.0, 0.0}),
          nullptr,
          &value);
    }
    LinearizationParts needs = LinearizationParts::Gradient();
    needs.factorization = true;
    FunctionRule rule(needs, [](const auto& at_x, auto* step, std::string*) {
      *step = -0.5 * at_x.gradient;
      return true;
    });
    MinimizerSummary summary;
    MinimizerOptions options = NoTolerances(1);
    options.max_time_in_seconds = seconds;
    Minimize(options, &rule, &problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::NO_CONVERGENCE);
    EXPECT_EQ(summary.num_steps(), seconds > 100.0 ? 1 : 0);
    EXPECT_EQ(summary.message.find("The next step takes about 70 s") !=
                  std::string::npos,
              seconds < 100.0)
        << summary.message;
  }
}

TEST(Minimizer, ProgressIsTheShareOfTheBudget) {
  Line line;
  line.Add(1.0, 0.0);
  std::vector<double> progress;
  FunctionRule rule([&](const auto& at_x, auto* step, std::string*) {
    progress.push_back(at_x.progress);
    *step = -0.5 * at_x.gradient;
    return true;
  });
  MinimizerSummary summary;
  Minimize(NoTolerances(4), &rule, &line.problem, &summary);
  // Exactly so, whatever the clock says.
  EXPECT_EQ(progress, std::vector<double>({0.0, 0.25, 0.5, 0.75}));

  progress.clear();
  MinimizerOptions options = NoTolerances(4);
  options.max_time_in_seconds = 100.0;
  Minimize(options, &rule, &line.problem, &summary);
  ASSERT_EQ(progress.size(), 4u);
  EXPECT_GT(progress[0], 0.0);
}

// Notes what it is shown and says `answer` at iteration `when`.
class Watcher final : public ceres::IterationCallback {
 public:
  Watcher(const double* x, int when, ceres::CallbackReturnType answer)
      : x_(x), when_(when), answer_(answer) {}
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    states.push_back(*x_);
    return iteration.iteration == when_ ? answer_ : ceres::SOLVER_CONTINUE;
  }
  std::vector<double> states;

 private:
  const double* x_;
  int when_;
  ceres::CallbackReturnType answer_;
};

TEST(Minimizer, CallbacksSeeEveryState) {
  Line line;
  line.Add(1.0, 0.0);
  FunctionRule rule = GradientDescent(0.5);
  Watcher continues(&line.x, 2, ceres::SOLVER_CONTINUE);
  Watcher aborts(&line.x, 2, ceres::SOLVER_ABORT);
  Watcher never_asked(&line.x, 0, ceres::SOLVER_CONTINUE);
  MinimizerOptions options = NoTolerances(10);
  options.callbacks = {&continues, &aborts, &never_asked};
  MinimizerSummary summary;
  Minimize(options, &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::USER_FAILURE);
  EXPECT_EQ(continues.states, std::vector<double>({3.0, 1.5, 0.75}));
  EXPECT_EQ(never_asked.states, std::vector<double>({3.0, 1.5}));
  EXPECT_EQ(line.x, 0.75);
  EXPECT_EQ(summary.num_steps(), 2);

  Watcher is_content(&line.x, 0, ceres::SOLVER_TERMINATE_SUCCESSFULLY);
  options.callbacks = {&is_content};
  Minimize(options, &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::USER_SUCCESS);
  EXPECT_EQ(summary.num_steps(), 0);
  EXPECT_EQ(line.x, 0.75);
}

// L = x^2 / 2, x_{k+1} = -1e100 x_k: the residual stays finite for three steps,
// its square only for one.
TEST(Minimizer, DivergenceEndsAtTheLastFiniteState) {
  Line line;
  line.Add(1.0, 0.0);
  FunctionRule rule = GradientDescent(1e100);
  MinimizerSummary summary;
  Minimize(NoTolerances(10), &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::FAILURE);
  EXPECT_EQ(summary.message,
            "iteration 2: residual block 0: the cost is not finite");
  EXPECT_DOUBLE_EQ(line.x, -3e100);
  EXPECT_DOUBLE_EQ(summary.final_cost, 4.5e200);
  EXPECT_EQ(summary.num_steps(), 1);
  EXPECT_TRUE(summary.iterations[1].step_is_nonmonotonic);
}

TEST(Minimizer, RuleFails) {
  for (const bool returns_nan : {false, true}) {
    Line line;
    line.Add(1.0, 0.0);
    FunctionRule rule([&](const auto& at_x, auto* step, std::string* error) {
      *step = std::nan("") * at_x.gradient;
      *error = "singular";
      return returns_nan;
    });
    MinimizerSummary summary;
    Minimize(MinimizerOptions(), &rule, &line.problem, &summary);
    EXPECT_EQ(summary.termination_type, ceres::FAILURE);
    EXPECT_EQ(summary.message,
              returns_nan ? "iteration 1: the step is not finite"
                          : "iteration 1: singular");
    EXPECT_EQ(line.x, 3.0);
    EXPECT_EQ(summary.final_cost, 4.5);
  }
}

TEST(Minimizer, BadStart) {
  Line line;
  line.x = std::numeric_limits<double>::infinity();
  line.Add(1.0, 0.0);
  FunctionRule rule = GradientDescent(0.5);
  MinimizerSummary summary;
  Minimize(MinimizerOptions(), &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::FAILURE);
  EXPECT_EQ(summary.num_steps(), 0);
  EXPECT_TRUE(summary.iterations.empty());
  EXPECT_NE(summary.message.find("residual block 0"), std::string::npos);
}

// Nothing projects after a step.
TEST(Minimizer, BoundsAreRefused) {
  Line line;
  line.Add(1.0, 0.0);
  line.problem.SetParameterLowerBound(&line.x, 0, 1.0);
  FunctionRule rule = GradientDescent(0.5);
  MinimizerSummary summary;
  Minimize(MinimizerOptions(), &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::FAILURE);
  EXPECT_EQ(summary.message.find("no start: the problem has bounds"), 0u)
      << summary.message;
  EXPECT_EQ(line.x, 3.0);
}

TEST(Minimizer, NothingToChange) {
  Line line;
  line.Add(1.0, 0.0);
  line.problem.SetParameterBlockConstant(&line.x);
  FunctionRule rule = GaussNewton();
  MinimizerSummary summary;
  Minimize(MinimizerOptions(), &rule, &line.problem, &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(summary.final_cost, 4.5);
}

}  // namespace minimizer_termination_test
}  // namespace invgrad
