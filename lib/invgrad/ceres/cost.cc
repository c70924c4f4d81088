#include "invgrad/cost.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "invgrad/internal/logging.h"
#include "invgrad/internal/network_layers.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/linearization.h"
#include "invgrad/loss.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// sqrt(2 c scale), with 1/2 |r|^2 = c scale sum_s |y_s - y*_s|^2.
double ResidualScale(const Model& model, const DataSet& samples) {
  CHECK(model.loss().SquaredNormFactor().has_value())
      << "Only a squared-norm loss is a least-squares problem.";
  return std::sqrt(2.0 * model.loss().SquaredNormFactor().value() *
                   model.BatchScale(samples.batch_size()));
}

// Evaluate has no message.
bool Failed(const std::string& error) {
  VLOG(1) << error;
  return false;
}

// One sample of a network alone.
Model NetworkModel(std::shared_ptr<const Network> network) {
  CHECK(network != nullptr);
  const int num_outputs = network->num_outputs();
  return Model(std::move(network),
               std::make_shared<IdentitySimulator>(num_outputs),
               std::make_shared<SquaredNormLoss>(num_outputs, 0.5),
               Reduction::kSum);
}

DataSet Sample(const VectorXd& input, const VectorXd& target) {
  DataSet sample;
  sample.inputs = input;
  sample.contexts.resize(0, 1);
  sample.targets = target;
  return sample;
}

}  // namespace

// --- SimulatorCost ---

SimulatorCost::SimulatorCost(std::shared_ptr<const Simulator> simulator,
                             const VectorXd& target,
                             VectorXd context)
    : SimulatorCost(std::move(simulator), nullptr, target, std::move(context)) {
  CHECK_EQ(target_.size(), simulator_->num_outputs());
  set_num_residuals(simulator_->num_outputs());
}

SimulatorCost::SimulatorCost(
    std::shared_ptr<const Simulator> simulator,
    std::shared_ptr<const ceres::CostFunction> residual,
    VectorXd context)
    : SimulatorCost(std::move(simulator),
                    std::move(residual),
                    VectorXd(),
                    std::move(context)) {
  CHECK(residual_ != nullptr);
  CHECK_EQ(residual_->parameter_block_sizes().size(), 1u)
      << "The residual is a function of the simulator's output alone.";
  CHECK_EQ(residual_->parameter_block_sizes()[0], simulator_->num_outputs());
  set_num_residuals(residual_->num_residuals());
}

SimulatorCost::SimulatorCost(
    std::shared_ptr<const Simulator> simulator,
    std::shared_ptr<const ceres::CostFunction> residual,
    VectorXd target,
    VectorXd context)
    : simulator_(std::move(simulator)),
      residual_(std::move(residual)),
      target_(std::move(target)),
      context_(std::move(context)) {
  CHECK(simulator_ != nullptr);
  CHECK_EQ(context_.size(), simulator_->num_context());
  *mutable_parameter_block_sizes() = {simulator_->num_inputs()};
}

bool SimulatorCost::Evaluate(const double* const* parameters,
                             double* residuals,
                             double** jacobians) const {
  const double* const x = parameters[0];
  const double* const context = context_.data();
  const bool wants_jacobian = jacobians != nullptr && jacobians[0] != nullptr;
  VectorXd y(simulator_->num_outputs());
  MatrixXd J;
  if (wants_jacobian) {
    const auto linearized = simulator_->Linearize(x, context, y.data());
    if (linearized == nullptr) return false;
    linearized->ToDense(&J);
  } else if (!simulator_->Evaluate(x, context, y.data(), nullptr)) {
    return false;
  }
  RowMajorMatrix R;  // dr/dy
  if (residual_ == nullptr) {
    Eigen::Map<VectorXd>(residuals, num_residuals()) = y - target_;
  } else {
    R.resize(num_residuals(), y.size());
    const double* const of_y = y.data();
    double* of_residual = R.data();
    if (!residual_->Evaluate(
            &of_y, residuals, wants_jacobian ? &of_residual : nullptr)) {
      return false;
    }
  }
  if (!wants_jacobian) return true;
  Eigen::Map<RowMajorMatrix> jacobian(jacobians[0], num_residuals(), J.cols());
  if (residual_ == nullptr) {
    jacobian = J;
  } else {
    jacobian.noalias() = R * J;
  }
  return true;
}

