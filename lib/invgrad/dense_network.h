// A fully connected network, with all derivatives that the rules of this
// library use, for a whole batch at a time. Use it unless you need other
// layers; for these see torch_network.h, or derive from Network (network.h).
//
// This header also has NetworkFunctor, the same network as a Ceres functor, and
// WriteNetwork and ReadNetwork, which store a trained network in a text file.
//
// The map f from network input to simulator input:
//
//   a_0 = a,   z_l = W_l a_{l-1} + b_l,   a_l = phi(z_l),   x = z_L
//
// ForwardJets propagates f with a set of its derivatives with respect to the
// coordinates of a point (derivative_set.h): every quantity is then a jet of T
// columns a sample,
//
//   x = (f, D_1 f, .., D_{T-1} f)
//
// The same functions differentiate both with respect to the weights.
//
// Shapes:  widths: L + 1 numbers, widths[0] = |a|, widths[L] = |x|;
//          batches have one column a sample;
//          weights: n = sum_l widths[l] (widths[l-1] + 1), one vector. Layer
//          after layer, and in a layer unit after unit: the unit's incoming
//          weights, then its bias. In numpy: hstack([W, b[:, None]]).ravel()
//          for each layer.
// Cost:    forward 2 n B; the backward pass twice that; the Hessian n^2 B. With
//          jets T times as much, the Hessian T^2 times. Batches use BLAS,
//          without allocation per sample.
// Fails:   never: values that are not finite propagate. Sizes that do not fit
//          are CHECKed.
// The network is a description: weights are an argument, never a member.
#ifndef INVGRAD_DENSE_NETWORK_H_
#define INVGRAD_DENSE_NETWORK_H_

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "invgrad/derivative_set.h"
#include "invgrad/internal/activation.h"
#include "invgrad/internal/network_layers.h"
#include "invgrad/network.h"

