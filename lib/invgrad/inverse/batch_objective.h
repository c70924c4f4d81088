// The objective of one training step: the loss of a model on a batch, or the
// proxy of a pull-back through the model (chain_pull_back.h).
//
// A step is one Linearize and updates_per_step() updates of the weights. Before
// each further update the objective is linearized again, on the same batch.
#ifndef INVGRAD_INVERSE_BATCH_OBJECTIVE_H_
#define INVGRAD_INVERSE_BATCH_OBJECTIVE_H_

#include <string>
#include <utility>

#include "Eigen/Core"
#include "invgrad/chain/model.h"
#include "invgrad/inverse/output_layer_problem.h"
#include "invgrad/inverse/pull_back_counts.h"

namespace invgrad {

class BatchObjective {
 public:
  virtual ~BatchObjective() = default;

  // Begins a step. The cost is the model's loss on the batch.
  virtual bool Linearize(const Eigen::VectorXd& weights,
                         const DataSet& batch,
                         const LinearizationParts& parts,
                         Linearization* linearization,
                         std::string* error) = 0;

  // Linearizes again within a step, at other weights. The cost is that of the
  // objective itself: for a proxy, the cost of the proxy.
  virtual bool LinearizeAgain(const Eigen::VectorXd& weights,
                              const DataSet& batch,
                              const LinearizationParts& parts,
                              Linearization* linearization,
                              std::string* error) {
    return Linearize(weights, batch, parts, linearization, error);
  }

  // The least-squares problem of the best change of the network's output layer,
  // on samples that need not be those of the step. Returns false, with *error,
  // if it has no finite value.
  virtual bool LinearizeOutputLayer(const Eigen::VectorXd& /*weights*/,
                                    const DataSet& /*samples*/,
                                    OutputLayerProblem* /*problem*/,
                                    std::string* error) {
    *error = "this objective does not solve the output layer";
    return false;
  }

  // Whether the objective is a proxy of the loss.
  virtual bool is_proxy() const { return false; }
  virtual int updates_per_step() const { return 1; }
  // How the samples were pulled back; null without a pull-back.
  virtual PullBackCounts* mutable_counts() { return nullptr; }
};

// The loss of the model itself.
class ModelObjective final : public BatchObjective {
 public:
  explicit ModelObjective(Model model) : model_(std::move(model)) {}

  bool Linearize(const Eigen::VectorXd& weights,
                 const DataSet& batch,
                 const LinearizationParts& parts,
                 Linearization* linearization,
                 std::string* error) override {
    return model_.Linearize(weights, batch, parts, linearization, error);
  }
  bool LinearizeOutputLayer(const Eigen::VectorXd& weights,
                            const DataSet& samples,
                            OutputLayerProblem* problem,
                            std::string* error) override {
    return LinearizeLossInOutputLayer(model_, weights, samples, problem, error);
  }

 private:
  const Model model_;
};

}  // namespace invgrad

#endif  // INVGRAD_INVERSE_BATCH_OBJECTIVE_H_
