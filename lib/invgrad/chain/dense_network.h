// A fully connected network: the map f from network input to simulator input,
// evaluated and differentiated for a whole batch at a time.
//
//   a_0 = a,   z_l = W_l a_{l-1} + b_l,   a_l = phi(z_l),   x = z_L
//
// or, where the physics is a differential equation in a, with its derivatives
// in the input: every quantity is then a 2-jet (two_jet.h) with T = |a| + 2
// columns a sample in place of one,
//
//   x = (f, d_1 f, .., d_|a| f, Lap f)
//
// The same functions differentiate both in the weights.
//
// Shapes:  widths: L + 1 numbers, widths[0] = |a|, widths[L] = |x|;
//          batches have one column a sample;
//          weights: n = sum_l widths[l] (widths[l-1] + 1), one vector. Layer
//          after layer, and in a layer unit after unit: the unit's incoming
//          weights, then its bias. In numpy: hstack([W, b[:, None]]).ravel()
//          for each layer.
// Cost:    forward 2 n B; the backward pass twice that; the Hessian n^2 B. With
//          jets T times as much, the Hessian T^2 times. Batches go through
//          BLAS, nothing is allocated a sample.
// Fails:   never: values that are not finite propagate. Sizes that do not fit
//          are CHECKed.
// The network is a description: weights are an argument, never a member.
#ifndef INVGRAD_CHAIN_DENSE_NETWORK_H_
#define INVGRAD_CHAIN_DENSE_NETWORK_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/chain/activation.h"

namespace invgrad {

class NumpyRandom;

// How weights are drawn (biases are zero but for kPytorch), layer after layer:
// a layer's matrix row by row, as np.random.uniform(-s, s, (fan_out, fan_in))
// does, then its biases.
//   kGlorotUniform  U(-s, s), s = sqrt(6 / (fan_in + fan_out))   (Keras)
//   kHeUniform      U(-s, s), s = sqrt(6 / fan_in)
//   kPytorch        U(-s, s), s = 1 / sqrt(fan_in), biases too   (nn.Linear)
enum class Initialization { kGlorotUniform, kHeUniform, kPytorch };

class DenseNetwork {
 public:
  // At least two widths, all positive, and no more weights than an int can
  // number (CHECKed). `hidden` acts on every layer but the last, which is
  // linear.
  DenseNetwork(std::vector<int> widths, Activation hidden);

  // n, as a double: no widths overflow it.
  static double CountWeights(const std::vector<int>& widths);

  int num_inputs() const { return widths_.front(); }
  int num_outputs() const { return widths_.back(); }
  int num_weights() const { return offsets_.back(); }
  int num_layers() const { return static_cast<int>(widths_.size()) - 1; }
  const std::vector<int>& widths() const { return widths_; }
  Activation hidden_activation() const { return hidden_; }

  // The first weight of layer l = 0 .. num_layers() - 1, and the number of its
  // weights.
  int offset(int layer) const { return offsets_[layer]; }
  int layer_size(int layer) const {
    return offsets_[layer + 1] - offsets_[layer];
  }

  // That layer of `weights`: (widths[l] + 1) x widths[l + 1], a column a unit,
  // whose last entry is the bias.
  Eigen::Map<const Eigen::MatrixXd> LayerWeights(
      int layer, const Eigen::VectorXd& weights) const;

  Eigen::VectorXd InitialWeights(Initialization initialization,
                                 NumpyRandom* random) const;

  // The forward pass's values for the derivatives. Layer l = 0 .. L - 1.
  struct Activations {
    // inputs[l]: (widths[l] + 1) x B, a_l with a last row of ones: the bias
    // is the weight of the one.
    std::vector<Eigen::MatrixXd> inputs;
    // slopes[l]: widths[l + 1] x B, phi'(z); empty for the last layer.
    std::vector<Eigen::MatrixXd> slopes;
    // curvatures[l]: phi''(z) likewise; only with want_curvatures.
    std::vector<Eigen::MatrixXd> curvatures;
    Eigen::MatrixXd outputs;  // widths[L] x B: x
    // T: 1, or after ForwardJets the channels of a jet. Then B T columns take
    // the place of B, and the ones of the last row are jets, (1, 0, .., 0).
    int num_channels = 1;

    int batch_size() const { return static_cast<int>(outputs.cols()); }
  };
  void Forward(const Eigen::VectorXd& weights,
               const Eigen::MatrixXd& inputs,
               bool want_curvatures,
               Activations* activations) const;

  // The same with derivatives in the input. Not for ReLU, whose Laplacian is
  // zero wherever it has one (CHECKed).
  void ForwardJets(const Eigen::VectorXd& weights,
                   const Eigen::MatrixXd& inputs,
                   bool want_curvatures,
                   Activations* activations) const;

  // gradient = sum_s J_s^T w_s (n), for output covectors w: widths[L] x B (of
  // jets B T, here and below).
  void Backward(const Eigen::VectorXd& weights,
                const Activations& activations,
                const Eigen::MatrixXd& output_covectors,
                Eigen::VectorXd* gradient) const;

  // The Jacobians of the outputs in the inputs: |a| x B |x|, column s |x| + i
  // is the derivative of x_{s,i} in a_s. Takes 2 n B |x|. Not of jets
  // (CHECKed).
  void InputJacobians(const Eigen::VectorXd& weights,
                      const Activations& activations,
                      Eigen::MatrixXd* jacobians) const;

  // Output tangents J_s v (widths[L] x B) of one weight tangent v (n).
  void Tangent(const Eigen::VectorXd& weights,
               const Activations& activations,
               const Eigen::VectorXd& weight_tangent,
               Eigen::MatrixXd* output_tangents) const;

  // H = sum_s [J_s^T X_s J_s + sum_i w_{i,s} d2f_i/dtheta2] (n x n, symmetric):
  // the exact Hessian in the weights of sum_s F_s(f(a_s)), given the covectors
  // w_s = dF_s/dx and the Hessians X_s = d2F_s/dx2. One tangent-of-backward
  // pass a unit (and channel), not a weight: a weight moves its unit's z in
  // proportion to its input, so its tangent is the unit's, scaled sample by
  // sample. Needs curvatures. X_s is |x| x |x|, |x| = widths[L] T with jets.
  void Hessian(const Eigen::VectorXd& weights,
               const Activations& activations,
               const Eigen::MatrixXd& output_covectors,
               const std::vector<Eigen::MatrixXd>& output_hessians,
               Eigen::MatrixXd* hessian) const;

  // "4-20-20-20-24 tanh"
  std::string Name() const;

 private:
  // From inputs[0] on, but for its ones.
  void RunLayers(const Eigen::VectorXd& weights,
                 bool want_curvatures,
                 Activations* activations) const;

  std::vector<int> widths_;
  Activation hidden_;
  std::vector<int> offsets_;  // L + 1
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_DENSE_NETWORK_H_
