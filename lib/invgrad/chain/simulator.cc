#include "invgrad/simulator.h"

#include <cmath>
#include <functional>

#include "fmt/core.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/scratch.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/stored_jacobian.h"

namespace invgrad {

bool AllFinite(const double* values, std::ptrdiff_t size) {
  bool all_finite = true;
  for (std::ptrdiff_t i = 0; i < size; ++i)
    all_finite &= std::isfinite(values[i]);
  return all_finite;
}

std::string AtTimeStep(const std::string& what,
                       std::ptrdiff_t t,
                       std::ptrdiff_t num_steps) {
  return fmt::format("{} time step {} of {}", what, t + 1, num_steps);
}

std::unique_ptr<const JacobianOperator> Simulator::Linearize(
    const double* x, const double* context, double* y) const {
  // A row-major J is a column-major J^T.
  Eigen::MatrixXd transposed(num_inputs(), num_outputs());
  if (!Evaluate(x, context, y, transposed.data())) return nullptr;
  return std::make_unique<DenseJacobian>(transposed.transpose());
}

bool Simulator::Adjoint(const double* x,
                        const double* context,
                        const Covector& covector,
                        double* y,
                        double* x_bar) const {
  const int rows = num_outputs();
  Scratch<double> jacobian(static_cast<std::size_t>(rows) * num_inputs());
  Scratch<double> w(rows);
  return Evaluate(x, context, y, jacobian.data()) && covector(y, w.data()) &&
         PullBack(jacobian.data(), w.data(), x_bar);
}

bool Simulator::PullBack(const double* jacobian,
                         const double* w,
                         double* x_bar) const {
  const int rows = num_outputs();
  const int cols = num_inputs();
  // A row-major J is a column-major J^T.
  Eigen::Map<Eigen::VectorXd>(x_bar, cols).noalias() =
      Eigen::Map<const Eigen::MatrixXd>(jacobian, cols, rows) *
      Eigen::Map<const Eigen::VectorXd>(w, rows);
  return AllFinite(x_bar, cols);
}

int Simulator::EvaluateBatch(int count,
                             const double* x,
                             const double* contexts,
                             double* y,
                             double* jacobians) const {
  const std::ptrdiff_t num_x = num_inputs();
  const std::ptrdiff_t num_y = num_outputs();
  for (int s = 0; s < count; ++s) {
    if (!Evaluate(
            x + s * num_x,
            contexts + s * num_context(),
            y + s * num_y,
            jacobians == nullptr ? nullptr : jacobians + s * num_x * num_y)) {
      return s;
    }
  }
  return count;
}

int Simulator::AdjointBatch(int count,
                            const double* x,
                            const double* contexts,
                            const BatchCovector& covector,
                            double* x_bar) const {
  const std::ptrdiff_t num_x = num_inputs();
  Scratch<double> y(num_outputs());
  int s = 0;
  const auto of_sample = [&](const double* at, double* w) {
    return covector(s, at, w);
  };
  // By reference, because std::function then does not allocate.
  const Covector sample_covector = std::cref(of_sample);
  for (; s < count; ++s) {
    if (!Adjoint(x + s * num_x,
                 contexts + s * num_context(),
                 sample_covector,
                 y.data(),
                 x_bar + s * num_x)) {
      return s;
    }
  }
  return count;
}

bool Simulator::WeightedHessian(const double* /*x*/,
                                const double* /*context*/,
                                const double* /*w*/,
                                double* /*hessian*/) const {
  LOG(FATAL) << "the simulator has no WeightedHessian; check "
                "has_weighted_hessian() first";
  return false;
}

bool Simulator::ContextJacobian(const double* /*x*/,
                                const double* /*context*/,
                                double* /*jacobian*/) const {
  LOG(FATAL) << "the simulator has no ContextJacobian; check "
                "has_context_jacobian() first";
  return false;
}

void Simulator::InversePower(double /*kappa*/,
                             double /*tau*/,
                             const double* /*d_y*/,
                             double* /*d_x*/) const {
  LOG(FATAL) << "the simulator has no InversePower; check is_linear() first";
}

bool CheckHasHessian(const Simulator& simulator, std::string* error) {
  if (simulator.has_weighted_hessian()) return true;
  *error =
      "the simulator has no second derivatives: choose a method without the "
      "exact Hessian, write the simulator as a functor "
      "(autodiff_simulator.h), or override has_weighted_hessian and "
      "WeightedHessian";
  return false;
}

std::string SimulatorFailure(const Simulator& simulator,
                             const double* x,
                             const double* context) {
  Scratch<double> y(simulator.num_outputs());
  const std::string what =
      simulator.Evaluate(x, context, y.data(), nullptr)
          ? "the simulator's value is finite, its derivative is not (an "
            "infinite slope, such as that of sqrt at 0?)"
          : "the simulator has no finite value";
  const std::string where = simulator.DescribeFailure(x, context);
  return what + (where.empty() ? "" : ": " + where);
}

}  // namespace invgrad
