#include "invgrad/inverse/descent_inverses.h"

#include <cmath>
#include <limits>
#include <utility>

#include "ceres/first_order_function.h"
#include "ceres/gradient_problem.h"
#include "ceres/gradient_problem_solver.h"
#include "fmt/core.h"
#include "glog/logging.h"

namespace invgrad {
namespace {

using Eigen::Map;
using Eigen::VectorXd;
using ConstVectorRef = InverseSimulator::ConstVectorRef;

// P at x, and J^T (wanted - P). Returns false without a finite value.
bool PullResidualBack(const Simulator& simulator,
                      const ConstVectorRef& wanted,
                      const double* context,
                      const double* x,
                      VectorXd* y,
                      double* x_bar) {
  const auto covector = [&](const double* at, double* w) {
    Map<VectorXd>(w, wanted.size()) =
        wanted - Map<const VectorXd>(at, wanted.size());
    return true;
  };
  return simulator.Adjoint(x, context, covector, y->data(), x_bar);
}

// F / scale^2 for Ceres; keeps the best x.
class Distance final : public ceres::FirstOrderFunction {
 public:
  struct Best {
    VectorXd x;
    double cost = std::numeric_limits<double>::infinity();
  };

  Distance(const Simulator* simulator,
           const ConstVectorRef& wanted,
           const double* context,
           double scale,
           Best* best)
      : simulator_(*simulator),
        wanted_(wanted),
        context_(context),
        scale_(scale),
        best_(best) {}

  int NumParameters() const override { return simulator_.num_inputs(); }

  bool Evaluate(const double* x,
                double* cost,
                double* gradient) const override {
    VectorXd y(wanted_.size());
    const bool has_value =
        gradient == nullptr
            ? simulator_.Evaluate(x, context_, y.data(), nullptr)
            : PullResidualBack(simulator_, wanted_, context_, x, &y, gradient);
    if (!has_value) return false;
    *cost = 0.5 * ((y - wanted_) / scale_).squaredNorm();
    if (gradient != nullptr) {
      Map<VectorXd>(gradient, NumParameters()) /= -scale_ * scale_;
    }
    if (*cost < best_->cost) {
      best_->x = Map<const VectorXd>(x, NumParameters());
      best_->cost = *cost;
    }
    return std::isfinite(*cost);
  }

 private:
  const Simulator& simulator_;
  const VectorXd wanted_;
  const double* context_;
  const double scale_;
  Best* best_;
};

constexpr char kNoStart[] = "the simulator has no finite value at x_now";

}  // namespace

GradientDescentInverse::GradientDescentInverse(
    std::shared_ptr<const Simulator> simulator, const Options& options)
    : simulator_(std::move(simulator)), options_(options) {
  CHECK(simulator_ != nullptr);
  CHECK_GE(options.num_steps, 1);
  CHECK_GT(options.step_size, 0.0);
}

bool GradientDescentInverse::Invert(const ConstVectorRef& y,
                                    const ConstVectorRef& x_now,
                                    const ConstVectorRef& context,
                                    VectorXd* x,
                                    std::string* why) const {
  *x = x_now;
  VectorXd y_at_x(simulator_->num_outputs());
  VectorXd step(simulator_->num_inputs());
  double first_length = 0.0;
  for (int k = 0; k < options_.num_steps; ++k) {
    if (!PullResidualBack(
            *simulator_, y, context.data(), x->data(), &y_at_x, step.data())) {
      *why = k == 0 ? kNoStart
                    : fmt::format(
                          "gradient descent: the simulator has no "
                          "finite value after {} steps of {:.6g}",
                          k,
                          options_.step_size);
      return false;
    }
    step *= options_.step_size;
    if (k == 0) first_length = step.stableNorm();
    *x += step;
  }
  const double length = (*x - x_now).stableNorm();
  if (options_.rescale && length > 0.0) {
    *x = x_now + (*x - x_now) * (first_length / length);
  }
  return true;
}

LbfgsInverse::LbfgsInverse(std::shared_ptr<const Simulator> simulator,
                           const Options& options)
    : simulator_(std::move(simulator)), options_(options) {
  CHECK(simulator_ != nullptr);
  CHECK_GE(options.max_num_iterations, 1);
  CHECK_GE(options.tolerance, 0.0);
}

bool LbfgsInverse::Invert(const ConstVectorRef& y,
                          const ConstVectorRef& x_now,
                          const ConstVectorRef& context,
                          VectorXd* x,
                          std::string* why) const {
  *x = x_now;
  VectorXd y_now(simulator_->num_outputs());
  VectorXd x_bar(simulator_->num_inputs());
  if (!PullResidualBack(
          *simulator_, y, context.data(), x_now.data(), &y_now, x_bar.data())) {
    *why = kNoStart;
    return false;
  }
  const double scale = (y - y_now).stableNorm();
  const double slope = x_bar.lpNorm<Eigen::Infinity>();
  if (scale == 0.0 || slope == 0.0) return true;
  if (!std::isfinite(scale)) {
    *why = "the wanted output is not finite";
    return false;
  }
  Distance::Best best;
  // Owns the function.
  const ceres::GradientProblem problem(
      new Distance(simulator_.get(), y, context.data(), scale, &best));
  ceres::GradientProblemSolver::Options options;
  options.max_num_iterations = options_.max_num_iterations;
  options.function_tolerance = options_.tolerance;
  options.gradient_tolerance = options_.tolerance * slope / (scale * scale);
  options.parameter_tolerance = 0.0;
  options.logging_type = ceres::SILENT;
  ceres::GradientProblemSolver::Summary summary;
  VectorXd solution = x_now;
  ceres::Solve(options, problem, solution.data(), &summary);
  // The solver drops what it has found if a line search fails.
  if (!(best.cost < 0.5)) {
    *why = "L-BFGS came no nearer: " + summary.message;
    return false;
  }
  *x = best.x;
  return true;
}

}  // namespace invgrad
