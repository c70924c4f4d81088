#include "invgrad/minimize/chain_objective.h"

#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "fmt/core.h"
#include "invgrad/chain/loss_on_curve.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/core/stored_jacobian.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

namespace {

using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace

ChainObjective::ChainObjective(std::shared_ptr<const Simulator> simulator,
                               std::shared_ptr<const Loss> loss,
                               Eigen::VectorXd target,
                               Eigen::VectorXd start)
    : simulator_(std::move(simulator)),
      loss_(std::move(loss)),
      target_(std::move(target)),
      x_(std::move(start)) {
  CHECK_EQ(simulator_->num_context(), 0)
      << "a simulator without a network has no sample to take a context from";
  CHECK_EQ(simulator_->num_outputs(), loss_->size());
  CHECK_EQ(simulator_->num_outputs(), target_.size());
  CHECK_EQ(simulator_->num_inputs(), x_.size());
}

bool ChainObjective::Linearize(const LinearizationParts& parts,
                               Linearization* linearization,
                               std::string* error) const {
  if (parts.jacobian || parts.hessian) {
    return LinearizeWithJacobian(parts, linearization, error);
  }
  if (parts.gradient) return PullBackGradient(linearization, error);
  if (!parts.loss_gradient) return Cost(&linearization->cost, error);
  linearization->loss_gradient.resize(simulator_->num_outputs());
  return EvaluateLoss(
      &linearization->cost, linearization->loss_gradient.data(), error);
}

bool ChainObjective::PullBackGradient(Linearization* linearization,
                                      std::string* error) const {
  const int m = simulator_->num_outputs();
  Eigen::VectorXd y(m);
  linearization->gradient.resize(simulator_->num_inputs());
  bool has_loss = true;
  const auto loss_gradient = [&](const double* outputs, double* w) {
    if (!AllFinite(outputs, m)) return false;
    has_loss = loss_->Evaluate(
                   outputs, target_.data(), &linearization->cost, w, nullptr) &&
               std::isfinite(linearization->cost) && AllFinite(w, m);
    return has_loss;
  };
  if (simulator_->Adjoint(x_.data(),
                          nullptr,
                          loss_gradient,
                          y.data(),
                          linearization->gradient.data()) &&
      linearization->gradient.allFinite()) {
    return true;
  }
  *error = has_loss ? OutputsError() : kNoLoss;
  return false;
}

bool ChainObjective::LinearizeWithJacobian(const LinearizationParts& parts,
                                           Linearization* linearization,
                                           std::string* error) const {
  const int n = simulator_->num_inputs();
  const int m = simulator_->num_outputs();
  // H_L is 2 c I, `loss_hessian`, or has products.
  const std::optional<double> factor = loss_->SquaredNormFactor();
  constexpr double kDouble = sizeof(double);
  const bool forms_hessian = !factor.has_value() && loss_->forms_hessian();
  if (parts.hessian && !factor.has_value() && !forms_hessian) {
    *error =
        "the loss does not form its Hessian: choose a method that needs the "
        "gradient or the Jacobian";
    return false;
  }
  // The exact Hessian needs J itself.
  const bool forms_jacobian = simulator_->forms_jacobian() || parts.hessian;
  std::vector<MemoryPart> memory;
  if (forms_jacobian) memory.push_back({"J", 2.0 * kDouble * m * n});
  if (parts.hessian) memory.push_back({"Hessian", 3.0 * kDouble * n * n});
  if (forms_hessian) {
    memory.push_back({"Hessian of the loss", kDouble * m * m});
  }
  if (!FitsInMemory(fmt::format("J {} x {}", m, n), memory, 0.0, error)) {
    return false;
  }
  Eigen::VectorXd y(m);
  RowMajorMatrix J;
  std::shared_ptr<const JacobianOperator> products;  // if J is not formed
  bool is_finite;
  if (forms_jacobian) {
    J.resize(m, n);
    is_finite = simulator_->Evaluate(x_.data(), nullptr, y.data(), J.data()) &&
                J.allFinite();
  } else {
    products = simulator_->Linearize(x_.data(), nullptr, y.data());
    is_finite = products != nullptr;
  }
  if (!is_finite || !y.allFinite()) {
    *error = OutputsError();
    return false;
  }
  Eigen::VectorXd g(m);
  Eigen::MatrixXd loss_hessian;
  if (forms_hessian) loss_hessian.resize(m, m);
  if (!loss_->Evaluate(y.data(),
                       target_.data(),
                       &linearization->cost,
                       g.data(),
                       forms_hessian ? loss_hessian.data() : nullptr) ||
      !std::isfinite(linearization->cost) || !g.allFinite() ||
      !loss_hessian.allFinite()) {
    *error = kNoLoss;
    return false;
  }
  if (parts.gradient) {
    if (forms_jacobian) {
      linearization->gradient = J.transpose() * g;
    } else {
      products->TransposeTimes(g, &linearization->gradient);
    }
  }
  if (parts.hessian) {
    RowMajorMatrix curvature(n, n);
    if (!simulator_->WeightedHessian(
            x_.data(), nullptr, g.data(), curvature.data()) ||
        !curvature.allFinite()) {
      *error = "the simulator has no finite second derivative at x";
      return false;
    }
    if (factor.has_value()) {
      linearization->hessian = 2.0 * *factor * J.transpose() * J + curvature;
    } else {
      linearization->hessian = J.transpose() * loss_hessian * J + curvature;
    }
  }
  if (parts.jacobian) {
    linearization->loss_gradient = std::move(g);
    linearization->jacobian =
        forms_jacobian ? std::make_shared<DenseJacobian>(J) : products;
    linearization->loss_on_curve = loss_->has_invariant()
                                       ? MakeLossOnCurve(loss_, y, target_, 1.0)
                                       : nullptr;
    linearization->loss_hessian_times =
        [factor,
         H = std::move(loss_hessian),
         y,
         loss = loss_,
         y_star = target_](const Eigen::VectorXd& v) -> Eigen::VectorXd {
      if (factor.has_value()) return 2.0 * *factor * v;
      if (H.size() > 0) return H * v;
      return loss->HessianTimes(y.data(), y_star.data(), v);
    };
  }
  return true;
}

bool ChainObjective::Cost(double* cost, std::string* error) const {
  return EvaluateLoss(cost, nullptr, error);
}

bool ChainObjective::EvaluateLoss(double* cost,
                                  double* gradient,
                                  std::string* error) const {
  const Eigen::VectorXd y = Outputs();
  if (y.size() == 0) {
    *error = OutputsError();
    return false;
  }
  if (!loss_->Evaluate(y.data(), target_.data(), cost, gradient, nullptr) ||
      !std::isfinite(*cost)) {
    *error = kNoLoss;
    return false;
  }
  return true;
}

void ChainObjective::SetState(const Eigen::VectorXd& state) {
  CHECK_EQ(state.size(), x_.size());
  x_ = state;
}

bool ChainObjective::Plus(const Eigen::VectorXd& step) {
  CHECK_EQ(step.size(), x_.size());
  if (!step.allFinite()) return false;
  x_ += step;
  return true;
}

Eigen::VectorXd ChainObjective::Outputs() const {
  Eigen::VectorXd y(simulator_->num_outputs());
  if (!simulator_->Evaluate(x_.data(), nullptr, y.data(), nullptr) ||
      !y.allFinite()) {
    return Eigen::VectorXd();
  }
  return y;
}

std::string ChainObjective::OutputsError() const {
  const std::string where = simulator_->DescribeFailure(x_.data(), nullptr);
  return where.empty() ? kNoOutputs : kNoOutputs + (": " + where);
}

ChainCostFunction::ChainCostFunction(const ChainObjective* objective)
    : objective_(objective) {
  const std::optional<double> factor = objective->loss().SquaredNormFactor();
  CHECK(factor.has_value()) << "only a squared-norm loss has residuals; this "
                               "loss needs a line search";
  scale_ = std::sqrt(2.0 * *factor);
  set_num_residuals(objective->simulator().num_outputs());
  mutable_parameter_block_sizes()->push_back(objective->num_parameters());
}

bool ChainCostFunction::Evaluate(double const* const* parameters,
                                 double* residuals,
                                 double** jacobians) const {
  double* jacobian = jacobians == nullptr ? nullptr : jacobians[0];
  if (!objective_->simulator().Evaluate(
          parameters[0], nullptr, residuals, jacobian)) {
    return false;
  }
  Eigen::Map<Eigen::VectorXd> r(residuals, num_residuals());
  r = scale_ * (r - objective_->target());
  if (jacobian != nullptr) {
    Eigen::Map<Eigen::ArrayXd>(
        jacobian, num_residuals() * objective_->num_parameters()) *= scale_;
  }
  return true;
}

bool ChainCostFunction::WeightedHessian(double const* const* parameters,
                                        const double* w,
                                        double* hessian) const {
  const Eigen::VectorXd scaled_w =
      scale_ * Eigen::Map<const Eigen::VectorXd>(w, num_residuals());
  return objective_->simulator().WeightedHessian(
      parameters[0], nullptr, scaled_w.data(), hessian);
}

bool ChainFunction::Evaluate(const double* parameters,
                             double* cost,
                             double* gradient) const {
  ChainObjective at_x = *objective_;
  at_x.SetState(Eigen::Map<const Eigen::VectorXd>(parameters, NumParameters()));
  LinearizationParts parts;
  parts.gradient = gradient != nullptr;
  Linearization linearization;
  std::string error;
  if (!at_x.Linearize(parts, &linearization, &error)) return false;
  *cost = linearization.cost;
  if (gradient != nullptr) {
    Eigen::Map<Eigen::VectorXd>(gradient, NumParameters()) =
        linearization.gradient;
  }
  return true;
}

}  // namespace invgrad
