// The engine of an update rule on mini-batches:
//
//   theta_{k+1} = theta_k + rule(linearization of the objective on batch k)
//
// on the batches of batch_sequence.h. A rule that judges its steps (control=gain)
// receives the cost after each step; the engine undoes a step that the judge
// rejects, or after which the next batch has no finite loss. A rule that
// evaluates the loss at other points (LinearizationParts::after) has judged its
// steps: a batch without a finite loss is left out, at most a hundred in a row,
// and of samples that come again (stored, or of a set for several steps) at most
// those of an epoch. The run's message counts them.
// If the train loss is not finite, it goes back to the best weights that were
// evaluated.
//
// Fails:   if a batch has no finite loss, or the rule has no finite step.
#ifndef INVGRAD_TRAIN_RULE_ENGINE_H_
#define INVGRAD_TRAIN_RULE_ENGINE_H_

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/train/batch_sequence.h"
#include "invgrad/train/engine.h"
#include "invgrad/update_rule.h"

namespace invgrad {

class RuleEngine final : public Engine {
 public:
  // The options: shuffle and seed.
  RuleEngine(int batch_size,
             const TrainOptions& options,
             std::unique_ptr<BatchObjective> objective,
             std::shared_ptr<UpdateRule> rule,
             const Model* model,
             const TrainingData* data);

  StepResult Step(double progress, Eigen::VectorXd* weights) override;
  bool Undo(UndoReason reason,
            const Eigen::VectorXd& best,
            Eigen::VectorXd* weights) override;
  Eigen::VectorXd Finished(const Eigen::VectorXd& weights) override {
    return objective_->Finished(weights);
  }
  Counts counts() const override;
  void VisitState(StateArchive* archive) override;
  std::string Finish() override;

  // For the run's message.
  void set_remark(const std::string& remark) { remark_ = remark; }

  // --- For races of batch sizes ---

  void set_batch_size(int batch_size) { batch_size_ = batch_size; }
  // The next samples of the sequence, which no step then uses; of a data source,
  // samples of the next step.
  DataSet TakeSamples(int count, const Eigen::VectorXd& weights) {
    return batches_.Next(step_, count, weights);
  }
  // What a step changes, but for the place in the sequence of samples and for
  // counts.
  struct Lane {
    Eigen::VectorXd weights;
    std::vector<Eigen::VectorXd> arrays;

    void VisitState(const std::string& name,
                    Eigen::Index num_weights,
                    StateArchive* archive);
  };
  Lane Save(const Eigen::VectorXd& weights);
  void Load(const Lane& lane, Eigen::VectorXd* weights);

 private:
  // Linearizes at the weights, or, if there is no finite loss, before the last
  // step. *is_left_out: the batch is.
  bool Begin(const DataSet& batch,
             Linearization* at_weights,
             Eigen::VectorXd* weights,
             bool* is_left_out,
             std::string* error);
  std::vector<Eigen::VectorXd*> Arrays();

  int batch_size_;
  BatchSequence batches_;
  StepJudge* const judge_;  // of the rule; may be null
  const Eigen::Index num_weights_;
  const std::unique_ptr<BatchObjective> objective_;
  const std::shared_ptr<UpdateRule> rule_;

  std::string remark_;
  long step_ = 0;
  WeightLedger ledger_;
  long num_left_out_ = 0;  // in a row
  long num_left_out_in_all_ = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_RULE_ENGINE_H_
