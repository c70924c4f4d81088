// A model is a network, a simulator and a loss in a chain, over a batch. Make
// one to train a network in front of your simulator (train.h), or to linearize
// the chain yourself. For a simulator and a loss without a network use
// minimize.h.
//
//   x_s = f(a_s; theta),   y_s = P(x_s; c_s),   L = scale sum_s L(y_s, y*_s)
//
// with scale = 1/B (kMean) or 1 (kSum). The scale changes half-inverse steps,
// because g = dL/dy contains it.
//
// With feedback (internal/feedback.h) the simulator's loop over time calls the
// network T times a sample, and x_s holds the outputs,
//
//   x_s = (u_0, .., u_{T-1}),   u_t = f(a_{s,t}; theta)
//
// where a_{s,t} is a_s; from the second call on the state s_t replaces its
// first ns entries. The other entries, such as a set point, are the same in all
// calls. Include a reference signal and its generator in the state.
//
// With a DerivativeSet (derivative_set.h) derivatives of the network with
// respect to a point are also inputs of the simulator, and the network's inputs
// are the jets of functions of the point. The residual of a differential
// equation is then a simulator: a function of these derivatives and of the
// sample's context (a physics-informed network),
//
//   x_s = (f, D_1 f, .., D_{T-1} f)(a_s; theta)
//
// Without a network in front of it, a simulator has a WeightsNetwork
// (weights_network.h): x_s = theta.
//
// Shapes:  theta: n; y: |y| B, stacked sample by sample, like g and the rows of
//          J = dy/dtheta. Activations: B columns; with feedback B T, a sample's
//          calls side by side; with jets the same, T = num_channels().
// Cost:    gradient: forward, Adjoint of each sample, backward. Jacobian: one
//          simulator Jacobian a sample; J itself is never formed
//          (network_jacobian.h, chain_jacobian.h). Hessian, not with feedback:
//          one WeightedHessian a sample and DenseNetwork::Hessian. With
//          feedback: T passes in place of one, an input Jacobian of the
//          network, and one CloseLoop a sample. With jets: T passes, for the
//          Hessian T^2. The samples are simulated on num_threads() threads, and
//          four at once where the simulator can (Simulator::WhyNoLanes).
// Fails:   Linearize, Cost and Predict return false if a simulator or loss
//          fails or a value is not finite. The message names the sample (its
//          column in the batch) and the time step of a roll-out. Empty batches
//          and sizes that do not fit are CHECKed.
// Immutable: threads may share a model if they may share its simulator and
//            loss.
#ifndef INVGRAD_MODEL_H_
#define INVGRAD_MODEL_H_

#include <memory>
#include <string>
#include <utility>

#include "Eigen/Core"
#include "invgrad/data.h"
#include "invgrad/dense_network.h"
#include "invgrad/derivative_set.h"
#include "invgrad/internal/feedback.h"
#include "invgrad/linearization.h"
#include "invgrad/loss.h"
#include "invgrad/network.h"
#include "invgrad/simulator.h"

namespace invgrad {

enum class Reduction { kMean, kSum };

class Model {
 public:
  // Sizes must fit (CHECKed): network outputs, times T with derivatives, =
  // simulator inputs, and simulator outputs = loss size.
  //
  // feedback: null, or the loop over time of the same simulator, often the
  // simulator itself. Then T network outputs = T controls = simulator inputs,
  // and the simulator's context is the state at the start.
  // derivatives: null, or the channels of the jets, T for each network input
  // and output; not with feedback. Both need a DenseNetwork.
  Model(std::shared_ptr<const Network> network,
        std::shared_ptr<const Simulator> simulator,
        std::shared_ptr<const Loss> loss,
        Reduction reduction,
        std::shared_ptr<const Feedback> feedback = nullptr,
        std::shared_ptr<const DerivativeSet> derivatives = nullptr);
  Model(DenseNetwork network,
        std::shared_ptr<const Simulator> simulator,
        std::shared_ptr<const Loss> loss,
        Reduction reduction,
        std::shared_ptr<const Feedback> feedback = nullptr,
        std::shared_ptr<const DerivativeSet> derivatives = nullptr)
      : Model(std::make_shared<DenseNetwork>(std::move(network)),
              std::move(simulator),
              std::move(loss),
              reduction,
              std::move(feedback),
              std::move(derivatives)) {}

  // Without feedback.
  Model(DenseNetwork network,
        std::shared_ptr<const Simulator> simulator,
        std::shared_ptr<const Loss> loss,
        Reduction reduction,
        std::shared_ptr<const DerivativeSet> derivatives)
      : Model(std::move(network),
              std::move(simulator),
              std::move(loss),
              reduction,
              nullptr,
              std::move(derivatives)) {}

  const Network& network() const { return *network_; }
  // The network; null if it is of another class.
  const DenseNetwork* dense_network() const { return dense_network_; }
  std::shared_ptr<const Network> shared_network() const { return network_; }
  const Simulator& simulator() const { return *simulator_; }
  const Loss& loss() const { return *loss_; }
  std::shared_ptr<const Simulator> shared_simulator() const {
    return simulator_;
  }
  std::shared_ptr<const Loss> shared_loss() const { return loss_; }
  const Feedback* feedback() const { return feedback_.get(); }  // may be null
  // May be null.
  const std::shared_ptr<const DerivativeSet>& derivatives() const {
    return derivatives_;
  }

