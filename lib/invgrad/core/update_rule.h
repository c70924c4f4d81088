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
#ifndef INVGRAD_CORE_UPDATE_RULE_H_
#define INVGRAD_CORE_UPDATE_RULE_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/linearization.h"
#include "invgrad/core/memory_limit.h"

namespace invgrad {

class StepJudge;

// Sizes of the Jacobian of a network and a simulator, to estimate memory before
// J is computed. Doubles, because products of sizes may overflow an int.
struct JacobianSizes {
  struct Layer {
    double fan_in = 0.0;  // with the bias
    double fan_out = 0.0;
  };
  double rows = 0.0;      // m
  double cols = 0.0;      // n, the sum of the layers' fan_in fan_out
  double nonzeros = 0.0;  // of the J of a ceres::Problem; 0: of a network
  int num_ranks = 1;      // that share the rows
  std::vector<Layer> layers;
  // Memory of the factors that determine J, its Gram matrix and its layers.
  double factor_bytes = 0.0;
  // The layers of SampledFactors, of a J that is given by products, and the
  // memory of a call of FactorsAlong.
  std::vector<Layer> sampled_layers;
  double sampled_factor_bytes = 0.0;
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

  // Whether ComputeStep reads Linearization::progress: the steps then depend on
  // the run's budget.
  virtual bool ReadsProgress() const { return false; }

  // The judge of the rule's steps (step_judge.h): this object, as a rule; null:
  // every step counts.
  virtual StepJudge* judge() { return nullptr; }

  // Estimated memory of ComputeStep in addition to the linearization. A
  // training run fails at its start if this exceeds the memory limit. Default:
  // some vectors, and the factorization of the Hessian if the rule needs it.
  virtual std::vector<MemoryPart> StepMemory(const JacobianSizes& J) const;

  // Estimated work of ComputeStep, in operations of a large dense product,
  // kOperationsPerSecond on one core; an operation on a sparse J counts
  // kSparseOperation. UpdateCallback and Minimize make no step that takes too
  // long. Default: none, or 10 n^3 for a Hessian.
  static constexpr double kOperationsPerSecond = 1e10;
  static constexpr double kSparseOperation = 6.0;
  virtual double StepWork(const JacobianSizes& J) const;

  // A short report of the last step for a progress line or a table ("route
  // gram, rank 97 of 128"); may be empty.
  virtual std::string LastStepReport() const { return ""; }
};

}  // namespace invgrad

#endif  // INVGRAD_CORE_UPDATE_RULE_H_
