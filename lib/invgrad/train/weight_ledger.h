// The weights that a training run can go back to, those of the last finite batch
// loss, where the last step began; and how often it did.
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
  // May be empty.
  const Eigen::VectorXd& before() const { return before_; }
  void SetBefore(const Eigen::VectorXd& weights) { before_ = weights; }

  // Puts weights back, unless they are empty.
  void Undo(UndoReason reason,
            const Eigen::VectorXd& back,
            Eigen::VectorXd* weights) {
    if (reason != UndoReason::kEnd) ++num_undone_;
    if (back.size() > 0) *weights = back;
  }
  long num_undone() const { return num_undone_; }

  void VisitState(Eigen::Index num_weights, StateArchive* archive) {
    archive->Visit("num_undone", &num_undone_);
    archive->Visit("weights_before", &before_);
    archive->Require(before_.size() == 0 ||
                         (before_.size() == num_weights && before_.allFinite()),
                     "weights_before");
  }

 private:
  Eigen::VectorXd before_;
  long num_undone_ = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_WEIGHT_LEDGER_H_