// --- ModelCost ---

ModelCost::ModelCost(const Model& model, DataSet samples)
    : model_(model),
      samples_(std::move(samples)),
      scale_(ResidualScale(model_, samples_)) {
  set_num_residuals(model_.loss().size() * samples_.num_samples());
  *mutable_parameter_block_sizes() = model_.network().WeightBlocks();
}

VectorXd ModelCost::Weights(const double* const* parameters) const {
  VectorXd weights(model_.num_weights());
  double* weight = weights.data();
  for (std::size_t b = 0; b < parameter_block_sizes().size(); ++b) {
    weight = std::copy_n(parameters[b], parameter_block_sizes()[b], weight);
  }
  return weights;
}

bool ModelCost::WeightedHessian(const double* const* parameters,
                                const double* w,
                                double* hessian) const {
  // Up to a constant, sum_i w_i r_i is the loss w' . y with w' = k w.
  const int num_y = model_.loss().size();
  const Model dot_product =
      model_.WithLoss(std::make_shared<DotProductLoss>(num_y), Reduction::kSum);
  DataSet weighted = samples_;
  weighted.targets =
      scale_ * Eigen::Map<const MatrixXd>(w, num_y, samples_.num_samples());
  LinearizationParts parts;
  parts.hessian = true;
  Linearization linearization;
  std::string error;
  if (!dot_product.Linearize(
          Weights(parameters), weighted, parts, &linearization, &error)) {
    return Failed(error);
  }
  const int n = model_.num_weights();
  Eigen::Map<MatrixXd>(hessian, n, n) = linearization.hessian;
  return true;
}

bool ModelCost::Evaluate(const double* const* parameters,
                         double* residuals,
                         double** jacobians) const {
  const VectorXd weights = Weights(parameters);
  Eigen::Map<VectorXd> residual(residuals, num_residuals());
  std::string error;
  if (jacobians == nullptr) {
    MatrixXd y;
    if (!model_.Predict(weights, samples_, &y, &error)) return Failed(error);
    residual = scale_ * (y - samples_.targets).reshaped();
    return true;
  }
  Linearization linearization;
  if (!model_.Linearize(weights,
                        samples_,
                        LinearizationParts::Jacobian(),
                        &linearization,
                        &error)) {
    return Failed(error);
  }
  // g = 2 c scale (y - y*).
  residual = linearization.loss_gradient / scale_;
  MatrixXd J;
  linearization.jacobian->ToDense(&J);
  Index first = 0;
  for (std::size_t b = 0; b < parameter_block_sizes().size(); ++b) {
    const int size = parameter_block_sizes()[b];
    if (jacobians[b] != nullptr) {
      // A row-major matrix is the transpose of a column-major one.
      Eigen::Map<MatrixXd>(jacobians[b], size, num_residuals()) =
          scale_ * J.middleCols(first, size).transpose();
    }
    first += size;
  }
  return true;
}

// --- Networks ---

NetworkCost::NetworkCost(const std::shared_ptr<const Network>& network,
                         const VectorXd& input,
                         const VectorXd& target)
    : of_model_(NetworkModel(network), Sample(input, target)) {
  CHECK_EQ(input.size(), network->num_inputs());
  CHECK_EQ(target.size(), network->num_outputs());
  set_num_residuals(of_model_.num_residuals());
  *mutable_parameter_block_sizes() = of_model_.parameter_block_sizes();
}

TrainedNetworkCost::TrainedNetworkCost(std::shared_ptr<const Network> network,
                                       VectorXd weights,
                                       VectorXd target)
    : network_(std::move(network)),
      weights_(std::move(weights)),
      target_(std::move(target)) {
  CHECK(network_ != nullptr);
  CHECK_EQ(weights_.size(), network_->num_weights());
  CHECK_EQ(target_.size(), network_->num_outputs());
  CHECK(HasInputJacobian(*network_))
      << network_->Name() << " has no derivatives with respect to its input.";
  set_num_residuals(network_->num_outputs());
  *mutable_parameter_block_sizes() = {network_->num_inputs()};
}

