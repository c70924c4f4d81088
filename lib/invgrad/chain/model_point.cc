// Model::LinearizeAtWeights: a simulator without a network.

#include <memory>
#include <optional>

#include "invgrad/chain/batch_loss.h"
#include "invgrad/chain/sample_error.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/model.h"
#include "invgrad/stored_jacobian.h"

namespace invgrad {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// *H = J^T H_L J.
void SetGaussNewton(const RowMajorMatrix& J,
                    const std::optional<double>& squared_norm_factor,
                    double scale,
                    BatchLoss* loss,
                    MatrixXd* H) {
  if (squared_norm_factor.has_value()) {
    *H = 2.0 * *squared_norm_factor * scale * J.transpose() * J;
    return;
  }
  const Index num_y = loss->gradients().rows();
  H->setZero(J.cols(), J.cols());
  for (int s = 0; s < loss->gradients().cols(); ++s) {
    const auto J_s = J.middleRows(s * num_y, num_y);
    *H += J_s.transpose() * loss->Hessian(s) * J_s;
  }
}

}  // namespace

bool Model::LinearizeAtWeights(const VectorXd& weights,
                               const DataSet& batch,
                               const LinearizationParts& parts,
                               Linearization* linearization,
                               std::string* error) const {
  CheckTargets(batch);
  const int batch_size = batch.num_samples();
  const double scale = BatchScale(batch.batch_size());
  const Index n = simulator_->num_inputs();
  const Index num_y = loss_->size();
  RowMajorMatrix J(num_y * batch_size, n);
  BatchLoss loss(loss_, batch, scale, false);
  VectorXd y(num_y);
  for (int s = 0; s < batch_size; ++s) {
    const double* const context = batch.Context(s).data();
    if (!simulator_->Evaluate(
            weights.data(), context, y.data(), J.row(s * num_y).data())) {
      return SampleError(batch,
                         s,
                         SimulatorFailure(*simulator_, weights.data(), context),
                         error);
    }
    if (!loss.Add(s, y)) return SampleError(batch, s, kLossFailed, error);
  }
  linearization->cost = loss.cost();
  if (!CheckCost(linearization->cost, error)) return false;
  const VectorXd g = loss.gradients().reshaped();
  if (parts.gradient) linearization->gradient = J.transpose() * g;
  if (parts.hessian) {
    MatrixXd& H = linearization->hessian;
    SetGaussNewton(J, loss_->SquaredNormFactor(), scale, &loss, &H);
    RowMajorMatrix curvature(n, n);
    for (int s = 0; s < batch_size; ++s) {
      if (!simulator_->WeightedHessian(weights.data(),
                                       batch.Context(s).data(),
                                       g.data() + s * num_y,
                                       curvature.data())) {
        return SampleError(batch, s, kNoSecondDerivative, error);
      }
      H += curvature;
    }
  }
  if (!CheckDerivatives(
          linearization->gradient, linearization->hessian, error)) {
    return false;
  }
  if (parts.jacobian || parts.loss_gradient) linearization->loss_gradient = g;
  if (!parts.jacobian) return true;
  linearization->jacobian = std::make_shared<DenseJacobian>(J);
  loss.MoveTo(linearization);
  return true;
}

}  // namespace invgrad
