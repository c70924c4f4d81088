// Model::Linearize.

#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "invgrad/chain/batch_loss.h"
#include "invgrad/chain/chain_jacobian.h"
#include "invgrad/chain/network_jacobian.h"
#include "invgrad/chain/sample_error.h"
#include "invgrad/chain/scoped_pass.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/parallel.h"
#include "invgrad/model.h"

namespace invgrad {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// The message for a sample whose loss or simulator has failed.
bool LinearizationError(const Simulator& simulator,
                        const BatchLoss& loss,
                        const Eigen::Map<const MatrixXd>& x,
                        const DataSet& batch,
                        int s,
                        std::string* error) {
  return loss.has_failed(s) ? SampleError(batch, s, kLossFailed, error)
                            : SimulatorError(simulator, x, batch, s, error);
}

// dL/dx and d2L_s/dx2 = J_s^T H_L J_s + sum_i g_i d2y_i/dx2 of each sample, with
// the transposed Jacobians side by side.
bool HessiansInX(const Simulator& simulator,
                 BatchLoss* loss,
                 const DataSet& batch,
                 const Eigen::Map<const MatrixXd>& x,
                 const MatrixXd& jacobians,
                 int num_threads,
                 MatrixXd* x_bar,
                 std::vector<MatrixXd>* x_hessians,
                 std::string* error) {
  const int batch_size = batch.num_samples();
  const Eigen::Index num_x = simulator.num_inputs();
  const Eigen::Index num_y = loss->gradients().rows();
  x_bar->resize(num_x, batch_size);
  x_hessians->resize(batch_size);
  const auto add_hessians = [&](int begin, int end) {
    for (int s = begin; s < end; ++s) {
      const auto J_transposed = jacobians.middleCols(s * num_y, num_y);
      x_bar->col(s).noalias() = J_transposed * loss->gradients().col(s);
      MatrixXd& hessian = (*x_hessians)[s];
      hessian.resize(num_x, num_x);
      if (!simulator.WeightedHessian(x.col(s).data(),
                                     batch.Context(s).data(),
                                     loss->gradients().col(s).data(),
                                     hessian.data())) {
        return s;
      }
      hessian.noalias() +=
          J_transposed * loss->Hessian(s) * J_transposed.transpose();
    }
    return end;
  };
  const int s = ForShares(batch_size, num_threads, add_hessians);
  return s == batch_size || SimulatorError(simulator, x, batch, s, error);
}

}  // namespace

