// What a rule also is if it judges its steps. A loop asks for it once, by
// UpdateRule::judge().
//
//   after a step     on the same samples: does the cost allow to keep it?
//   before a step    on a batch that the steps before have not seen: go on, copy
//                    the weights, or undo steps? Only in training, and only if
//                    the judge wants it.
//
// The loop keeps a ledger of weights to go back to: those before the last step,
// and one copy. Undoing a step puts weights of the ledger back, bit for bit.
#ifndef INVGRAD_CORE_STEP_JUDGE_H_
#define INVGRAD_CORE_STEP_JUDGE_H_

namespace invgrad {

class StepJudge {
 public:
  virtual ~StepJudge() = default;

  // Receives the cost over the same samples after the last step, or after
  // `fraction` of the step; NaN if the cost is not finite. Returns false to undo
  // the step.
  virtual bool KeepsStep(double cost, double fraction) = 0;

  // Whether the loop calls JudgeWeights. It does so if each batch has samples that
  // the last step was not computed from.
  virtual bool JudgesWeights() const { return false; }

  // What to do with the weights before a step.
  enum class Verdict {
    kGoOn,
    kCopy,        // go on, and copy them
    kCopyBefore,  // go on, and copy those before the last step
    kUndoStep,    // go back to before the last step
    kUndoToCopy,  // go back to the copy
    kLeaveOut     // leave the batch out: its loss is finite nowhere
  };
  // The loss of the batch at other weights of the ledger, by a forward pass each;
  // NaN if it is not finite, or if there are no such weights.
  class OtherWeights {
   public:
    virtual ~OtherWeights() = default;
    virtual double CostBeforeLastStep() = 0;
    virtual double CostAtCopy() = 0;
  };
  // Receives the loss of a new batch before its step; NaN if it is not finite.
  virtual Verdict JudgeWeights(double /*cost*/, OtherWeights* /*others*/) {
    return Verdict::kGoOn;
  }
};

}  // namespace invgrad

#endif  // INVGRAD_CORE_STEP_JUDGE_H_
