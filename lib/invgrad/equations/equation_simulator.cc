#include "invgrad/equations/equation_simulator.h"

#include <algorithm>
#include <utility>

#include "fmt/ranges.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::Index;
using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;

EquationContext::EquationContext(const TrialFunction& trial_function,
                                 int num_coefficients,
                                 int num_of_residual)
    : weight(trial_function.ConditionSize()),
      term(weight + 1),
      point(term + 1),
      num_coordinates(trial_function.derivatives->num_variables()),
      coefficients(point + num_coordinates),
      num_coefficients(num_coefficients),
      of_residual(coefficients + num_coefficients),
      size(of_residual + num_of_residual) {}

EquationSimulator::EquationSimulator(TrialFunction trial_function,
                                     std::vector<EquationResidual> residuals,
                                     int num_coefficients)
    : trial_function_(std::move(trial_function)),
      residuals_(std::move(residuals)),
      num_stated_(trial_function_.num_functions *
                  trial_function_.derivatives->num_stated()),
      num_outputs_(0) {
  CHECK(!residuals_.empty());
  int num_context = 0;
  for (const EquationResidual& residual : residuals_) {
    CHECK_EQ(residual.function->num_inputs(), num_stated_ + num_coefficients)
        << residual.name
        << ": the inputs are the functions, their stated derivatives and the "
           "coefficients.";
    num_outputs_ = std::max(num_outputs_, residual.function->num_outputs());
    num_context = std::max(num_context, residual.function->num_context());
  }
  layout_ = EquationContext(trial_function_, num_coefficients, num_context);
}

int EquationSimulator::num_inputs() const {
  return trial_function_.num_functions *
         trial_function_.derivatives->num_channels();
}

std::string EquationSimulator::WhyNoLanes() const {
  return residuals_[0].function->WhyNoLanes();
}

bool EquationSimulator::has_weighted_hessian() const {
  return std::all_of(
      residuals_.begin(), residuals_.end(), [](const EquationResidual& r) {
        return r.function->has_weighted_hessian();
      });
}

int EquationSimulator::TermOf(const double* context) const {
  const int k = static_cast<int>(context[layout_.term]);
  CHECK_GE(k, 0);
  CHECK_LT(k, static_cast<int>(residuals_.size()));
  return k;
}

MatrixXd EquationSimulator::StatedJets(int count,
                                       const double* x,
                                       const double* contexts) const {
  return trial_function_
      .Values(Map<const MatrixXd>(x, num_inputs(), count),
              Map<const MatrixXd>(contexts, layout_.size, count))
      .topRows(num_stated_);
}

int EquationSimulator::EvaluateResiduals(int count,
                                         const double* x,
                                         const double* contexts,
                                         double* y,
                                         MatrixXd* jacobians) const {
  const Map<const MatrixXd> context(contexts, layout_.size, count);
  const Index num_u = num_stated_ + layout_.num_coefficients;
  MatrixXd inputs(num_u, count);
  inputs << StatedJets(count, x, contexts),
      context.middleRows(layout_.coefficients, layout_.num_coefficients);
  Map<MatrixXd> values(y, num_outputs_, count);
  values.setZero();
  if (jacobians != nullptr) {
    jacobians->setZero(num_u, Index{num_outputs_} * count);
  }
  for (Index first = 0, end = 0; first < count; first = end) {
    // Adjacent samples of one term.
    const int k = TermOf(context.col(first).data());
    while (end < count && TermOf(context.col(end).data()) == k) ++end;
    const Simulator& residual = *residuals_[k].function;
    const Index num_y = residual.num_outputs();
    const Index size = end - first;
    const MatrixXd c =
        context.block(layout_.of_residual, first, residual.num_context(), size);
    MatrixXd of_term(num_y, size);
    MatrixXd J(num_u, jacobians == nullptr ? 0 : num_y * size);
    const int num_done =
        residual.EvaluateBatch(static_cast<int>(size),
                               inputs.col(first).data(),
                               c.data(),
                               of_term.data(),
                               jacobians == nullptr ? nullptr : J.data());
    for (Index s = 0; s < num_done; ++s) {
      const double w = context(layout_.weight, first + s);
      values.col(first + s).head(num_y) = w * of_term.col(s);
      if (jacobians == nullptr) continue;
      jacobians->middleCols((first + s) * num_outputs_, num_y) =
          w * J.middleCols(s * num_y, num_y);
    }
    if (num_done < size) return static_cast<int>(first) + num_done;
  }
  return count;
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
  MatrixXd to_u;
  const int num_done = EvaluateResiduals(
      count, x, contexts, y, jacobians == nullptr ? nullptr : &to_u);
  if (jacobians == nullptr) return num_done;
  for (Index s = 0; s < num_done; ++s) {
    PullBackToNetwork(
        contexts + s * layout_.size,
        to_u.block(0, s * num_outputs_, num_stated_, num_outputs_),
        Map<MatrixXd>(jacobians + s * num_outputs_ * num_inputs(),
                      num_inputs(),
                      num_outputs_));
  }
  return num_done;
}

