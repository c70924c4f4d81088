#include "invgrad/inverse/descents.h"

#include <cmath>
#include <limits>

#include "ceres/first_order_function.h"
#include "ceres/gradient_problem.h"
#include "ceres/gradient_problem_solver.h"
#include "fmt/core.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

using Eigen::Map;
using Eigen::VectorXd;

// F at x, and J^T of its negative gradient.
bool PullDescentBack(const Simulator& simulator,
                     const double* context,
                     const OutputFunction& function,
                     const double* x,
                     double* F,
                     double* x_bar) {
  VectorXd y(simulator.num_outputs());
  const auto covector = [&](const double* at, double* w) {
    return function(at, F, w);
  };
  return simulator.Adjoint(x, context, covector, y.data(), x_bar) &&
         std::isfinite(*F);
}

// F(P(x)) / scale for Ceres; keeps the best x.
class Descended final : public ceres::FirstOrderFunction {
 public:
  struct Best {
    VectorXd x;
    double cost = std::numeric_limits<double>::infinity();
  };

  Descended(const Simulator* simulator,
            const double* context,
            const OutputFunction* function,
            double scale,
            Best* best)
      : simulator_(*simulator),
        context_(context),
        function_(*function),
        scale_(scale),
        best_(best) {}

  int NumParameters() const override { return simulator_.num_inputs(); }

  bool Evaluate(const double* x,
                double* cost,
                double* gradient) const override {
    const bool has_value =
        gradient == nullptr
            ? Value(x, cost)
            : PullDescentBack(
                  simulator_, context_, function_, x, cost, gradient);
    if (!has_value) return false;
    *cost /= scale_;
    if (gradient != nullptr) {
      Map<VectorXd>(gradient, NumParameters()) /= -scale_;
    }
    if (*cost < best_->cost) {
      best_->x = Map<const VectorXd>(x, NumParameters());
      best_->cost = *cost;
    }
    return true;
  }

 private:
  bool Value(const double* x, double* F) const {
    VectorXd y(simulator_.num_outputs());
    VectorXd ignored(y.size());
    return simulator_.Evaluate(x, context_, y.data(), nullptr) &&
           function_(y.data(), F, ignored.data()) && std::isfinite(*F);
  }

  const Simulator& simulator_;
  const double* context_;
  const OutputFunction& function_;
  const double scale_;
  Best* best_;
};

constexpr char kNoStart[] =
    "the simulator or the function to lower has no finite value at x";

}  // namespace

bool DescendByGradient(const Simulator& simulator,
                       const double* context,
                       const OutputFunction& function,
                       const GradientDescentOptions& options,
                       VectorXd* x,
                       std::string* why) {
  CHECK_GE(options.num_steps, 1);
  CHECK_GT(options.step_size, 0.0);
  const VectorXd start = *x;
  VectorXd step(x->size());
  double first_length = 0.0;
  for (int k = 0; k < options.num_steps; ++k) {
    double F = 0.0;
    if (!PullDescentBack(
            simulator, context, function, x->data(), &F, step.data())) {
      *why = k == 0 ? kNoStart
                    : fmt::format(
                          "gradient descent: no finite value after {} "
                          "steps of size {:.6g}",
                          k,
                          options.step_size);
      return false;
    }
    step *= options.step_size;
    if (k == 0) first_length = step.stableNorm();
    *x += step;
  }
  const double length = (*x - start).stableNorm();
  if (options.rescale && length > 0.0) {
    *x = start + (*x - start) * (first_length / length);
  }
  return true;
}

bool DescendByLbfgs(const Simulator& simulator,
                    const double* context,
                    const OutputFunction& function,
                    const LbfgsOptions& options,
                    VectorXd* x,
                    std::string* why) {
  CHECK_GE(options.max_num_iterations, 1);
  CHECK_GE(options.tolerance, 0.0);
  double F = 0.0;
  VectorXd x_bar(x->size());
  if (!PullDescentBack(
          simulator, context, function, x->data(), &F, x_bar.data())) {
    *why = kNoStart;
    return false;
  }
  // The tolerances of Ceres are absolute in part.
  const double scale = x_bar.lpNorm<Eigen::Infinity>();
  if (scale == 0.0) return true;
  Descended::Best best;
  // Owns the function.
  const ceres::GradientProblem problem(
      new Descended(&simulator, context, &function, scale, &best));
  ceres::GradientProblemSolver::Options solver_options;
  solver_options.max_num_iterations = options.max_num_iterations;
  solver_options.function_tolerance = options.tolerance;
  solver_options.gradient_tolerance = options.tolerance;
  solver_options.parameter_tolerance = 0.0;
  solver_options.logging_type = ceres::SILENT;
  ceres::GradientProblemSolver::Summary summary;
  VectorXd solution = *x;
  ceres::Solve(solver_options, problem, solution.data(), &summary);
  // Not the solution, which the solver drops if a line search fails.
  if (!(best.cost < F / scale)) {
    *why = "L-BFGS found no smaller value: " + summary.message;
    return false;
  }
  *x = best.x;
  return true;
}

}  // namespace invgrad
