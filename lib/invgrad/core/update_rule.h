// An update rule turns a linearization into a step.
//
//   x_{k+1} = x_k + step
//
// Shapes:  step: n, the size of the tangent space of x (of x itself, where no
//          manifold is set).
// The rule owns its step size, because some rules apply it before a nonlinear
// inverse; it owns its memory (momentum and the like), so one rule object
// belongs to one run.
#ifndef INVGRAD_CORE_UPDATE_RULE_H_
#define INVGRAD_CORE_UPDATE_RULE_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/linearization.h"
#include "invgrad/core/memory_limit.h"

namespace invgrad {

// A network's Jacobian before it is computed. Doubles: no product overflows.
struct JacobianSizes {
  struct Layer {
    double fan_in = 0.0;  // with the bias
    double fan_out = 0.0;
  };
  double rows = 0.0;  // m
  double cols = 0.0;  // n, the sum of the layers' fan_in fan_out
  std::vector<Layer> layers;
  // What J keeps once its Gram matrix, its layers or J itself are asked for.
  double factor_bytes = 0.0;
};

class UpdateRule {
 public:
  virtual ~UpdateRule() = default;

  // The parts of the linearization that ComputeStep reads.
  virtual LinearizationParts Needs() const = 0;

  // Computes the step (n) from the linearization at the current point. Returns
  // false, and leaves *step unspecified, if there is no finite step; then
  // *error says why. Both pointers must not be null.
  virtual bool ComputeStep(const Linearization& at_x,
                           Eigen::VectorXd* step,
                           std::string* error) = 0;

  // The arrays that a checkpoint must hold so that a resumed run continues bit
  // for bit; counters are arrays of size 1. The pointers live as long as the
  // rule. Arrays may still be empty (before the first step), and a restored
  // array must have the effect of never having stopped.
  virtual std::vector<Eigen::VectorXd*> MutableState() { return {}; }

  // Whether the loop is to tell where each step led, by KeepsStep: one
  // evaluation of the cost a step.
  virtual bool JudgesSteps() const { return false; }

  // Tells the cost, of what the last step was computed from, where the step
  // led, or `fraction` of it; NaN if it has no finite value there. False: the
  // step is to be taken back.
  virtual bool KeepsStep(double /*cost*/, double /*fraction*/) { return true; }

  // What ComputeStep holds in memory beside the linearization, estimated: for
  // this J, or, where the rule needs none, its n. By default a few vectors of
  // weights.
  virtual std::vector<MemoryPart> StepMemory(const JacobianSizes& J) const;

  // What the last step did, in a few words for a progress line or a table
  // ("route gram, rank 97 of 128"); empty if there is nothing to say.
  virtual std::string LastStepReport() const { return ""; }
};

// Gives an array of a rule's memory its initial value at the first step: `size`
// entries `value` if it is empty. CHECKs that its size fits otherwise.
void InitializeOnce(Eigen::Index size, double value, Eigen::VectorXd* array);

}  // namespace invgrad

#endif  // INVGRAD_CORE_UPDATE_RULE_H_