namespace invgrad {

class DenseNetwork final : public Network,
                           public LinearOutputNetwork,
                           public FactoredNetwork,
                           public InputDifferentiableNetwork {
 public:
  // At least two widths, all positive, and no more weights than an int can
  // number (CHECKed). `hidden` is the activation of all layers but the last,
  // which is linear.
  DenseNetwork(std::vector<int> widths, Activation hidden);

  // n, as a double, because widths may overflow an int.
  static double CountWeights(const std::vector<int>& widths);

  int num_inputs() const override { return widths_.front(); }
  int num_outputs() const override { return widths_.back(); }
  int num_weights() const override { return offsets_.back(); }
  int num_layers() const { return static_cast<int>(widths_.size()) - 1; }
  const std::vector<int>& widths() const { return widths_; }
  Activation hidden_activation() const { return hidden_; }

  // The first weight of layer l = 0 .. num_layers() - 1, and the number of its
  // weights.
  int offset(int layer) const { return offsets_[layer]; }
  int layer_size(int layer) const {
    return offsets_[layer + 1] - offsets_[layer];
  }

  // Layer l of `weights`: (widths[l] + 1) x widths[l + 1], one column per unit,
  // with the bias as last entry.
  Eigen::Map<const Eigen::MatrixXd> LayerWeights(
      int layer, const Eigen::VectorXd& weights) const;

  // Drawn layer after layer: the matrix of a layer row by row, like
  // np.random.uniform(-s, s, (fan_out, fan_in)), then its biases.
  Eigen::VectorXd InitialWeights(Initialization initialization,
                                 NumpyRandom* random) const override;

  // The neurons.
  std::vector<int> WeightBlocks() const override;

  // Values of the forward pass for the derivatives. Layer l = 0 .. L - 1. Jets
  // have B T columns in place of B, and the ones of the last row are the jets
  // (1, 0, .., 0).
  struct Activations final : Pass {
    // inputs[l]: (widths[l] + 1) x B, a_l with a last row of ones, whose weight
    // is the bias.
    std::vector<Eigen::MatrixXd> inputs;
    // slopes[l]: widths[l + 1] x B, phi'(z); empty for the last layer.
    std::vector<Eigen::MatrixXd> slopes;
    // curvatures[l]: phi''(z), of the same size; only with want_curvatures.
    std::vector<Eigen::MatrixXd> curvatures;
    // Of the channels.
    std::shared_ptr<const DerivativeSet> derivatives = DerivativeSet::Values();
  };
  std::unique_ptr<Pass> NewPass() const override {
    return std::make_unique<Activations>();
  }
  bool Forward(const Eigen::VectorXd& weights,
               const Eigen::MatrixXd& inputs,
               Derivatives derivatives,
               Pass* pass,
               std::string* error) const override;
  void Forward(const Eigen::VectorXd& weights,
               const Eigen::MatrixXd& inputs,
               bool want_curvatures,
               Activations* activations) const;

  // The same for the jets of the inputs: |a| x B T. Of ReLU, whose second
  // derivative is zero almost everywhere, only of order one (CHECKed).
  void ForwardJets(const Eigen::VectorXd& weights,
                   const std::shared_ptr<const DerivativeSet>& derivatives,
                   const Eigen::Ref<const Eigen::MatrixXd>& input_jets,
                   bool want_curvatures,
                   Activations* activations) const;

  // With jets, output covectors and tangents have B T columns.
  void Backward(const Eigen::VectorXd& weights,
                const Pass& pass,
                const Eigen::MatrixXd& output_covectors,
                Eigen::VectorXd* gradient) const override;
  void Tangent(const Eigen::VectorXd& weights,
               const Pass& pass,
               const Eigen::VectorXd& weight_tangent,
               Eigen::MatrixXd* output_tangents) const override;

  // Not for jets (CHECKed).
  void Factors(const Eigen::VectorXd& weights,
               const Pass& pass,
               const Eigen::MatrixXd& output_covectors,
               SampledFactors* factors) const override;
  std::vector<LayerColumns> FactorLayers() const override;

  // The last layer, at one position.
  LayerColumns OutputLayer() const override;
  Eigen::MatrixXd Features(const Eigen::VectorXd& weights,
                           const Pass& pass) const override;

  // The Jacobians dx/da: |a| x B |x|, column s |x| + i is the derivative of
  // x_{s,i} with respect to a_s. Cost: 2 n B |x|. Not for jets (CHECKed).
  void InputJacobians(const Eigen::VectorXd& weights,
                      const Activations& activations,
                      Eigen::MatrixXd* jacobians) const;

  bool InputJacobian(const Eigen::VectorXd& weights,
                     const Eigen::VectorXd& input,
                     Eigen::VectorXd* outputs,
                     Eigen::MatrixXd* jacobian,
                     std::string* error) const override;

  // below = the covectors of z_{l-1} for the covectors `above` of z_l, l >= 1.
  // Each sample has any number of covectors side by side, and a covector
  // `calls` columns, for as many adjacent columns of the activations.
  void BackwardThroughLayer(int layer,
                            const Eigen::VectorXd& weights,
                            const Activations& activations,
                            int calls,
                            const Eigen::MatrixXd& above,
                            Eigen::MatrixXd* below) const;

  // H = sum_s [J_s^T X_s J_s + sum_i w_{i,s} d2f_i/dtheta2] (n x n, symmetric):
  // the exact Hessian of sum_s F_s(f(a_s)) with respect to the weights, given
  // the covectors w_s = dF_s/dx and the Hessians X_s = d2F_s/dx2. One
  // tangent-of-backward pass per unit (and channel) suffices, because the
  // tangent of a weight is the tangent of its unit's z times the weight's
  // input. Needs curvatures. X_s is |x| x |x|, |x| = widths[L] T with jets.
  void Hessian(const Eigen::VectorXd& weights,
               const Activations& activations,
               const Eigen::MatrixXd& output_covectors,
               const std::vector<Eigen::MatrixXd>& output_hessians,
               Eigen::MatrixXd* hessian) const;

  // "4-20-20-20-24 tanh"
  std::string Name() const override;

 private:
  class HessianPass;

  void RunLayers(const Eigen::VectorXd& weights,
                 const Eigen::Ref<const Eigen::MatrixXd>& inputs,
                 bool want_curvatures,
                 Activations* activations) const;
  // z = W_l a + beta z, with the bias if `a` has the row of ones.
  void ApplyLayer(int layer,
                  const Eigen::VectorXd& weights,
                  const Eigen::MatrixXd& a,
                  double beta,
                  const Eigen::Ref<Eigen::MatrixXd>& z) const;
  // a_bar = W_l^T z_bar, without the bias.
  void ApplyLayerTransposed(int layer,
                            const Eigen::VectorXd& weights,
                            const Eigen::MatrixXd& z_bar,
                            const Eigen::Ref<Eigen::MatrixXd>& a_bar) const;

  std::vector<int> widths_;
  Activation hidden_;
  std::vector<int> offsets_;  // L + 1
};

// A dense network as a Ceres functor, with weights and inputs of any scalar
// type. Use it for a network inside an autodiff functor. For derivatives with
// respect to more than a few hundred weights use Model or DenseNetwork, which
// are much faster.
//
//   x = f(a; theta)
//
// Shapes:  weights: n, laid out as in DenseNetwork;  inputs: |a|;
//          outputs: |x|.
// Cost:    2 n operations on T.
class NetworkFunctor {
 public:
  explicit NetworkFunctor(DenseNetwork network)
      : network_(std::move(network)) {}

