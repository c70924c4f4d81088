// Limits the time that proposals add to a ceres::Solve.
//
//   P W + (iterations + 2) W + w <= max_relative_work P W
//
//   P   iterations of the solve without proposals
//   W   work of an iteration of Ceres, a lower bound by the problem's sizes
//   w   work of the rule: steps (step_cost.h) and linearizations; of a
//       proposal function: as many W a call as UpdateCallback::Options say
//
// The first term is the solve without proposals, which runs for comparison
// (safeguard.h); 2 W is the work to move to its result. Without the comparison
//
//   w <= (max_relative_work - 1) (iterations + 5) W
//
// Units:   operations, as in step_cost.h. Measured times would decide
//          differently in each run.
#ifndef INVGRAD_CERES_WORK_LIMIT_H_
#define INVGRAD_CERES_WORK_LIMIT_H_

#include <optional>
#include <string>

#include "ceres/solver.h"
#include "invgrad/ceres/problem_structure.h"
#include "invgrad/linearization.h"

namespace invgrad {

class WorkLimit {
 public:
  WorkLimit(double max_relative_work,
            bool has_comparison,
            const LinearizationParts& needs,
            double iterations_of_function,  // 0: a rule
            const ceres::Solver::Options& options,
            const ProblemStructure& structure);

  // Whether a step is possible at all, if P = options.max_num_iterations.
  bool IsStepPossible() const;

  void CountIteration() { ++num_iterations_; }
  void CountLinearization() { rule_work_ += linearization_work_; }
  void CountStep() { rule_work_ += step_work_; }
  // P; nothing if the solve failed.
  void SetComparison(std::optional<int> num_iterations);

  // A step that takes less time than an iteration of Ceres is made before the
  // comparison, which is not made if there is no step.
  bool NeedsComparison() const;
  bool AllowsStep() const;
  bool AllowsIteration() const;

  // "a step of the rule takes as long as 300 iterations of Ceres, ..."
  std::string Message() const;

 private:
  // Whether so much more fits into the limit.
  bool Allows(double iterations, double rule_work) const;
  double NextStep() const { return step_work_ + 2.0 * linearization_work_; }

  const double max_relative_work_;
  const int max_num_iterations_;
  double step_work_;
  double linearization_work_;
  double iteration_work_;
  bool has_comparison_;
  std::optional<int> num_plain_iterations_;
  int num_iterations_ = 0;
  double rule_work_ = 0.0;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_WORK_LIMIT_H_
