// An update rule turns a linearization into a step.
//
//   x_{k+1} = x_k + step
//
// Shapes:  step: n, the dimension of the tangent space of x (the size of x if
//          there is no manifold).
// The rule owns its step size, because some rules apply it before a nonlinear
// inverse, and its memory (such as momentum). Use one rule object for one run.
//
// A rule must define Needs and ComputeStep; the other methods have defaults.
// RegisterRule (rules.h) gives it a name; docs/tutorials/06_own_rule.md is an
// example.
#ifndef INVGRAD_UPDATE_RULE_H_
#define INVGRAD_UPDATE_RULE_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/linearization.h"

namespace invgrad {

class StepJudge;

class UpdateRule {
 public:
  virtual ~UpdateRule() = default;

  // The parts of the linearization that ComputeStep reads, and what it does with
  // them.
  virtual LinearizationParts Needs() const = 0;

  // Computes the step (n) from the linearization at the current point. Returns
  // false, with *error and an unspecified *step, if there is no finite step.
  // The pointers are not null.
  virtual bool ComputeStep(const Linearization& at_x,
                           Eigen::VectorXd* step,
                           std::string* error) = 0;

  // The arrays that a checkpoint must hold so that a resumed run continues bit
  // for bit; counters are arrays of size 1. The pointers live as long as the
  // rule. Arrays may be empty before the first step.
  virtual std::vector<Eigen::VectorXd*> MutableState() { return {}; }

  // The judge of the rule's steps (step_judge.h): this object, as a rule; null:
  // every step counts.
  virtual StepJudge* judge() { return nullptr; }

  // A short report of the last step for a progress line or a table ("route
  // gram, rank 97 of 128"); may be empty.
  virtual std::string LastStepReport() const { return ""; }
};

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

#endif  // INVGRAD_UPDATE_RULE_H_
