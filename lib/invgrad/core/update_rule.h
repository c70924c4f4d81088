// An update rule turns a linearization into a step.
//
//   x_{k+1} = x_k + step
//
// Shapes:  step: n, the size of the tangent space of x (of x itself, where no
//          manifold is set).
// The rule owns its step size, because some rules apply it before a nonlinear
// inverse, and its memory (momentum and the like), so that one rule object
// belongs to one run.
//
// A rule must define Needs and ComputeStep; the other methods have defaults.
// RegisterRule (rules.h) gives it a name; docs/tutorials/06_own_rule.md is an
// example.
#ifndef INVGRAD_CORE_UPDATE_RULE_H_
#define INVGRAD_CORE_UPDATE_RULE_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/linearization.h"
#include "invgrad/core/memory_limit.h"

namespace invgrad {

// Sizes of the Jacobian of a network and a simulator, for forecasts of memory
// before it is computed. Doubles, so that no product overflows.
struct JacobianSizes {
  struct Layer {
    double fan_in = 0.0;  // with the bias
    double fan_out = 0.0;
  };
  double rows = 0.0;  // m
  double cols = 0.0;  // n, the sum of the layers' fan_in fan_out
  std::vector<Layer> layers;
  // Memory of the factors from which J, its Gram matrix and its layers are
  // computed.
  double factor_bytes = 0.0;
};

class UpdateRule {
 public:
  virtual ~UpdateRule() = default;

  // The parts of the linearization that ComputeStep reads.
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

  // Whether the loop shall evaluate the cost after each step and call KeepsStep.
  virtual bool JudgesSteps() const { return false; }

  // Called with the cost after the last step, or after `fraction` of it, over
  // the same samples; NaN if it is not finite. False: the step shall be taken
  // back.
  virtual bool KeepsStep(double /*cost*/, double /*fraction*/) { return true; }

  // Estimated memory of ComputeStep in addition to the linearization, from which
  // a training run is refused before it allocates more than the machine has.
  // By default some vectors, and the factorization of a Hessian that the rule
  // needs.
  virtual std::vector<MemoryPart> StepMemory(const JacobianSizes& J) const;

  // What the last step did, in a few words for a progress line or a table
  // ("route gram, rank 97 of 128"); empty if there is nothing to say.
  virtual std::string LastStepReport() const { return ""; }
};

// Initializes an array of a rule's memory at the first step: `size` entries
// `value` if it is empty. Otherwise CHECKs its size.
void InitializeOnce(Eigen::Index size, double value, Eigen::VectorXd* array);

}  // namespace invgrad

#endif  // INVGRAD_CORE_UPDATE_RULE_H_
