// The weights that a training run can go back to, and how often it did.
//
//   before   those of the last finite batch loss, where the last step began
//   copy     those that a judge of weights has asked for (update_rule.h)
//
// Undo is the only function that goes back; it takes a reason.
#ifndef INVGRAD_TRAIN_WEIGHT_LEDGER_H_
#define INVGRAD_TRAIN_WEIGHT_LEDGER_H_

#include "Eigen/Core"
#include "invgrad/train/checkpoint.h"

namespace invgrad {

enum class UndoReason {
  kJudged,  // the judge of the rule decides so
  kNoLoss,  // there is no finite loss at the weights
  kEnd      // the run ends; this counts as no step that is undone
};

class WeightLedger {
 public:
  // Both may be empty.
  const Eigen::VectorXd& before() const { return before_; }
  const Eigen::VectorXd& copy() const { return copy_; }
  void SetBefore(const Eigen::VectorXd& weights) { before_ = weights; }
  void SetCopy(const Eigen::VectorXd& weights) { copy_ = weights; }

  // Puts weights back, unless they are empty.
  void Undo(UndoReason reason,
            const Eigen::VectorXd& back,
            Eigen::VectorXd* weights) {
    if (reason != UndoReason::kEnd) ++num_undone_;
    if (back.size() > 0) *weights = back;
  }
  long num_undone() const { return num_undone_; }

  // has_copy: whether the rule has a judge of weights.
  void VisitState(Eigen::Index num_weights,
                  bool has_copy,
                  StateArchive* archive) {
    archive->Visit("num_undone", &num_undone_);
    Visit("weights_before", num_weights, &before_, archive);
    if (has_copy) Visit("weights_copied", num_weights, &copy_, archive);
  }

 private:
  static void Visit(const char* name,
                    Eigen::Index num_weights,
                    Eigen::VectorXd* weights,
                    StateArchive* archive) {
    archive->Visit(name, weights);
    archive->Require(weights->size() == 0 || (weights->size() == num_weights &&
                                              weights->allFinite()),
                     name);
  }

  Eigen::VectorXd before_;
  Eigen::VectorXd copy_;
  long num_undone_ = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_WEIGHT_LEDGER_H_
