#include "ATen/ATen.h"
#include "invgrad/internal/logging.h"
#include "invgrad/torch/module_network.h"
#include "invgrad/torch/torch_factors.h"
#include "invgrad/torch/torch_message.h"
#include "invgrad/torch/torch_output_layer.h"
#include "invgrad/torch/torch_tensors.h"
#include "torch/csrc/autograd/forward_grad.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using torch::Tensor;

// The levels of dual numbers are global.
class DualLevel {
 public:
  DualLevel() : index_(torch::autograd::ForwardADLevel::get_next_idx()) {}
  ~DualLevel() { torch::autograd::ForwardADLevel::release_idx(index_); }
  DualLevel(const DualLevel&) = delete;
  DualLevel& operator=(const DualLevel&) = delete;
  uint64_t index() const { return index_; }

 private:
  uint64_t index_;
};

}  // namespace

bool ModuleNetwork::Forward(const VectorXd& weights,
                            const MatrixXd& inputs,
                            Derivatives derivatives,
                            Pass* pass,
                            std::string* error) const {
  CHECK_EQ(inputs.rows(), num_inputs());
  CHECK(derivatives != Derivatives::kSecond)
      << "a network of libtorch has first derivatives only";
  auto* torch_pass = dynamic_cast<TorchPass*>(pass);
  CHECK(torch_pass != nullptr) << "The pass is of another network.";
  const std::lock_guard<std::mutex> lock(mutex_);
  SetWeights(weights);
  torch_pass->output.reset();  // frees the graph before the next one grows
  torch_pass->input = ToInput(inputs);
  try {
    const torch::AutoGradMode mode(derivatives != Derivatives::kNone);
    torch_pass->output = function_.forward(torch_pass->input);
    torch_pass->weights_id = weights_id_;
  } catch (const std::exception& exception) {
    *error = "the network fails: " + TorchMessage(exception);
    return false;
  }
  torch_pass->outputs = ToColumns(torch_pass->output);
  if (derivatives == Derivatives::kNone) torch_pass->output.reset();
  return true;
}

const Tensor& ModuleNetwork::Differentiable(const VectorXd& weights,
                                            const TorchPass& pass) const {
  SetWeights(weights);
  if (!pass.output.defined() || pass.weights_id != weights_id_) {
    pass.output.reset();
    const torch::AutoGradMode mode(true);
    pass.output = function_.forward(pass.input);
    pass.weights_id = weights_id_;
  }
  return pass.output;
}

void ModuleNetwork::Backward(const VectorXd& weights,
                             const Pass& pass,
                             const MatrixXd& output_covectors,
                             VectorXd* gradient) const {
  const auto& torch_pass = dynamic_cast<const TorchPass&>(pass);
  CHECK_EQ(output_covectors.rows(), num_outputs());
  CHECK_EQ(output_covectors.cols(), pass.num_columns());
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    const Tensor& output = Differentiable(weights, torch_pass);
    std::vector<Tensor> gradients =
        torch::autograd::grad({output},
                              parameters_,
                              {ToTensor(output_covectors).view(output.sizes())},
                              /*retain_graph=*/true,
                              /*create_graph=*/false,
                              /*allow_unused=*/true);
    for (size_t i = 0; i < gradients.size(); ++i) {
      if (!gradients[i].defined()) {
        gradients[i] = torch::zeros_like(parameters_[i]);
      }
    }
    *gradient = Flatten(gradients);
  } catch (const std::exception& exception) {
    LOG(ERROR) << "the network's gradient fails: " << TorchMessage(exception);
    gradient->setConstant(num_weights(), NAN);
  }
}

void ModuleNetwork::Tangent(const VectorXd& weights,
                            const Pass& pass,
                            const VectorXd& weight_tangent,
                            MatrixXd* output_tangents) const {
  const auto& torch_pass = dynamic_cast<const TorchPass&>(pass);
  CHECK_EQ(weight_tangent.size(), num_weights());
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    SetWeights(weights);
    const torch::NoGradGuard guard;
    const std::vector<Tensor> tangents = Split(weight_tangent);
    const DualLevel level;
    for (size_t i = 0; i < parameters_.size(); ++i) {
      parameters_[i]._set_fw_grad(
          tangents[i], level.index(), /*is_inplace_op=*/false);
    }
    const Tensor tangent =
        function_.forward(torch_pass.input)._fw_grad(level.index());
    if (tangent.defined()) {
      *output_tangents = ToColumns(tangent);
    } else {
      output_tangents->setZero(num_outputs(), pass.num_columns());
    }
  } catch (const std::exception& exception) {
    LOG(ERROR) << "the network's tangent fails: " << TorchMessage(exception);
    output_tangents->setConstant(num_outputs(), pass.num_columns(), NAN);
  }
}

MatrixXd ModuleNetwork::Features(const VectorXd& weights,
                                 const Pass& pass) const {
  const auto& torch_pass = dynamic_cast<const TorchPass&>(pass);
  CHECK_GT(output_layer_.size(), 0) << "the network has no output layer";
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    return TorchFeatures(Differentiable(weights, torch_pass), parameters_);
  } catch (const std::exception& exception) {
    LOG(ERROR) << "the network's features fail: " << TorchMessage(exception);
    return MatrixXd::Constant(
        output_layer_.rows(), pass.outputs.size() / output_layer_.cols(), NAN);
  }
}

void ModuleNetwork::Factors(const VectorXd& weights,
                            const Pass& pass,
                            const MatrixXd& output_covectors,
                            SampledFactors* factors) const {
  const auto& torch_pass = dynamic_cast<const TorchPass&>(pass);
  CHECK_EQ(output_covectors.rows(), num_outputs());
  CHECK_EQ(output_covectors.cols(), pass.num_columns());
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    const Tensor& output = Differentiable(weights, torch_pass);
    *factors = TorchFactors(
        output, ToTensor(output_covectors).view(output.sizes()), parameters_);
  } catch (const std::exception& exception) {
    LOG(ERROR) << "the network's factors fail: " << TorchMessage(exception);
    *factors = {};
    factors->others.setConstant(num_weights(), NAN);
  }
}

bool ModuleNetwork::InputJacobian(const VectorXd& weights,
                                  const VectorXd& input,
                                  VectorXd* outputs,
                                  MatrixXd* jacobian,
                                  std::string* error) const {
  CHECK_EQ(input.size(), num_inputs());
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    SetWeights(weights);
    const torch::AutoGradMode mode(true);
    const Tensor differentiable = ToInput(input).requires_grad_();
    const Tensor output = function_.forward(differentiable);
    *outputs = ToColumns(output).col(0);
    const Tensor flat = output.reshape({-1});
    jacobian->resize(num_outputs(), num_inputs());
    for (int i = 0; i < num_outputs(); ++i) {
      const std::vector<Tensor> row =
          torch::autograd::grad({flat[i]},
                                {differentiable},
                                /*grad_outputs=*/{},
                                /*retain_graph=*/true);
      jacobian->row(i) = ToColumns(row[0]).col(0).transpose();
    }
  } catch (const std::exception& exception) {
    *error = "the network fails: " + TorchMessage(exception);
    return false;
  }
  return true;
}

}  // namespace invgrad
