// A module of libtorch as a Network: what torch_network.h makes. Its passes
// (values and derivatives) are in module_network_passes.cc.
//
// Shapes:  the columns of Network <-> the first dimension of tensors.
// Threads: one pass at a time; a mutex guards the module and its weights.
#ifndef INVGRAD_TORCH_MODULE_NETWORK_H_
#define INVGRAD_TORCH_MODULE_NETWORK_H_

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <numeric>
#include <string>
#include <vector>

#include "invgrad/internal/network_layers.h"
#include "invgrad/torch_network.h"

namespace invgrad {

class ModuleNetwork final : public Network,
                            public LinearOutputNetwork,
                            public FactoredNetwork,
                            public InputDifferentiableNetwork {
 public:
  // Returns null, with *error set.
  static std::shared_ptr<const ModuleNetwork> Make(
      const std::function<TorchFunction()>& make,
      const TorchNetworkOptions& options,
      std::string* error);

  int num_inputs() const override {
    return static_cast<int>(Product(options_.input_shape));
  }
  int num_outputs() const override {
    return static_cast<int>(Product(output_shape_));
  }
  int num_weights() const override {
    return static_cast<int>(initial_weights_.size());
  }
  std::string Name() const override { return name_; }
  Eigen::VectorXd InitialWeights(Initialization initialization,
                                 NumpyRandom* random) const override;
  std::vector<int> WeightBlocks() const override;
  bool couples_samples() const override { return true; }
  LayerColumns OutputLayer() const override { return output_layer_; }
  Eigen::MatrixXd Features(const Eigen::VectorXd& weights,
                           const Pass& pass) const override;
  std::vector<LayerColumns> FactorLayers() const override {
    return factor_layers_;
  }

  struct TorchPass final : Pass {
    torch::Tensor input;
    // With the graph of derivatives; undefined for Derivatives::kNone.
    mutable torch::Tensor output;
    mutable long weights_id = -1;  // of the graph
  };
  std::unique_ptr<Pass> NewPass() const override {
    return std::make_unique<TorchPass>();
  }
  bool Forward(const Eigen::VectorXd& weights,
               const Eigen::MatrixXd& inputs,
               Derivatives derivatives,
               Pass* pass,
               std::string* error) const override;
  void Backward(const Eigen::VectorXd& weights,
                const Pass& pass,
                const Eigen::MatrixXd& output_covectors,
                Eigen::VectorXd* gradient) const override;
  void Tangent(const Eigen::VectorXd& weights,
               const Pass& pass,
               const Eigen::VectorXd& weight_tangent,
               Eigen::MatrixXd* output_tangents) const override;
  void Factors(const Eigen::VectorXd& weights,
               const Pass& pass,
               const Eigen::MatrixXd& output_covectors,
               SampledFactors* factors) const override;
  bool InputJacobian(const Eigen::VectorXd& weights,
                     const Eigen::VectorXd& input,
                     Eigen::VectorXd* outputs,
                     Eigen::MatrixXd* jacobian,
                     std::string* error) const override;

 private:
  ModuleNetwork(const std::function<TorchFunction()>& make,
                const TorchNetworkOptions& options)
      : make_(make), options_(options) {}

  static int64_t Product(const std::vector<int64_t>& shape) {
    return std::accumulate(
        shape.begin(), shape.end(), int64_t{1}, std::multiplies<>());
  }

  // Parts of Make.
  bool TakeParameters(std::string* error);
  void Measure();

  torch::ScalarType type() const {
    return options_.double_precision ? torch::kDouble : torch::kFloat;
  }
  // A copy, of shape (cols, rows).
  torch::Tensor ToTensor(const Eigen::MatrixXd& columns) const {
    return torch::from_blob(const_cast<double*>(columns.data()),
                            {columns.cols(), columns.rows()},
                            torch::kDouble)
        .to(type(), /*non_blocking=*/false, /*copy=*/true);
  }
  torch::Tensor ToInput(const Eigen::MatrixXd& inputs) const {
    std::vector<int64_t> shape = options_.input_shape;
    shape.insert(shape.begin(), inputs.cols());
    return ToTensor(inputs).view(shape);
  }
  // Views of a vector with the shapes of the parameters.
  std::vector<torch::Tensor> Split(const Eigen::VectorXd& vector) const;

  void SetWeights(const Eigen::VectorXd& weights) const;
  // The output of a pass at these weights, with its graph.
  const torch::Tensor& Differentiable(const Eigen::VectorXd& weights,
                                      const TorchPass& pass) const;

  const std::function<TorchFunction()> make_;
  const TorchNetworkOptions options_;
  std::string name_;
  std::vector<int64_t> output_shape_;
  Eigen::VectorXd initial_weights_;
  LayerColumns output_layer_;
  std::vector<LayerColumns> factor_layers_;

  mutable std::mutex mutex_;  // of the following
  mutable TorchFunction function_;
  std::vector<torch::Tensor> parameters_;
  mutable Eigen::VectorXd weights_;  // in parameters_
  mutable long weights_id_ = 0;      // counts the changes of weights_
};

}  // namespace invgrad

#endif  // INVGRAD_TORCH_MODULE_NETWORK_H_
