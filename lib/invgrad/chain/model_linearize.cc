// Model::Linearize.

#include <functional>
#include <utility>
#include <vector>

#include "glog/logging.h"
#include "invgrad/chain/model.h"
#include "invgrad/chain/network_jacobian.h"
#include "invgrad/chain/sample_error.h"
#include "invgrad/core/scratch.h"

namespace invgrad {

using Eigen::MatrixXd;
using Eigen::VectorXd;

bool Model::CanLinearize(const LinearizationParts& parts,
                         std::string* error) const {
  if (!parts.hessian) return true;
  if (num_calls() > 1) {
    *error =
        "a network in a closed loop has no exact Hessian: choose a method "
        "that needs the gradient or the Jacobian";
    return false;
  }
  return CheckHasHessian(*simulator_, error);
}

bool Model::Linearize(const VectorXd& weights,
                      const DataSet& batch,
                      const LinearizationParts& parts,
                      Linearization* linearization,
                      std::string* error) const {
  linearization->gradient.resize(0);
  linearization->loss_gradient.resize(0);
  linearization->jacobian.reset();
  linearization->loss_hessian_times = nullptr;
  linearization->hessian.resize(0, 0);
  if (!CanLinearize(parts, error)) return false;
  if (parts.jacobian || parts.hessian) {
    return LinearizeThroughJacobians(
        weights, batch, parts, linearization, error);
  }
  if (parts.gradient) {
    return LinearizeByAdjoint(weights, batch, linearization, error);
  }
  return Cost(weights, batch, &linearization->cost, error);
}

bool Model::LinearizeByAdjoint(const VectorXd& weights,
                               const DataSet& batch,
                               Linearization* linearization,
                               std::string* error) const {
  CheckTargets(batch);
  const double scale = BatchScale(batch.num_samples());
  Scratch<DenseNetwork::Activations> scratch(1);
  DenseNetwork::Activations& activations = scratch[0];
  if (!Forward(weights, batch, false, &activations, error)) return false;
  const Eigen::Map<const MatrixXd> x = SimulatorInputs(activations);
  VectorXd y(loss_->size());
  MatrixXd x_bar(x.rows(), x.cols());
  double cost = 0.0;
  int s = 0;
  bool loss_failed = false;
  const auto loss_gradient = [&](const double* at, double* g) {
    double loss = 0.0;
    loss_failed =
        !loss_->Evaluate(at, batch.targets.col(s).data(), &loss, g, nullptr);
    cost += scale * loss;
    Eigen::Map<VectorXd>(g, loss_->size()) *= scale;
    return !loss_failed;
  };
  // By reference, because std::function then does not allocate.
  const Simulator::Covector covector = std::cref(loss_gradient);
  for (; s < batch.num_samples(); ++s) {
    if (!simulator_->Adjoint(x.col(s).data(),
                             batch.Context(s).data(),
                             covector,
                             y.data(),
                             x_bar.col(s).data())) {
      return loss_failed ? SampleError(s, kLossFailed, error)
                         : SimulatorError(*simulator_, x, batch, s, error);
    }
  }
  if (!CloseLoop(weights, batch, activations, x_bar, error)) return false;
  x_bar.resize(network_.num_outputs(), activations.batch_size());
  network_.Backward(weights, activations, x_bar, &linearization->gradient);
  linearization->cost = cost;
  return CheckCost(cost, error) &&
         CheckDerivatives(linearization->gradient, MatrixXd(), error);
}

bool Model::LinearizeThroughJacobians(const VectorXd& weights,
                                      const DataSet& batch,
                                      const LinearizationParts& parts,
                                      Linearization* linearization,
                                      std::string* error) const {
  CheckTargets(batch);
  const int batch_size = batch.num_samples();
  const Eigen::Index num_x = simulator_->num_inputs();
  const Eigen::Index num_y = loss_->size();
  const double scale = BatchScale(batch_size);
  const std::optional<double> factor = loss_->SquaredNormFactor();
  const bool want_loss_hessians = parts.hessian || !factor.has_value();

  DenseNetwork::Activations activations;
  if (!Forward(weights, batch, parts.hessian, &activations, error)) {
    return false;
  }
  const Eigen::Map<const MatrixXd> x = SimulatorInputs(activations);
  VectorXd y(num_y);
  MatrixXd jacobians(num_x, num_y * batch_size);
  MatrixXd loss_gradients(num_y, batch_size);
  MatrixXd loss_hessians;  // the blocks of H_L, side by side
  if (want_loss_hessians) loss_hessians.resize(num_y, num_y * batch_size);
  linearization->cost = 0.0;
  for (int s = 0; s < batch_size; ++s) {
    // A row-major Jacobian is a block of columns.
    if (!simulator_->Evaluate(x.col(s).data(),
                              batch.Context(s).data(),
                              y.data(),
                              jacobians.col(s * num_y).data())) {
      return SimulatorError(*simulator_, x, batch, s, error);
    }
    double value = 0.0;
    if (!loss_->Evaluate(y.data(),
                         batch.targets.col(s).data(),
                         &value,
                         loss_gradients.col(s).data(),
                         want_loss_hessians
                             ? loss_hessians.col(s * num_y).data()
                             : nullptr)) {
      return SampleError(s, kLossFailed, error);
    }
    linearization->cost += scale * value;
  }
  loss_gradients *= scale;
  loss_hessians *= scale;
  linearization->loss_gradient = loss_gradients.reshaped();
  if (!CheckCost(linearization->cost, error)) return false;

  if (parts.hessian) {
    // d2L_s/dx2 = J_s^T H_L J_s + sum_i g_i d2y_i/dx2.
    MatrixXd x_bar(num_x, batch_size);
    std::vector<MatrixXd> x_hessians(batch_size);
    for (int s = 0; s < batch_size; ++s) {
      const auto J_transposed = jacobians.middleCols(s * num_y, num_y);
      x_bar.col(s).noalias() = J_transposed * loss_gradients.col(s);
      x_hessians[s].resize(num_x, num_x);
      if (!simulator_->WeightedHessian(x.col(s).data(),
                                       batch.Context(s).data(),
                                       loss_gradients.col(s).data(),
                                       x_hessians[s].data())) {
        return SimulatorError(*simulator_, x, batch, s, error);
      }
      x_hessians[s].noalias() += J_transposed *
                                 loss_hessians.middleCols(s * num_y, num_y) *
                                 J_transposed.transpose();
    }
    x_bar.resize(network_.num_outputs(), activations.batch_size());
    network_.Hessian(
        weights, activations, x_bar, x_hessians, &linearization->hessian);
  }

  if (!CloseLoop(weights, batch, activations, jacobians, error)) return false;
  const auto jacobian = std::make_shared<NetworkJacobian>(
      network_, weights, std::move(activations), std::move(jacobians));
  if (parts.gradient) {
    jacobian->TransposeTimes(linearization->loss_gradient,
                             &linearization->gradient);
  }
  if (!CheckDerivatives(
          linearization->gradient, linearization->hessian, error)) {
    return false;
  }
  if (!parts.jacobian) {
    linearization->loss_gradient.resize(0);
    return true;
  }
  linearization->jacobian = jacobian;
  if (factor.has_value()) {
    const double c = 2.0 * *factor * scale;
    linearization->loss_hessian_times = [c](const VectorXd& v) -> VectorXd {
      return c * v;
    };
    return true;
  }
  linearization->loss_hessian_times =
      [blocks = std::move(loss_hessians)](const VectorXd& v) {
        CHECK_EQ(v.size(), blocks.cols());
        const Eigen::Index size = blocks.rows();
        VectorXd Hv(v.size());
        for (Eigen::Index row = 0; row < v.size(); row += size) {
          Hv.segment(row, size).noalias() =
              blocks.middleCols(row, size) * v.segment(row, size);
        }
        return Hv;
      };
  return true;
}

}  // namespace invgrad
