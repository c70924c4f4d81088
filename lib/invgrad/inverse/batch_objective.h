// The objective of one training step: the loss of a model on a batch, or the
// proxy of a pull-back through the model (chain_pull_back.h).
//
// A step is one Prepare, one Linearize, and updates_per_step() updates of the
// weights. Before each further update the objective is linearized again, on the
// same batch. A decorator may keep some of the weights at their best values, which
// a rule then does not see (output_layer/reduced_objective.h).
#ifndef INVGRAD_INVERSE_BATCH_OBJECTIVE_H_
#define INVGRAD_INVERSE_BATCH_OBJECTIVE_H_

#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "invgrad/inverse/output_layer_problem.h"
#include "invgrad/inverse/pull_back_counts.h"
#include "invgrad/model.h"

namespace invgrad {

class BatchObjective {
 public:
  virtual ~BatchObjective() = default;

  // Before step k = 0, 1, .. of a phase, `spent` the share of its budget, may
  // change weights that the rule does not move. Returns false, with *error, if
  // they have no finite values.
  virtual bool Prepare(long /*k*/,
                       double /*spent*/,
                       const DataSet& /*batch*/,
                       Eigen::VectorXd* /*weights*/,
                       std::string* /*error*/) {
    return true;
  }

  // Linearizes. The cost is the model's loss on the batch. The derivatives are
  // those of the Unknowns.
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

  // What a rule moves: by default all weights.
  virtual Eigen::VectorXd Unknowns(const Eigen::VectorXd& weights) const {
    return weights;
  }

  // The weights after a step of the rule on the batch. Returns false, with
  // *error, if weights that the rule does not move have no finite values; the
  // step is then taken without them.
  virtual bool Plus(const Eigen::VectorXd& step,
                    const DataSet& /*batch*/,
                    Eigen::VectorXd* weights,
                    std::string* /*error*/) {
    *weights += step;
    return true;
  }

  // The weights that a run reports for `weights`.
  virtual Eigen::VectorXd Finished(const Eigen::VectorXd& weights) {
    return weights;
  }

  // Whether further steps do not pay, after the last Prepare.
  virtual bool HasStalled() const { return false; }

  // What a checkpoint must hold; the arrays keep their sizes.
  virtual std::vector<Eigen::VectorXd*> MutableState() { return {}; }

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
