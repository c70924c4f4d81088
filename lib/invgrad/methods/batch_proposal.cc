#include "invgrad/methods/batch_proposal.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "invgrad/internal/logging.h"
#include "invgrad/methods/phase_objective.h"
#include "invgrad/update_rule.h"

namespace invgrad {
namespace {

// A ProposalFunction is copied; copies share the rule and its memory.
class BatchProposal {
 public:
  BatchProposal(const Model& model, DataSet data, const double* weights)
      : model_(model), data_(std::move(data)), num_weights_(0) {
    for (const int size : model_.network().WeightBlocks()) {
      blocks_.push_back({weights + num_weights_, size});
      num_weights_ += size;
    }
  }
  BatchProposal(const BatchProposal&) = delete;
  BatchProposal& operator=(const BatchProposal&) = delete;

  bool Start(const Phase& phase,
             std::shared_ptr<const InverseSimulator> inverse,
             std::string* error) {
    rule_ = phase.MakeRule();
    objective_ = MakePhaseObjective(phase,
                                    rule_.get(),
                                    model_,
                                    data_,
                                    std::move(inverse),
                                    /*communicator=*/nullptr,
                                    error);
    return objective_ != nullptr &&
           (objective_->is_proxy() ||
            model_.CanLinearize(rule_->Needs(), error));
  }

  bool Propose(const ProblemState& x, ProblemState* candidate) {
    Eigen::VectorXd weights(num_weights_);
    double* weight = weights.data();
    for (const Block& block : blocks_) {
      weight = std::copy_n(x(block.values), block.size, weight);
    }
    Linearization at_weights;
    std::string error;
    const auto undo = [&](const Eigen::VectorXd& before) { weights = before; };
    if (!objective_->Linearize(
            weights, data_, rule_->Needs(), &at_weights, &error) ||
        !MakeUpdates(data_,
                     undo,
                     objective_.get(),
                     rule_.get(),
                     &at_weights,
                     &weights,
                     &error)) {
      VLOG(1) << error;
      return false;
    }
    const double* moved = weights.data();
    for (const Block& block : blocks_) {
      if (!x.is_constant(block.values)) {
        std::copy_n(moved, block.size, (*candidate)(block.values));
      }
      moved += block.size;
    }
    return true;
  }

 private:
  struct Block {
    const double* values;
    int size;
  };

  const Model model_;
  const DataSet data_;
  std::vector<Block> blocks_;
  int num_weights_;
  std::unique_ptr<UpdateRule> rule_;
  std::unique_ptr<BatchObjective> objective_;
};

}  // namespace

ProposalFunction MakeBatchProposal(
    const Phase& phase,
    const Model& model,
    const DataSet& data,
    const double* weights,
    std::shared_ptr<const InverseSimulator> inverse,
    std::string* error) {
  const auto proposal = std::make_shared<BatchProposal>(model, data, weights);
  if (!proposal->Start(phase, std::move(inverse), error)) return nullptr;
  return [proposal](const ProblemState& x, ProblemState* candidate) {
    return proposal->Propose(x, candidate);
  };
}

ProposalFunction ScaleInvariantProposal(
    const Model& model,
    const DataSet& data,
    const double* weights,
    std::shared_ptr<const InverseSimulator> inverse,
    const std::string& method,
    std::string* error) {
  Method parsed;
  if (!ParseMethod("ceres_lm+" + method, &parsed, error)) return nullptr;
  const Phase& phase = parsed.last_phase();
  if (phase.pull_back == nullptr) {
    *error =
        "'" + method +
        "' pulls nothing back: wanted LOSS/SIMULATOR/RULE, or sip; for the "
        "steps of a rule give the rule to UpdateCallback";
    return nullptr;
  }
  return MakeBatchProposal(
      phase, model, data, weights, std::move(inverse), error);
}

}  // namespace invgrad
