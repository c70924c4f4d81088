#include "invgrad/chain/equation_simulator.h"

#include <utility>

#include "Eigen/Core"
#include "glog/logging.h"

namespace invgrad {

using Eigen::Index;
using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;

EquationSimulator::EquationSimulator(TrialFunction trial_function,
                                     std::shared_ptr<const Simulator> equation)
    : trial_function_(std::move(trial_function)),
      equation_(std::move(equation)) {
  CHECK_EQ(
      equation_->num_inputs(),
      trial_function_.num_functions * trial_function_.derivatives->num_stated())
      << "The equation's inputs are the functions and their stated "
         "derivatives.";
}

int EquationSimulator::num_inputs() const {
  return trial_function_.num_functions *
         trial_function_.derivatives->num_channels();
}

int EquationSimulator::num_context() const {
  return trial_function_.ConditionSize() + 1 + equation_->num_context();
}

MatrixXd EquationSimulator::EquationInputs(int count,
                                           const double* x,
                                           const double* contexts) const {
  return trial_function_
      .Values(Map<const MatrixXd>(x, num_inputs(), count),
              Map<const MatrixXd>(contexts, num_context(), count))
      .topRows(equation_->num_inputs());
}

MatrixXd EquationSimulator::EquationContexts(int count,
                                             const double* contexts) const {
  return Map<const MatrixXd>(contexts, num_context(), count)
      .bottomRows(equation_->num_context());
}

double EquationSimulator::Weight(const double* contexts, Index sample) const {
  return contexts[sample * num_context() + trial_function_.ConditionSize()];
}

void EquationSimulator::PullBackToNetwork(
    const double* context,
    const Eigen::Ref<const MatrixXd>& covectors,
    Eigen::Ref<MatrixXd> x_bar) const {
  x_bar.setZero();
  x_bar.topRows(covectors.rows()) = covectors;
  if (!trial_function_.has_conditions()) return;
  const DerivativeSet& jets = *trial_function_.derivatives;
  const Index num_functions = trial_function_.num_functions;
  const Map<const MatrixXd> d(
      context + num_inputs(), num_functions, jets.num_channels());
  for (Index k = 0; k < x_bar.cols(); ++k) {
    jets.MultiplyTransposed(
        d,
        Map<MatrixXd>(x_bar.col(k).data(), num_functions, jets.num_channels()));
  }
}

int EquationSimulator::EvaluateBatch(int count,
                                     const double* x,
                                     const double* contexts,
                                     double* y,
                                     double* jacobians) const {
  const MatrixXd u = EquationInputs(count, x, contexts);
  const MatrixXd c = EquationContexts(count, contexts);
  const Index num_y = num_outputs();
  // Row-major Jacobians, read as columns.
  MatrixXd to_u(equation_->num_inputs(),
                jacobians == nullptr ? 0 : num_y * count);
  const int num_done =
      equation_->EvaluateBatch(count,
                               u.data(),
                               c.data(),
                               y,
                               jacobians == nullptr ? nullptr : to_u.data());
  for (Index s = 0; s < num_done; ++s) {
    Map<VectorXd>(y + s * num_y, num_y) *= Weight(contexts, s);
    if (jacobians == nullptr) continue;
    to_u.middleCols(s * num_y, num_y) *= Weight(contexts, s);
    PullBackToNetwork(
        contexts + s * num_context(),
        to_u.middleCols(s * num_y, num_y),
        Map<MatrixXd>(
            jacobians + s * num_y * num_inputs(), num_inputs(), num_y));
  }
  return num_done;
}

bool EquationSimulator::WeightedHessian(const double* x,
                                        const double* context,
                                        const double* w,
                                        double* hessian) const {
  const MatrixXd u = EquationInputs(1, x, context);
  const MatrixXd c = EquationContexts(1, context);
  const VectorXd scaled =
      Weight(context, 0) * Map<const VectorXd>(w, num_outputs());
  const Index num_u = equation_->num_inputs();
  MatrixXd to_u(num_u, num_u);
  if (!equation_->WeightedHessian(
          u.data(), c.data(), scaled.data(), to_u.data())) {
    return false;
  }
  MatrixXd half(num_inputs(), num_u);
  PullBackToNetwork(context, to_u, half);
  PullBackToNetwork(context,
                    half.transpose(),
                    Map<MatrixXd>(hessian, num_inputs(), num_inputs()));
  return true;
}

}  // namespace invgrad
