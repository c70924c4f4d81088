#include "invgrad/ceres/model_cost.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

using Eigen::VectorXd;

// 2 c scale, with 1/2 |r|^2 = c scale sum_s |y_s - y*_s|^2.
double SquaredResidualScale(const Model& model, const DataSet& data) {
  return 2.0 * model.loss().SquaredNormFactor().value() *
         model.BatchScale(data.num_samples());
}

// Evaluate has no message.
bool Failed(const std::string& error) {
  VLOG(1) << error;
  return false;
}

}  // namespace

ModelCostFunction::ModelCostFunction(const Model* model, const DataSet* data)
    : model_(model), data_(data) {
  CHECK(model != nullptr);
  CHECK(data != nullptr);
  CHECK(model->loss().SquaredNormFactor().has_value())
      << "Only a squared-norm loss is a least-squares problem.";
  set_num_residuals(model->loss().size() * data->num_samples());
  *mutable_parameter_block_sizes() = model->network().WeightBlocks();
}

VectorXd ModelCostFunction::Weights(const double* const* parameters) const {
  VectorXd weights(model_->num_weights());
  double* weight = weights.data();
  for (std::size_t b = 0; b < parameter_block_sizes().size(); ++b) {
    weight = std::copy_n(parameters[b], parameter_block_sizes()[b], weight);
  }
  return weights;
}

bool ModelCostFunction::WeightedHessian(const double* const* parameters,
                                        const double* w,
                                        double* hessian) const {
  // Up to a constant, sum_i w_i r_i is the loss w' . y with w' = sqrt(...) w.
  const int num_y = model_->loss().size();
  const Model dot_product = model_->WithLoss(
      std::make_shared<DotProductLoss>(num_y), Reduction::kSum);
  DataSet weighted = *data_;
  weighted.targets =
      std::sqrt(SquaredResidualScale(*model_, *data_)) *
      Eigen::Map<const Eigen::MatrixXd>(w, num_y, data_->num_samples());
  LinearizationParts parts;
  parts.hessian = true;
  Linearization linearization;
  std::string error;
  if (!dot_product.Linearize(
          Weights(parameters), weighted, parts, &linearization, &error)) {
    return Failed(error);
  }
  const int n = model_->num_weights();
  Eigen::Map<Eigen::MatrixXd>(hessian, n, n) = linearization.hessian;
  return true;
}

bool ModelCostFunction::Evaluate(double const* const* parameters,
                                 double* residuals,
                                 double** jacobians) const {
  const VectorXd weights = Weights(parameters);
  const double squared_scale = SquaredResidualScale(*model_, *data_);
  Eigen::Map<VectorXd> residual(residuals, num_residuals());
  std::string error;
  if (jacobians == nullptr) {
    Eigen::MatrixXd y;
    if (!model_->Predict(weights, *data_, &y, &error)) {
      return Failed(error);
    }
    residual = std::sqrt(squared_scale) * (y - data_->targets).reshaped();
    return true;
  }
  Linearization linearization;
  if (!model_->Linearize(weights,
                         *data_,
                         LinearizationParts::Jacobian(),
                         &linearization,
                         &error)) {
    return Failed(error);
  }
  // g = 2 c scale (y - y*).
  residual = linearization.loss_gradient / std::sqrt(squared_scale);
  Eigen::MatrixXd J;
  linearization.jacobian->ToDense(&J);
  Eigen::Index first = 0;
  for (std::size_t b = 0; b < parameter_block_sizes().size(); ++b) {
    const int size = parameter_block_sizes()[b];
    if (jacobians[b] != nullptr) {
      // A row-major matrix is the transpose of a column-major one.
      Eigen::Map<Eigen::MatrixXd>(jacobians[b], size, num_residuals()) =
          std::sqrt(squared_scale) * J.middleCols(first, size).transpose();
    }
    first += size;
  }
  return true;
}

ModelFunction::ModelFunction(const Model* model, const DataSet* data)
    : model_(model), data_(data) {
  CHECK(model != nullptr);
  CHECK(data != nullptr);
}

bool ModelFunction::Evaluate(const double* parameters,
                             double* cost,
                             double* gradient) const {
  Linearization linearization;
  LinearizationParts parts;
  parts.gradient = gradient != nullptr;
  std::string error;
  if (!model_->Linearize(
          Eigen::Map<const VectorXd>(parameters, NumParameters()),
          *data_,
          parts,
          &linearization,
          &error)) {
    return Failed(error);
  }
  *cost = linearization.cost;
  if (gradient != nullptr) {
    Eigen::Map<VectorXd>(gradient, NumParameters()) = linearization.gradient;
  }
  return true;
}

std::vector<double*> WeightBlocks(const Network& network, double* weights) {
  std::vector<double*> blocks;
  for (const int size : network.WeightBlocks()) {
    blocks.push_back(weights);
    weights += size;
  }
  return blocks;
}

void AddModelToProblem(const Model* model,
                       const DataSet* data,
                       VectorXd* weights,
                       ceres::Problem* problem) {
  CHECK(weights != nullptr);
  CHECK(problem != nullptr);
  CHECK_EQ(weights->size(), model->num_weights());
  problem->AddResidualBlock(new ModelCostFunction(model, data),
                            nullptr,
                            WeightBlocks(model->network(), weights->data()));
}

}  // namespace invgrad
