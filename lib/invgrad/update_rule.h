// An update rule turns a linearization into a step. Derive from UpdateRule to
// write a rule of your own; to use one of the library's rules see rules.h. A
// rule that judges its steps is also a StepJudge.
//
//   x_{k+1} = x_k + step
//
// Shapes:  step: n, the dimension of the tangent space of x (the size of x if
//          there is no manifold).
// The rule owns its step size, because some rules apply it before a nonlinear
// inverse, and its memory (such as momentum). Use one rule object for one run.
//
// A rule must define Needs and ComputeStep; the other methods have defaults.
// RegisterRule (rules.h) gives it a name; an example is
// docs/tutorials/write_update_rule.md.
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

  // The parts of the linearization that ComputeStep reads, and what it does
  // with them.
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

  // The judge of the rule's steps: this object, as a rule; null:
  // every step counts.
  virtual StepJudge* judge() { return nullptr; }

  // A short report of the last step for a progress line or a table ("route
  // gram, rank 97 of 128"); may be empty.
  virtual std::string LastStepReport() const { return ""; }
};

// What a rule also is if it judges its steps. A loop asks for it once, by
// UpdateRule::judge().
class StepJudge {
 public:
  virtual ~StepJudge() = default;

  // Receives the cost over the same samples after the last step, or after
  // `fraction` of the step; NaN if the cost is not finite. Returns false to
  // undo the step: the loop puts the weights before it back, bit for bit.
  virtual bool KeepsStep(double cost, double fraction) = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_UPDATE_RULE_H_
