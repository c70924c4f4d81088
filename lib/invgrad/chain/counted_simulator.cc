#include "invgrad/chain/counted_simulator.h"

#include <algorithm>
#include <utility>

#include "invgrad/internal/feedback.h"

namespace invgrad {

using Eigen::VectorXd;

CountedSimulator::CountedSimulator(std::shared_ptr<const Simulator> inner)
    : inner_(std::move(inner)),
      num_calls_(std::make_shared<std::atomic<long>>(0)) {}

int CountedSimulator::NumCalls(bool forms_jacobian) const {
  return 1 + (forms_jacobian ? std::min(num_inputs(), num_outputs()) : 0);
}

bool CountedSimulator::Evaluate(const double* x,
                                const double* context,
                                double* y,
                                double* jacobian) const {
  *num_calls_ += NumCalls(jacobian != nullptr);
  return inner_->Evaluate(x, context, y, jacobian);
}

std::unique_ptr<const JacobianOperator> CountedSimulator::Linearize(
    const double* x, const double* context, double* y) const {
  *num_calls_ += NumCalls(forms_jacobian());
  if (forms_jacobian()) return inner_->Linearize(x, context, y);
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

int CountedSimulator::EvaluateBatch(int count,
                                    const double* x,
                                    const double* contexts,
                                    double* y,
                                    double* jacobians) const {
  *num_calls_ += long{count} * NumCalls(jacobians != nullptr);
  return inner_->EvaluateBatch(count, x, contexts, y, jacobians);
}

int CountedSimulator::AdjointBatch(int count,
                                   const double* x,
                                   const double* contexts,
                                   const BatchCovector& covector,
                                   double* x_bar) const {
  *num_calls_ += 2L * count;
  return inner_->AdjointBatch(count, x, contexts, covector, x_bar);
}

bool CountedSimulator::WeightedHessian(const double* x,
                                       const double* context,
                                       const double* w,
                                       double* hessian) const {
  *num_calls_ += 1;
  return inner_->WeightedHessian(x, context, w, hessian);
}

bool CountedSimulator::ContextJacobian(const double* x,
                                       const double* context,
                                       double* jacobian) const {
  *num_calls_ += 1;
  return inner_->ContextJacobian(x, context, jacobian);
}

void CountedSimulator::InversePower(double kappa,
                                    double tau,
                                    const double* d_y,
                                    double* d_x) const {
  *num_calls_ += 1;
  inner_->InversePower(kappa, tau, d_y, d_x);
}

Model WithSimulator(const Model& model,
                    std::shared_ptr<const CountedSimulator> simulator) {
  // The loop over time is the model's own, which its copy keeps.
  const auto owner = std::make_shared<const Model>(model);
  return Model(model.shared_network(),
               std::move(simulator),
               model.shared_loss(),
               model.reduction(),
               std::shared_ptr<const Feedback>(owner, owner->feedback()),
               model.derivatives())
      .WithThreads(model.num_threads());
}

}  // namespace invgrad
