// The objective of a training step on a batch that the ranks of a run share.
//
//   rank r linearizes the objective on its share of the samples;
//   L = sum_r L_r,   gradient and Hessian likewise,   g = [g_r],   J = [J_r]
//
// Cost, gradient, g, products with H_L and J and the loss on a curve of outputs
// are the same on all ranks, and so are the steps that a rule computes from
// them. They are those of one process up to rounding, and for a given number of
// ranks the same bits in every run.
//
// Cost:    a rank sends 2 (1 + n) numbers for a gradient, and for a Jacobian
//          its rows of g N - 1 times; see distributed_jacobian.h. For a point
//          of a curve of outputs, 3 numbers N - 1 times.
// Fails:   on all ranks, with the message of the first rank that fails.
#ifndef INVGRAD_DISTRIBUTED_DISTRIBUTED_OBJECTIVE_H_
#define INVGRAD_DISTRIBUTED_DISTRIBUTED_OBJECTIVE_H_

#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/internal/communicator.h"
#include "invgrad/inverse/batch_objective.h"
#include "invgrad/model.h"

namespace invgrad {

class DistributedObjective final : public BatchObjective {
 public:
  // Batches have at least as many samples as there are ranks (CHECKed).
  DistributedObjective(std::unique_ptr<BatchObjective> own,
                       std::shared_ptr<const Communicator> communicator);

  bool Linearize(const Eigen::VectorXd& weights,
                 const DataSet& batch,
                 const LinearizationParts& parts,
                 Linearization* linearization,
                 std::string* error) override;
  bool LinearizeAgain(const Eigen::VectorXd& weights,
                      const DataSet& batch,
                      const LinearizationParts& parts,
                      Linearization* linearization,
                      std::string* error) override;
  bool is_proxy() const override { return own_->is_proxy(); }
  int updates_per_step() const override { return own_->updates_per_step(); }
  PullBackCounts* mutable_counts() override { return own_->mutable_counts(); }

 private:
  DataSet OwnPiece(const DataSet& batch) const;
  // The rows of all ranks, for those of this rank's samples.
  Eigen::VectorXd GatherRows(const Eigen::VectorXd& own, int num_samples) const;
  // Completes the linearization of this rank's share; `ok`: whether it
  // succeeded.
  bool Combine(bool ok,
               int num_samples,
               const LinearizationParts& parts,
               Linearization* linearization,
               std::string* error) const;

  std::unique_ptr<BatchObjective> own_;
  std::shared_ptr<const Communicator> communicator_;
};

// Model::Cost of the data, which the ranks share; communicator: null for one
// process. Every rank gets the result.
bool DistributedCost(const Model& model,
                     const Eigen::VectorXd& weights,
                     const DataSet& data,
                     const Communicator* communicator,
                     double* cost,
                     std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_DISTRIBUTED_DISTRIBUTED_OBJECTIVE_H_