  template <typename T>
  bool operator()(const T* weights, const T* inputs, T* outputs) const {
    const std::vector<int>& widths = network_.widths();
    std::vector<T> below(inputs, inputs + widths[0]);
    std::vector<T> above;
    for (int l = 0; l < network_.num_layers(); ++l) {
      const bool is_hidden = l + 1 < network_.num_layers();
      const T* weight = weights + network_.offset(l);
      above.clear();
      for (int unit = 0; unit < widths[l + 1]; ++unit) {
        T z(0.0);
        for (const T& a : below) z += *weight++ * a;
        z += *weight++;  // the bias
        above.push_back(is_hidden ? Activate(network_.hidden_activation(), z)
                                  : z);
      }
      below.swap(above);
    }
    for (const T& x : below) *outputs++ = x;
    return true;
  }

 private:
  DenseNetwork network_;
};

// Inputs of mean 0 and standard deviation 1, for training, and the same network
// for the inputs as they are. Activations saturate where inputs are much larger
// than 1, and no rule learns then.
//
//   b_i = (a_i - mean_i) / deviation_i      W a + c = W_1 b + c_1:
//   W = W_1 diag(1 / deviation),   c = c_1 - W mean
//
//   const InputScales scales = InputScales::Of(inputs);
//   TrainResult result = Train(model, {scales.Apply(inputs), targets}, method);
//   const Eigen::VectorXd weights = scales.Unscaled(network, result.weights);
//
// Shapes:  inputs: |a| x N, a column a sample.
// Fails:   never. A constant input has the deviation 1; an input is constant if
//          its values differ by less than 1e-12 of the largest.
struct InputScales {
  Eigen::VectorXd mean;
  Eigen::VectorXd deviation;

  static InputScales Of(const Eigen::MatrixXd& inputs);
  Eigen::MatrixXd Apply(const Eigen::MatrixXd& inputs) const;
  // The weights for inputs a that do what `weights` do for inputs b.
  Eigen::VectorXd Unscaled(const DenseNetwork& network,
                           const Eigen::VectorXd& weights) const;
};

// A trained network, architecture and weights, in one text file that a program
// can load. `compare` writes it as network.txt beside the weights of each run.
//
//   invgrad network 1
//   widths 4 20 20 20 24
//   activation tanh
//   weights 1444
//   -0.26128751     one a line, in the order of DenseNetwork, each with as
//   ...             many digits as give back the same double
//
// In numpy: np.loadtxt("network.txt", skiprows=4). Inputs and outputs have the
// units of the problem that the network was trained on.
//
// Cost:    20 bytes a weight.
// Fails:   returns false (nothing), with a message that names the file and the
//          error; *weights is then unchanged. ReadNetwork rejects truncated
//          files, inconsistent sizes and weights that are not finite, as after
//          diverged training; it never allocates more than a few times the
//          file's size. WriteNetwork CHECKs the number of weights.

// Writes atomically (atomic_file.h), also weights that are not finite.
bool WriteNetwork(const std::string& path,
                  const DenseNetwork& network,
                  const Eigen::VectorXd& weights,
                  std::string* error);

std::optional<DenseNetwork> ReadNetwork(const std::string& path,
                                        Eigen::VectorXd* weights,
                                        std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_DENSE_NETWORK_H_