  // Calls of the network a sample.
  int num_calls() const {
    return feedback_ == nullptr ? 1 : feedback_->num_calls();
  }
  // The rows of DataSet::inputs: the network's inputs, times T with
  // derivatives.
  int num_inputs() const;
  // T: the columns of a sample in the activations, calls or channels.
  int num_columns() const;

  // The same chain with another loss, or another network.
  Model WithLoss(std::shared_ptr<const Loss> loss, Reduction reduction) const {
    return Model(network_,
                 simulator_,
                 std::move(loss),
                 reduction,
                 feedback_,
                 derivatives_)
        .WithThreads(num_threads_);
  }
  Model WithNetwork(std::shared_ptr<const Network> network) const {
    return Model(std::move(network),
                 simulator_,
                 loss_,
                 reduction_,
                 feedback_,
                 derivatives_)
        .WithThreads(num_threads_);
  }
  Model WithNetwork(DenseNetwork network) const {
    return WithNetwork(std::make_shared<DenseNetwork>(std::move(network)));
  }

  // The same chain, whose samples are simulated on `num_threads` threads: the
  // same bits for any number.
  Model WithThreads(int num_threads) const;
  int num_threads() const { return num_threads_; }

  Reduction reduction() const { return reduction_; }
  int num_weights() const { return network_->num_weights(); }

  // The factor in front of the sum over `num_samples` samples.
  double BatchScale(int num_samples) const;

  // The network's part of the chain. Returns false, with the sample in *error,
  // if an output is not finite or, with feedback, a step fails.
  // `pass` is an object of network().NewPass().
  bool Forward(const Eigen::VectorXd& weights,
               const DataSet& batch,
               Network::Derivatives derivatives,
               Network::Pass* pass,
               std::string* error) const;

  // x: |x| x B, the memory of pass.outputs.
  Eigen::Map<const Eigen::MatrixXd> SimulatorInputs(
      const Network::Pass& pass) const;

  // Closes the loop, in place, for covectors of x at fixed network inputs
  // (x_bar: |x| x B k, k for each sample). Returns false, with the sample in
  // *error, if the simulator has no finite derivative.
  bool CloseLoop(const Eigen::VectorXd& weights,
                 const DataSet& batch,
                 const Network::Pass& pass,
                 Eigen::Ref<Eigen::MatrixXd> x_bar,
                 std::string* error) const;

  // Whether network and simulator give J by its factors (network_jacobian.h);
  // otherwise J is the product of operators (chain_jacobian.h).
  bool has_factors() const {
    return dense_network_ != nullptr && simulator_->forms_jacobian();
  }

  // Returns false, with advice in *error, if Linearize cannot compute the
  // Hessian.
  bool CanLinearize(const LinearizationParts& parts, std::string* error) const;

  // Fills cost and the requested parts; the others are empty.
  bool Linearize(const Eigen::VectorXd& weights,
                 const DataSet& batch,
                 const LinearizationParts& parts,
                 Linearization* linearization,
                 std::string* error) const;

  bool Cost(const Eigen::VectorXd& weights,
            const DataSet& batch,
            double* cost,
            std::string* error) const;

  // y: |y| x N.
  bool Predict(const Eigen::VectorXd& weights,
               const DataSet& batch,
               Eigen::MatrixXd* outputs,
               std::string* error) const;

 private:
  void CheckTargets(const DataSet& batch) const;
  // Linearize for g alone.
  bool LinearizeLoss(const Eigen::VectorXd& weights,
                     const DataSet& batch,
                     Linearization* linearization,
                     std::string* error) const;
  // Linearize for the gradient alone.
  bool LinearizeByAdjoint(const Eigen::VectorXd& weights,
                          const DataSet& batch,
                          Linearization* linearization,
                          std::string* error) const;
  // Linearize at x = theta (weights_network.h), with the Jacobians that the
  // simulator forms.
  bool LinearizeAtWeights(const Eigen::VectorXd& weights,
                          const DataSet& batch,
                          const LinearizationParts& parts,
                          Linearization* linearization,
                          std::string* error) const;
  // Linearize by products with the Jacobians of network and simulator.
  bool LinearizeByProducts(const Eigen::VectorXd& weights,
                           const DataSet& batch,
                           const LinearizationParts& parts,
                           Linearization* linearization,
                           std::string* error) const;
  // Linearize with the simulator's Jacobians.
  bool LinearizeThroughJacobians(const Eigen::VectorXd& weights,
                                 const DataSet& batch,
                                 const LinearizationParts& parts,
                                 Linearization* linearization,
                                 std::string* error) const;

  std::shared_ptr<const Network> network_;
  const DenseNetwork* dense_network_;
  bool is_point_;  // the outputs of the network are its weights
  std::shared_ptr<const Simulator> simulator_;
  std::shared_ptr<const Loss> loss_;
  Reduction reduction_;
  std::shared_ptr<const Feedback> feedback_;
  std::shared_ptr<const DerivativeSet> derivatives_;
  int num_threads_ = 1;
};

}  // namespace invgrad

#endif  // INVGRAD_MODEL_H_
