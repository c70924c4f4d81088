// Pulls a wanted change back through loss and simulator of a batch and
// linearizes the network alone: scale-invariant physics training and variants.
//
//   d_y = loss pull-back,   d_x = simulator pull-back,   x~ = x + d_x constant
//   L2 proxy   scale sum_s w_s 1/2 |f(a_s; theta) - x~_s|^2
//   L1 proxy   scale sum_s w_s |f(a_s; theta) - x~_s|_1
//
// An update rule then linearizes the proxy: y = x, J = dx/dtheta, g = the
// proxy's gradient in x, H_L = its Hessian. With a first-order rule this is
// scale-invariant physics training; a spectral rule also inverts the network.
//
// Curvature weights: an inverse gives all samples the same weight, although
// their x may affect the loss very differently. With c_s = d_y . H_L
// d_y / |d_x|^2, the curvature of the loss along d_x,
//
//   w_s = c_s^gamma / mean(c^gamma)
//
// where the mean is over the samples that move; the others have weight one. A
// negative c_s counts as zero, and |d_x| is taken before the cut to max_change.
// With gamma = 1 the L2 proxy agrees with the loss to second order along every
// d_x; gamma = 0 (w = 1) is the published method.
//
// With the data's solutions x*, d_x += data_weight (x* - x) is the gradient
// step of an additional data_weight / 2 |x - x*|^2, often called
// physics-informed loss; the way `data` sets x~ = x*, without a pull-back
// (supervised training).
//
// With feedback (model.h) x holds the network's outputs of all calls, and the
// network's inputs, the states at these calls, are constant. Only the way
// `adjoint` closes the loop: there the later states and outputs depend on each
// output.
//
// Shapes:  x: |x| B, sample by sample;  scale: the model's BatchScale.
// Cost:    a forward and a backward pass of the network and one simulator
//          pull-back a sample, one sample at a time, on the model's threads.
//          LinearizeAgain does not evaluate the simulator.
// Fails:   Linearize returns false with a message that names the sample if the
//          network, simulator or loss has no finite value. A sample without a
//          pull-back does not move (PullBackCounts).
//
// Source:  Holl, Koltun, Thuerey. Scale-invariant Learning by Physics
//          Inversion. NeurIPS 2022, algorithm 1; PBDL, chapters physgrad-nn and
//          physgrad-discuss (the weights answer its remark on curvature).
#ifndef INVGRAD_INVERSE_CHAIN_PULL_BACK_H_
#define INVGRAD_INVERSE_CHAIN_PULL_BACK_H_

#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/internal/communicator.h"
#include "invgrad/inverse/batch_objective.h"
#include "invgrad/inverse/loss_pull_back.h"
#include "invgrad/inverse/pull_back_counts.h"
#include "invgrad/inverse/simulator_pull_back.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/model.h"

namespace invgrad {

class ChainPullBack final : public BatchObjective {
 public:
  enum class Proxy { kL2, kL1 };

  struct Options {
    LossWay loss = LossWay::kNewton;
    double y_step_size = 1.0;  // eta
    SimulatorPullBack::Options simulator;
    Proxy proxy = Proxy::kL2;
    double curvature_weight = 0.0;  // gamma in [0, 1]
    // A longer d_x, with the data term, is scaled to this length; not for the
    // way data.
    double max_change = std::numeric_limits<double>::infinity();
    double data_weight = 0.0;
    int updates_per_evaluation = 1;
    // Not null: the batches are pieces, one a rank, of a batch over which the
    // weights w and the counts are computed.
    const Communicator* communicator = nullptr;
  };

  // `inverse` as for SimulatorPullBack; the way joint is CHECKed. The model
  // must outlive this object.
  ChainPullBack(const Model* model,
                std::shared_ptr<const InverseSimulator> inverse,
                const Options& options);

  // Linearizes the proxy like Model::Linearize; the cost is the loss of the
  // batch.
  bool Linearize(const Eigen::VectorXd& weights,
                 const DataSet& batch,
                 const LinearizationParts& parts,
                 Linearization* linearization,
                 std::string* error) override;

  // Linearizes at other weights, with the x~ and the batch of the last
  // Linearize; the cost is that of the proxy.
  bool LinearizeAgain(const Eigen::VectorXd& weights,
                      const DataSet& batch,
                      const LinearizationParts& parts,
                      Linearization* linearization,
                      std::string* error) override;

  // In x, towards x~. Does not count.
  bool LinearizeOutputLayer(const Eigen::VectorXd& weights,
                            const DataSet& samples,
                            OutputLayerProblem* problem,
                            std::string* error) override;

  bool is_proxy() const override { return true; }
  int updates_per_step() const override {
    return options_.updates_per_evaluation;
  }
  const PullBackCounts& counts() const { return counts_; }
  PullBackCounts* mutable_counts() override { return &counts_; }

 private:
  bool is_supervised() const {
    return options_.simulator.way == SimulatorWay::kData;
  }
  bool Forward(const Eigen::VectorXd& weights,
               const DataSet& batch,
               const LinearizationParts& parts,
               std::string* error);
  // pass_ of a DenseNetwork.
  DenseNetwork::Activations& Activations() {
    return dynamic_cast<DenseNetwork::Activations&>(*pass_);
  }
  struct Sample {
    double loss = 0.0;
    double curvature = 0.0;  // c
    SimulatorPullBack::Result result;
    std::string error;  // empty: none
  };
  bool PullBackSamples(const DataSet& batch,
                       std::vector<Sample>* samples,
                       std::string* error);
  // Adds the samples of the other ranks. Returns false on all ranks if `ok` is
  // false on one.
  bool GatherSamples(bool ok,
                     const DataSet& batch,
                     std::vector<Sample>* samples,
                     std::string* error) const;
  // Computes d_x of one sample.
  Sample PullBackSample(const InverseSimulator::ConstVectorRef& x,
                        const DataSet& batch,
                        int s);
  // From the samples of the whole batch.
  void SetWeights(const DataSet& batch, const std::vector<Sample>& samples);
  // Linearizes the proxy at the weights of pass_.
  bool LinearizeProxy(const Eigen::VectorXd& weights,
                      const DataSet& batch,
                      const LinearizationParts& parts,
                      Linearization* linearization,
                      std::string* error);

  const Model& model_;
  Options options_;
  LossPullBack loss_pull_back_;
  std::optional<SimulatorPullBack> simulator_pull_back_;  // not for data

  PullBackCounts counts_;
  // Values of the last batch; the next batch reuses the memory.
  std::unique_ptr<Network::Pass> pass_;
  Eigen::MatrixXd d_x_;             // |x| x B
  Eigen::MatrixXd wanted_x_;        // |x| x B: x~
  Eigen::VectorXd sample_weights_;  // B: w
};

}  // namespace invgrad

#endif  // INVGRAD_INVERSE_CHAIN_PULL_BACK_H_
