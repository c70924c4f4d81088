#include "bin/support/counted_simulator.h"

#include <algorithm>
#include <utility>

#include "glog/logging.h"

namespace invgrad {

using Eigen::VectorXd;

CountedSimulator::CountedSimulator(std::shared_ptr<const Simulator> inner)
    : inner_(std::move(inner)),
      num_calls_(std::make_shared<std::atomic<long>>(0)) {
  CHECK(!inner_->forms_jacobian());
}

bool CountedSimulator::Evaluate(const double* x,
                                const double* context,
                                double* y,
                                double* jacobian) const {
  *num_calls_ += 1;
  if (jacobian != nullptr) {
    *num_calls_ += std::min(num_inputs(), num_outputs());
  }
  return inner_->Evaluate(x, context, y, jacobian);
}

std::unique_ptr<const JacobianOperator> CountedSimulator::Linearize(
    const double* x, const double* context, double* y) const {
  *num_calls_ += 1;
  const std::shared_ptr<const JacobianOperator> J =
      inner_->Linearize(x, context, y);
  if (J == nullptr) return nullptr;
  return std::make_unique<FunctionJacobian>(
      J->rows(),
      J->cols(),
      [J, num_calls = num_calls_](const VectorXd& v, VectorXd* Jv) {
        *num_calls += 1;
        J->Times(v, Jv);
      },
      [J, num_calls = num_calls_](const VectorXd& w, VectorXd* Jtw) {
        *num_calls += 1;
        J->TransposeTimes(w, Jtw);
      });
}

bool CountedSimulator::Adjoint(const double* x,
                               const double* context,
                               const Covector& covector,
                               double* y,
                               double* x_bar) const {
  *num_calls_ += 2;
  return inner_->Adjoint(x, context, covector, y, x_bar);
}

bool CountedSimulator::WeightedHessian(const double* x,
                                       const double* context,
                                       const double* w,
                                       double* hessian) const {
  *num_calls_ += 1;
  return inner_->WeightedHessian(x, context, w, hessian);
}

void CountedSimulator::InversePower(double kappa,
                                    double tau,
                                    const double* d_y,
                                    double* d_x) const {
  *num_calls_ += 1;
  inner_->InversePower(kappa, tau, d_y, d_x);
}

}  // namespace invgrad
