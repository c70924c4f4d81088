#include "invgrad/chain/numerical_inverse.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "ceres/tiny_solver.h"
#include "glog/logging.h"
#include "invgrad/chain/scratch.h"

namespace invgrad {
namespace {

using Eigen::Map;
using Eigen::VectorXd;

// r(x) = (P(x) - y) / scale, for TinySolver. Where P has no value r is NaN,
// which TinySolver takes for a rejected step.
class ScaledResidual {
 public:
  using Scalar = double;
  enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = Eigen::Dynamic };

  ScaledResidual(const Simulator* simulator,
                 const double* context,
                 const InverseSimulator::ConstVectorRef& y)
      : simulator_(*simulator), context_(context), y_(y) {}

  void set_scale(double scale) { scale_ = scale; }

  int NumResiduals() const { return simulator_.num_outputs(); }
  int NumParameters() const { return simulator_.num_inputs(); }

  bool operator()(const double* x, double* residuals, double* jacobian) const {
    const Eigen::Index m = NumResiduals();
    const Eigen::Index n = NumParameters();
    Map<VectorXd> r(residuals, m);
    Scratch<double> by_rows(jacobian == nullptr ? 0 : m * n);
    if (!simulator_.Evaluate(x,
                             context_,
                             residuals,
                             jacobian == nullptr ? nullptr : by_rows.data())) {
      r.setConstant(std::numeric_limits<double>::quiet_NaN());
      return false;
    }
    r = (r - y_) / scale_;
    if (jacobian != nullptr) {
      Map<Eigen::MatrixXd>(jacobian, m, n) =
          Map<const Eigen::MatrixXd>(by_rows.data(), n, m).transpose() / scale_;
    }
    return true;
  }

 private:
  const Simulator& simulator_;
  const double* context_;
  const InverseSimulator::ConstVectorRef y_;
  double scale_ = 1.0;
};

}  // namespace

NumericalInverse::NumericalInverse(std::shared_ptr<const Simulator> simulator,
                                   const Options& options)
    : simulator_(std::move(simulator)), options_(options) {
  CHECK(simulator_ != nullptr);
  CHECK_GE(options.max_num_iterations, 1);
  CHECK_GT(options.tolerance, 0.0);
}

bool NumericalInverse::Invert(const ConstVectorRef& y,
                              const ConstVectorRef& x0,
                              const ConstVectorRef& context,
                              VectorXd* x,
                              std::string* why) const {
  CHECK_EQ(y.size(), simulator_->num_outputs());
  CHECK_EQ(x0.size(), simulator_->num_inputs());
  CHECK_EQ(context.size(), simulator_->num_context());
  ScaledResidual residual(simulator_.get(), context.data(), y);
  VectorXd r(y.size());
  if (!residual(x0.data(), r.data(), nullptr)) {
    *why = "the simulator has no finite value at x_0";
    return false;
  }
  *x = x0;
  const double distance = r.stableNorm();
  if (distance == 0.0) return true;
  if (!std::isfinite(distance)) {
    *why = "the wanted output is not finite";
    return false;
  }
  residual.set_scale(distance);
  ceres::TinySolver<ScaledResidual> solver;
  solver.options.max_num_iterations = options_.max_num_iterations;
  // Quadratic convergence: what is left beyond the tolerance costs an
  // iteration.
  const double target = std::min(options_.tolerance, 1e-3) * 1e-3;
  solver.options.cost_threshold = 0.5 * target * target;
  solver.options.gradient_tolerance = 1e-14;
  solver.options.parameter_tolerance = 1e-14;
  solver.options.function_tolerance = 1e-3 * solver.options.cost_threshold;
  solver.Solve(residual, x);
  // The summary does not tell of what failed inside.
  const bool has_value = residual(x->data(), r.data(), nullptr);
  const double left = has_value ? r.stableNorm() : 1.0;
  if (has_value && left <= options_.tolerance) return true;
  *why = "the numerical inverse came " + std::to_string(100.0 * (1.0 - left)) +
         " % of the way in " + std::to_string(solver.summary.iterations) +
         " iterations";
  return false;
}

}  // namespace invgrad
