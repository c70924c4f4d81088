#include "invgrad/chain/equation_simulator.h"

#include <utility>

#include "Eigen/Core"
#include "glog/logging.h"

namespace invgrad {

using Eigen::Index;
using Eigen::Map;
using Eigen::MatrixXd;

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
  return trial_function_.ConditionSize() + equation_->num_context();
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

void EquationSimulator::PullBackToNetwork(
    int count,
    const double* contexts,
    const Eigen::Ref<const MatrixXd>& covectors,
    Eigen::Ref<MatrixXd> x_bar) const {
  x_bar.setZero();
  x_bar.topRows(covectors.rows()) = covectors;
  if (!trial_function_.has_conditions()) return;
  const Index size = num_inputs();
  const Index T = trial_function_.derivatives->num_channels();
  const Index per_sample = covectors.cols() / count;
  for (Index s = 0; s < count; ++s) {
    const Map<const MatrixXd> d(
        contexts + s * num_context() + size, trial_function_.num_functions, T);
    for (Index k = s * per_sample; k < (s + 1) * per_sample; ++k) {
      trial_function_.derivatives->MultiplyTransposed(
          d,
          Map<MatrixXd>(x_bar.col(k).data(), trial_function_.num_functions, T));
    }
  }
}

int EquationSimulator::EvaluateBatch(int count,
                                     const double* x,
                                     const double* contexts,
                                     double* y,
                                     double* jacobians) const {
  const MatrixXd u = EquationInputs(count, x, contexts);
  const MatrixXd c = EquationContexts(count, contexts);
  if (jacobians == nullptr) {
    return equation_->EvaluateBatch(count, u.data(), c.data(), y, nullptr);
  }
  // Row-major Jacobians, read as columns.
  const Index num_rows = Index{num_outputs()} * count;
  MatrixXd to_u(equation_->num_inputs(), num_rows);
  const int num_done =
      equation_->EvaluateBatch(count, u.data(), c.data(), y, to_u.data());
  PullBackToNetwork(
      count, contexts, to_u, Map<MatrixXd>(jacobians, num_inputs(), num_rows));
  return num_done;
}

bool EquationSimulator::WeightedHessian(const double* x,
                                        const double* context,
                                        const double* w,
                                        double* hessian) const {
  const MatrixXd u = EquationInputs(1, x, context);
  const MatrixXd c = EquationContexts(1, context);
  const Index num_u = equation_->num_inputs();
  MatrixXd to_u(num_u, num_u);
  if (!equation_->WeightedHessian(u.data(), c.data(), w, to_u.data())) {
    return false;
  }
  MatrixXd half(num_inputs(), num_u);
  PullBackToNetwork(1, context, to_u, half);
  PullBackToNetwork(1,
                    context,
                    half.transpose(),
                    Map<MatrixXd>(hessian, num_inputs(), num_inputs()));
  return true;
}

}  // namespace invgrad