int EquationSimulator::CoefficientJacobians(int count,
                                            const double* x,
                                            const double* contexts,
                                            double* jacobians) const {
  MatrixXd y(num_outputs_, count);
  MatrixXd to_u;
  const int num_done = EvaluateResiduals(count, x, contexts, y.data(), &to_u);
  const Index p = layout_.num_coefficients;
  for (Index s = 0; s < num_done; ++s) {
    Map<MatrixXd>(jacobians + s * num_outputs_ * p, num_outputs_, p) =
        to_u.block(num_stated_, s * num_outputs_, p, num_outputs_).transpose();
  }
  return num_done;
}

bool EquationSimulator::WeightedHessian(const double* x,
                                        const double* context,
                                        const double* w,
                                        double* hessian) const {
  const Simulator& residual = *residuals_[TermOf(context)].function;
  VectorXd inputs(num_stated_ + layout_.num_coefficients);
  inputs << StatedJets(1, x, context),
      Map<const VectorXd>(context + layout_.coefficients,
                          layout_.num_coefficients);
  const VectorXd scaled =
      context[layout_.weight] * Map<const VectorXd>(w, residual.num_outputs());
  MatrixXd to_u(inputs.size(), inputs.size());
  if (!residual.WeightedHessian(inputs.data(),
                                context + layout_.of_residual,
                                scaled.data(),
                                to_u.data())) {
    return false;
  }
  MatrixXd half(num_inputs(), num_stated_);
  PullBackToNetwork(
      context, to_u.topLeftCorner(num_stated_, num_stated_), half);
  PullBackToNetwork(context,
                    half.transpose(),
                    Map<MatrixXd>(hessian, num_inputs(), num_inputs()));
  return true;
}

std::string EquationSimulator::DescribeFailure(const double* x,
                                               const double* context) const {
  const MatrixXd u = StatedJets(1, x, context);
  std::string inputs;
  for (Index i = 0; i < u.size(); ++i) {
    const int f = static_cast<int>(i) % trial_function_.num_functions;
    const std::string& word = trial_function_.derivatives->word(
        static_cast<int>(i) / trial_function_.num_functions);
    inputs += fmt::format(
        "{}u{}{} = {:g}",
        i == 0 ? "" : ", ",
        trial_function_.num_functions > 1 ? std::to_string(f) : std::string(),
        word.empty() ? word : "_" + word,
        u(i));
  }
  const Map<const VectorXd> point(context + layout_.point,
                                  layout_.num_coordinates);
  return fmt::format("{} at the point ({}), where {}",
                     residuals_[TermOf(context)].name,
                     fmt::join(point.begin(), point.end(), ", "),
                     inputs);
}

}  // namespace invgrad
