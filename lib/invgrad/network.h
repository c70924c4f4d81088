// A network with weights: the map f from network input to simulator input, with
// first derivatives, for a whole batch at a time.
//
//   x = f(a; theta),   J = dx/dtheta
//
// The chain, the pull-backs and all rules that need only products with J work
// with any network. Exact output layers and K-FAC need interfaces that a network
// may also implement (network_layers.h). DenseNetwork (dense_network.h) does, and
// also has the factors of J, from which the exact joint rules and Newton's
// method are computed, the derivatives with respect to its input, and loops over
// time. Networks of libtorch: invgrad/torch_network.h.
//
// Shapes:  theta: n = num_weights;  a: num_inputs x B, x: num_outputs x B, one
//          column a sample.
// The network is a description: weights are an argument, never a member.
// Samples may depend on each other (batch normalization): J is the Jacobian of
// the whole batch.
#ifndef INVGRAD_NETWORK_H_
#define INVGRAD_NETWORK_H_

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"

namespace invgrad {

class NumpyRandom;

// The distribution of the initial weights (biases are zero except for
// kPytorch).
//   kGlorotUniform  U(-s, s), s = sqrt(6 / (fan_in + fan_out))   (Keras)
//   kHeUniform      U(-s, s), s = sqrt(6 / fan_in)
//   kPytorch        U(-s, s), s = 1 / sqrt(fan_in), biases too   (nn.Linear)
enum class Initialization { kGlorotUniform, kHeUniform, kPytorch };

class Network {
 public:
  virtual ~Network() = default;

  virtual int num_inputs() const = 0;
  virtual int num_outputs() const = 0;
  virtual int num_weights() const = 0;

  // What determines f, for messages and to recognize a run: "4-20-24 tanh".
  virtual std::string Name() const = 0;

  // Weights to begin with. A network that defines its own distribution ignores
  // `initialization`.
  virtual Eigen::VectorXd InitialWeights(Initialization initialization,
                                         NumpyRandom* random) const = 0;

  // Sizes of the groups of weights that belong together, such as those of a
  // neuron; their sum is n.
  virtual std::vector<int> WeightBlocks() const = 0;

  // Estimated memory of a Pass, Backward and Tangent, for a column of inputs; 0:
  // not known.
  double bytes_per_column() const { return bytes_per_column_; }

  // Whether an output may depend on the other samples of a batch (batch
  // normalization).
  virtual bool couples_samples() const { return false; }

  // The derivatives that a pass is used for.
  enum class Derivatives { kNone, kFirst, kSecond };

  // What a forward pass keeps for the derivatives.
  struct Pass {
    Pass() = default;
    Pass(const Pass&) = default;
    Pass(Pass&&) = default;
    Pass& operator=(const Pass&) = default;
    Pass& operator=(Pass&&) = default;
    virtual ~Pass() = default;

    Eigen::MatrixXd outputs;  // num_outputs x columns: x
    // Adjacent columns that belong to one call of the network; 1, or the number
    // of channels of a jet (derivative_set.h).
    int num_channels = 1;

    int num_columns() const { return static_cast<int>(outputs.cols()); }
  };
  virtual std::unique_ptr<Pass> NewPass() const = 0;

  // Overwrites *pass, an object of NewPass whose memory is reused. Returns
  // false, with *error set, if there are no outputs; outputs that are not
  // finite are no failure.
  virtual bool Forward(const Eigen::VectorXd& weights,
                       const Eigen::MatrixXd& inputs,
                       Derivatives derivatives,
                       Pass* pass,
                       std::string* error) const = 0;

  // x for inputs a; empty, with a logged message, if there are no outputs.
  Eigen::MatrixXd Outputs(const Eigen::VectorXd& weights,
                          const Eigen::MatrixXd& inputs) const;

  // gradient = J^T w (n), for output covectors w: num_outputs x columns. NaN if
  // it fails.
  virtual void Backward(const Eigen::VectorXd& weights,
                        const Pass& pass,
                        const Eigen::MatrixXd& output_covectors,
                        Eigen::VectorXd* gradient) const = 0;

  // Output tangents J v (num_outputs x columns) of one weight tangent v (n).
  // NaN if it fails.
  virtual void Tangent(const Eigen::VectorXd& weights,
                       const Pass& pass,
                       const Eigen::VectorXd& weight_tangent,
                       Eigen::MatrixXd* output_tangents) const = 0;

 protected:
  void set_bytes_per_column(double bytes) { bytes_per_column_ = bytes; }

 private:
  double bytes_per_column_ = 0.0;
};

}  // namespace invgrad

#endif  // INVGRAD_NETWORK_H_