bool Model::CanLinearize(const LinearizationParts& parts,
                         std::string* error) const {
  if (!parts.hessian) return true;
  if (num_calls() > 1) {
    *error =
        "a network in a closed loop has no exact Hessian: choose a method "
        "that needs the gradient or the Jacobian";
    return false;
  }
  if (!(has_factors() || is_point_) || !loss_->forms_hessian()) {
    const std::string chain =
        is_point_ ? ""
                  : "a DenseNetwork, a simulator that forms its Jacobian and ";
    *error = "the exact Hessian needs " + chain +
             "a loss that forms its Hessian: choose a method that needs the "
             "gradient or the Jacobian";
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
  linearization->loss_on_curve = nullptr;
  linearization->hessian.resize(0, 0);
  if (!CanLinearize(parts, error)) return false;
  if (is_point_ &&
      (parts.hessian || (parts.jacobian && simulator_->forms_jacobian()))) {
    return LinearizeAtWeights(weights, batch, parts, linearization, error);
  }
  if (parts.jacobian && !has_factors()) {
    return LinearizeByProducts(weights, batch, parts, linearization, error);
  }
  if (parts.jacobian || parts.hessian) {
    return LinearizeThroughJacobians(
        weights, batch, parts, linearization, error);
  }
  if (parts.gradient &&
      !LinearizeByAdjoint(weights, batch, linearization, error)) {
    return false;
  }
  if (parts.loss_gradient) {
    return LinearizeLoss(weights, batch, linearization, error);
  }
  if (parts.gradient) return true;
  return Cost(weights, batch, &linearization->cost, error);
}

bool Model::LinearizeLoss(const VectorXd& weights,
                          const DataSet& batch,
                          Linearization* linearization,
                          std::string* error) const {
  CheckTargets(batch);
  MatrixXd outputs;
  if (!Predict(weights, batch, &outputs, error)) return false;
  BatchLoss loss(loss_, batch, BatchScale(batch.batch_size()), false);
  for (int s = 0; s < batch.num_samples(); ++s) {
    if (!loss.Add(s, outputs.col(s))) {
      return SampleError(batch, s, kLossFailed, error);
    }
  }
  linearization->cost = loss.cost();
  linearization->loss_gradient = loss.gradients().reshaped();
  return CheckCost(linearization->cost, error);
}

bool Model::LinearizeByAdjoint(const VectorXd& weights,
                               const DataSet& batch,
                               Linearization* linearization,
                               std::string* error) const {
  CheckTargets(batch);
  const double scale = BatchScale(batch.batch_size());
  ScopedPass pass(*this);
  if (!Forward(
          weights, batch, Network::Derivatives::kFirst, pass.get(), error)) {
    return false;
  }
  const Eigen::Map<const MatrixXd> x = SimulatorInputs(*pass);
  const int batch_size = batch.num_samples();
  MatrixXd x_bar(x.rows(), x.cols());
  VectorXd losses = VectorXd::Zero(batch_size);
  std::vector<char> loss_failed(batch_size, 0);
  const auto adjoint = [&](int begin, int end) {
    const auto loss_gradient = [&](int in_share, const double* y, double* g) {
      const int s = begin + in_share;
      loss_failed[s] = !loss_->Evaluate(
          y, batch.targets.col(s).data(), &losses[s], g, nullptr);
      Eigen::Map<VectorXd>(g, loss_->size()) *= scale;
      return loss_failed[s] == 0;
    };
    // By reference, because std::function then does not allocate.
    const Simulator::BatchCovector covector = std::cref(loss_gradient);
    return begin + simulator_->AdjointBatch(end - begin,
                                            x.col(begin).data(),
                                            batch.Context(begin).data(),
                                            covector,
                                            x_bar.col(begin).data());
  };
  const int s = ForShares(batch_size, num_threads_, adjoint);
  if (s < batch_size) {
    return loss_failed[s] != 0
               ? SampleError(batch, s, kLossFailed, error)
               : SimulatorError(*simulator_, x, batch, s, error);
  }
  double cost = 0.0;  // in the order of the samples
  for (const double loss : losses) cost += scale * loss;
  if (!CloseLoop(weights, batch, *pass, x_bar, error)) return false;
  x_bar.resize(network_->num_outputs(), (*pass).num_columns());
  network_->Backward(weights, *pass, x_bar, &linearization->gradient);
  linearization->cost = cost;
  return CheckCost(cost, error) &&
         CheckDerivatives(linearization->gradient, MatrixXd(), error);
}

bool Model::LinearizeByProducts(const VectorXd& weights,
                                const DataSet& batch,
                                const LinearizationParts& parts,
                                Linearization* linearization,
                                std::string* error) const {
  CheckTargets(batch);
  std::unique_ptr<Network::Pass> pass = network_->NewPass();
  if (!Forward(
          weights, batch, Network::Derivatives::kFirst, pass.get(), error)) {
    return false;
  }
  const Eigen::Map<const MatrixXd> x = SimulatorInputs(*pass);
  BatchLoss loss(loss_, batch, BatchScale(batch.batch_size()), false);
  const int batch_size = batch.num_samples();
  std::vector<std::unique_ptr<const JacobianOperator>> jacobians(batch_size);
  const auto linearize = [&](int begin, int end) {
    VectorXd y(loss_->size());
    for (int s = begin; s < end; ++s) {
      jacobians[s] = simulator_->Linearize(
          x.col(s).data(), batch.Context(s).data(), y.data());
      if (jacobians[s] == nullptr || !loss.Add(s, y)) return s;
    }
    return end;
  };
  const int s = ForShares(batch_size, num_threads_, linearize);
  if (s < batch_size) {
    return LinearizationError(*simulator_, loss, x, batch, s, error);
  }
  linearization->cost = loss.cost();
  if (!CheckCost(loss.cost(), error)) return false;
  linearization->loss_gradient = loss.gradients().reshaped();
  loss.MoveTo(linearization);
  if (is_point_ && batch_size == 1) {
    // It may refer to the simulator.
    using Owner = std::pair<std::shared_ptr<const Simulator>,
                            std::unique_ptr<const JacobianOperator>>;
    const auto owner =
        std::make_shared<const Owner>(simulator_, std::move(jacobians[0]));
    linearization->jacobian =
        std::shared_ptr<const JacobianOperator>(owner, owner->second.get());
  } else {
    linearization->jacobian = std::make_shared<ChainJacobian>(
        network_, weights, std::move(pass), simulator_, std::move(jacobians));
  }
  if (parts.gradient) {
    linearization->jacobian->TransposeTimes(linearization->loss_gradient,
                                            &linearization->gradient);
  }
  return CheckDerivatives(linearization->gradient, MatrixXd(), error);
}

bool Model::LinearizeThroughJacobians(const VectorXd& weights,
                                      const DataSet& batch,
                                      const LinearizationParts& parts,
                                      Linearization* linearization,
                                      std::string* error) const {
  CheckTargets(batch);
  const int batch_size = batch.num_samples();
  const Eigen::Index num_y = loss_->size();
  const Network::Derivatives derivatives = parts.hessian
                                               ? Network::Derivatives::kSecond
                                               : Network::Derivatives::kFirst;
  DenseNetwork::Activations activations;
  if (!Forward(weights, batch, derivatives, &activations, error)) return false;
  const Eigen::Map<const MatrixXd> x = SimulatorInputs(activations);
  MatrixXd y(num_y, batch_size);
  MatrixXd jacobians(simulator_->num_inputs(), num_y * batch_size);
  BatchLoss loss(loss_, batch, BatchScale(batch.batch_size()), parts.hessian);
  const auto evaluate = [&](int begin, int end) {
    // A row-major Jacobian is a block of columns.
    const int num_done =
        simulator_->EvaluateBatch(end - begin,
                                  x.col(begin).data(),
                                  batch.Context(begin).data(),
                                  y.col(begin).data(),
                                  jacobians.col(begin * num_y).data());
    for (int s = begin; s < begin + num_done; ++s) {
      if (!loss.Add(s, y.col(s))) return s;
    }
    return begin + num_done;
  };
  const int failed = ForShares(batch_size, num_threads_, evaluate);
  if (failed < batch_size) {
    return LinearizationError(*simulator_, loss, x, batch, failed, error);
  }
  linearization->cost = loss.cost();
  linearization->loss_gradient = loss.gradients().reshaped();
  if (!CheckCost(linearization->cost, error)) return false;

  if (parts.hessian) {
    MatrixXd x_bar;
    std::vector<MatrixXd> x_hessians;
    if (!HessiansInX(*simulator_,
                     &loss,
                     batch,
                     x,
                     jacobians,
                     num_threads_,
                     &x_bar,
                     &x_hessians,
                     error)) {
      return false;
    }
    x_bar.resize(network_->num_outputs(), activations.num_columns());
    dense_network_->Hessian(
        weights, activations, x_bar, x_hessians, &linearization->hessian);
  }

  if (!CloseLoop(weights, batch, activations, jacobians, error)) return false;
  const auto jacobian = std::make_shared<NetworkJacobian>(
      *dense_network_, weights, std::move(activations), std::move(jacobians));
  if (parts.gradient) {
    jacobian->TransposeTimes(linearization->loss_gradient,
                             &linearization->gradient);
  }
  if (!CheckDerivatives(
          linearization->gradient, linearization->hessian, error)) {
    return false;
  }
  if (!parts.jacobian) {
    if (!parts.loss_gradient) linearization->loss_gradient.resize(0);
    return true;
  }
  linearization->jacobian = jacobian;
  loss.MoveTo(linearization);
  return true;
}

}  // namespace invgrad