bool TrainedNetworkCost::Evaluate(const double* const* parameters,
                                  double* residuals,
                                  double** jacobians) const {
  const Index num_a = network_->num_inputs();
  const Index num_x = network_->num_outputs();
  const VectorXd input = Eigen::Map<const VectorXd>(parameters[0], num_a);
  VectorXd outputs;
  MatrixXd J;
  const bool wants_jacobian = jacobians != nullptr && jacobians[0] != nullptr;
  std::string error;
  if (!InputJacobianOf(*network_,
                       weights_,
                       input,
                       &outputs,
                       wants_jacobian ? &J : nullptr,
                       &error)) {
    return Failed(error);
  }
  Eigen::Map<VectorXd>(residuals, num_x) = outputs - target_;
  if (!outputs.allFinite()) return Failed("the network has no finite value");
  if (wants_jacobian) {
    Eigen::Map<RowMajorMatrix>(jacobians[0], num_x, num_a) = J;
  }
  return true;
}

// --- CostFunctionSimulator ---

CostFunctionSimulator::CostFunctionSimulator(
    std::shared_ptr<const ceres::CostFunction> cost_function,
    int num_context_blocks)
    : cost_function_(std::move(cost_function)) {
  CHECK(cost_function_ != nullptr);
  const std::vector<int32_t>& sizes = cost_function_->parameter_block_sizes();
  num_input_blocks_ = static_cast<int>(sizes.size()) - num_context_blocks;
  CHECK_GE(num_context_blocks, 0);
  CHECK_GT(num_input_blocks_, 0) << "No block is left for the input x.";
  for (int b = 0; b < static_cast<int>(sizes.size()); ++b) {
    (b < num_input_blocks_ ? num_inputs_ : num_context_) += sizes[b];
  }
}

bool CostFunctionSimulator::Evaluate(const double* x,
                                     const double* context,
                                     double* y,
                                     double* jacobian) const {
  const std::vector<int32_t>& sizes = cost_function_->parameter_block_sizes();
  std::vector<const double*> parameters;
  std::vector<double*> jacobians;
  RowMajorMatrix memory;  // the Jacobians of the blocks, one after the other
  if (jacobian != nullptr) memory.resize(num_inputs(), num_outputs());
  double* of_block = memory.data();
  for (int b = 0; b < static_cast<int>(sizes.size()); ++b) {
    const bool is_input = b < num_input_blocks_;
    const double*& values = is_input ? x : context;
    parameters.push_back(values);
    values += sizes[b];
    jacobians.push_back(is_input ? of_block : nullptr);
    if (is_input && jacobian != nullptr) of_block += sizes[b] * num_outputs();
  }
  if (!cost_function_->Evaluate(
          parameters.data(),
          y,
          jacobian == nullptr ? nullptr : jacobians.data()) ||
      !AllFinite(y, num_outputs())) {
    return false;
  }
  if (jacobian == nullptr) return true;
  Eigen::Map<RowMajorMatrix> J(jacobian, num_outputs(), num_inputs());
  Index first = 0;
  for (int b = 0; b < num_input_blocks_; ++b) {
    J.middleCols(first, sizes[b]) =
        Eigen::Map<const RowMajorMatrix>(jacobians[b], num_outputs(), sizes[b]);
    first += sizes[b];
  }
  return AllFinite(jacobian, J.size());
}

// --- Problems ---

std::vector<double*> WeightBlocks(const Network& network, double* weights) {
  std::vector<double*> blocks;
  for (const int size : network.WeightBlocks()) {
    blocks.push_back(weights);
    weights += size;
  }
  return blocks;
}

std::vector<ceres::ResidualBlockId> AddModelToProblem(
    const Model& model,
    const DataSet& data,
    double* weights,
    ceres::Problem* problem,
    const ModelBlockOptions& options) {
  CHECK(weights != nullptr);
  CHECK(problem != nullptr);
  CHECK_GE(options.samples_per_block, 0);
  const std::vector<double*> blocks = WeightBlocks(model.network(), weights);
  const int num_samples = data.num_samples();
  const int step =
      options.samples_per_block > 0 ? options.samples_per_block : num_samples;
  CHECK(step >= num_samples || !model.network().couples_samples())
      << "The samples of this network depend on each other: one block.";
  std::vector<ceres::ResidualBlockId> ids;
  for (int first = 0; first < num_samples; first += step) {
    const int count = std::min(step, num_samples - first);
    ids.push_back(problem->AddResidualBlock(
        new ModelCost(model, data.Piece(first, count)),
        options.loss_function,
        blocks));
  }
  return ids;
}

}  // namespace invgrad
