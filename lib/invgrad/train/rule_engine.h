// An engine that takes the steps of an update rule on mini-batches.
//
//   theta_{k+1} = theta_k + rule(linearization of the objective on batch k)
//
// A batch is `batch_size` consecutive samples of an epoch's order; an
// incomplete last batch is left out. A rule that judges its steps
// (control=gain) receives the cost before and after each step; the engine
// reverts a step that the rule rejects, or after which the next batch has no
// finite loss.
//
// Cost:    one linearization and one step of the rule; a judged step evaluates
//          the objective once more.
// Fails:   kFailed if a batch has no finite loss or the rule has no finite
//          step.
#ifndef INVGRAD_TRAIN_RULE_ENGINE_H_
#define INVGRAD_TRAIN_RULE_ENGINE_H_

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "invgrad/chain/data_set.h"
#include "invgrad/core/update_rule.h"
#include "invgrad/inverse/batch_objective.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/train/engine.h"

namespace invgrad {

class RuleEngine final : public Engine {
 public:
  struct Options {
    int batch_size = 0;  // at least 1
    // A new order each epoch: np.random.permutation of a stream of this seed.
    bool shuffle = false;
    std::uint32_t seed = 0;
  };

  // `train` must outlive the engine.
  RuleEngine(const Options& options,
             std::unique_ptr<BatchObjective> objective,
             std::shared_ptr<UpdateRule> rule,
             const DataSet* train);

  long steps_per_epoch() const override { return steps_per_epoch_; }
  StepResult Step(double progress, Eigen::VectorXd* weights) override;
  bool TakeBack(Eigen::VectorXd* weights) override;
  void RestoreLastGood(Eigen::VectorXd* weights) override;
  long num_updates() const override {
    return step_ * objective_->updates_per_step();
  }
  long num_taken_back() const override { return num_taken_back_; }
  const PullBackCounts* counts() const override {
    return objective_->mutable_counts();
  }
  void VisitState(StateArchive* archive) override;
  std::string Finish() override;

 private:
  // The samples of the next step.
  DataSet NextBatch();
  bool Linearize(const DataSet& batch,
                 const Eigen::VectorXd& weights,
                 Linearization* at_weights,
                 std::string* error);
  // Makes all updates of a step; *at_weights is the linearization for the first
  // one.
  bool Update(const DataSet& batch,
              Linearization* at_weights,
              Eigen::VectorXd* weights,
              std::string* error);
  // The cost of the objective; NaN if it is not finite.
  double JudgedCost(const DataSet& batch, const Eigen::VectorXd& weights);

  const Options options_;
  const std::unique_ptr<BatchObjective> objective_;
  const std::shared_ptr<UpdateRule> rule_;
  const DataSet& train_;
  const long steps_per_epoch_;

  long step_ = 0;
  long num_taken_back_ = 0;
  NumpyRandom shuffle_;
  std::vector<int> order_;  // of the current epoch, if shuffled
  // The weights of the last finite batch loss.
  Eigen::VectorXd last_good_weights_;
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_RULE_ENGINE_H_
