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
  *mutable_parameter_block_sizes() = {simulator_->num_inputs()};
  if (context_.size() == 0 && simulator_->num_context() > 0) {
    CHECK(simulator_->has_context_jacobian())
        << "The simulator has no derivatives with respect to its context: give "
           "the context to the constructor.";
    mutable_parameter_block_sizes()->push_back(simulator_->num_context());
  } else {
    CHECK_EQ(context_.size(), simulator_->num_context());
  }
}

bool SimulatorCost::Evaluate(const double* const* parameters,
                             double* residuals,
                             double** jacobians) const {
  const double* const x = parameters[0];
  const bool has_context_block = parameter_block_sizes().size() == 2;
  const double* const context =
      has_context_block ? parameters[1] : context_.data();
  double* const of_input = jacobians == nullptr ? nullptr : jacobians[0];
  double* const of_context =
      jacobians == nullptr || !has_context_block ? nullptr : jacobians[1];
  const Index num_y = simulator_->num_outputs();
  VectorXd y(num_y);
  MatrixXd J;          // dy/dx
  RowMajorMatrix J_c;  // dy/dc
  if (of_input != nullptr) {
    const auto linearized = simulator_->Linearize(x, context, y.data());
    if (linearized == nullptr) return false;
    linearized->ToDense(&J);
  } else if (!simulator_->Evaluate(x, context, y.data(), nullptr)) {
    return false;
  }
  if (of_context != nullptr) {
    J_c.resize(num_y, simulator_->num_context());
    if (!simulator_->ContextJacobian(x, context, J_c.data())) return false;
  }
  RowMajorMatrix R;  // dr/dy
  if (residual_ == nullptr) {
    Eigen::Map<VectorXd>(residuals, num_residuals()) = y - target_;
  } else {
    R.resize(num_residuals(), num_y);
    const double* const of_y = y.data();
    double* of_residual = R.data();
    if (!residual_->Evaluate(
            &of_y, residuals, jacobians != nullptr ? &of_residual : nullptr)) {
      return false;
    }
  }
  const auto store = [&](const auto& of_y, double* jacobian) {
    if (jacobian == nullptr) return;
    Eigen::Map<RowMajorMatrix> of_block(jacobian, num_residuals(), of_y.cols());
    if (residual_ == nullptr) {
      of_block = of_y;
    } else {
      of_block.noalias() = R * of_y;
    }
  };
  store(J, of_input);
  store(J_c, of_context);
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
  return EvaluateBlocks(x, context, y, jacobian, nullptr);
}

bool CostFunctionSimulator::ContextJacobian(const double* x,
                                            const double* context,
                                            double* jacobian) const {
  VectorXd y(num_outputs());
  return EvaluateBlocks(x, context, y.data(), nullptr, jacobian);
}

bool CostFunctionSimulator::EvaluateBlocks(const double* x,
                                           const double* context,
                                           double* y,
                                           double* input_jacobian,
                                           double* context_jacobian) const {
  const std::vector<int32_t>& sizes = cost_function_->parameter_block_sizes();
  const int num_blocks = static_cast<int>(sizes.size());
  const auto jacobian_of = [&](int b) {
    return b < num_input_blocks_ ? input_jacobian : context_jacobian;
  };
  std::vector<const double*> parameters;
  std::vector<double*> jacobians;
  std::vector<RowMajorMatrix> memory(num_blocks);
  for (int b = 0; b < num_blocks; ++b) {
    const double*& values = b < num_input_blocks_ ? x : context;
    parameters.push_back(values);
    values += sizes[b];
    if (jacobian_of(b) != nullptr) memory[b].resize(num_outputs(), sizes[b]);
    jacobians.push_back(jacobian_of(b) == nullptr ? nullptr : memory[b].data());
  }
  const bool wants_jacobian =
      input_jacobian != nullptr || context_jacobian != nullptr;
  if (!cost_function_->Evaluate(
          parameters.data(), y, wants_jacobian ? jacobians.data() : nullptr) ||
      !AllFinite(y, num_outputs())) {
    return false;
  }
  const auto store = [&](int begin, int end, double* jacobian, int cols) {
    if (jacobian == nullptr) return true;
    Eigen::Map<RowMajorMatrix> J(jacobian, num_outputs(), cols);
    Index first = 0;
    for (int b = begin; b < end; ++b) {
      J.middleCols(first, sizes[b]) = memory[b];
      first += sizes[b];
    }
    return AllFinite(jacobian, J.size());
  };
  return store(0, num_input_blocks_, input_jacobian, num_inputs()) &&
         store(num_input_blocks_, num_blocks, context_jacobian, num_context());
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
