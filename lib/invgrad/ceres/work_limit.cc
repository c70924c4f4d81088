#include "invgrad/ceres/work_limit.h"

#include "fmt/core.h"
#include "invgrad/core/step_cost.h"

namespace invgrad {
namespace {

// Measured on bundle adjustment, pose graphs and curve fits, in 1e-10 s: the
// least that an iteration takes for each entry of J, and for the smallest
// problem.
constexpr double kIterationOfEntry = 500.0;
// With dynamic sparsity Ceres stores and solves only what is not zero.
constexpr double kIterationOfDynamicEntry = 50.0;
constexpr double kSmallestIteration = 2e5;
// A linearization, relative to that (not to dynamic entries).
constexpr double kLinearization = 0.4;

// Of the move to the result of the comparison, and the end there.
constexpr double kNumLastIterations = 2.0;

// Without the comparison: the work of so many iterations may come first.
constexpr double kNumFreeIterations = 5.0;

// Of the linear solver, where it is known.
double SolverWork(ceres::LinearSolverType type, double m, double n) {
  switch (type) {
    case ceres::DENSE_QR:
      return 2.0 * m * n * n;
    case ceres::DENSE_NORMAL_CHOLESKY:
      return m * n * n + n * n * n / 3.0;
    default:
      return 0.0;
  }
}

}  // namespace

WorkLimit::WorkLimit(double max_relative_work,
                     bool has_comparison,
                     const LinearizationParts& needs,
                     double iterations_of_function,
                     const ceres::Solver::Options& options,
                     const ProblemStructure& structure)
    : max_relative_work_(max_relative_work),
      max_num_iterations_(options.max_num_iterations),
      has_comparison_(has_comparison) {
  const double rows = structure.num_residuals;
  const double cols = structure.num_parameters;
  const auto num_entries = static_cast<double>(structure.num_entries);
  LinearizationParts used = needs;
  used.uses_sparsity &= !IsDense(num_entries, rows, cols);
  step_work_ = StepOperations(used, rows, cols, num_entries);
  linearization_work_ =
      kLinearization * (kSmallestIteration + kIterationOfEntry * num_entries);
  iteration_work_ = kSmallestIteration +
                    (options.dynamic_sparsity ? kIterationOfDynamicEntry
                                              : kIterationOfEntry) *
                        num_entries +
                    SolverWork(options.linear_solver_type, rows, cols);
  step_work_ += iterations_of_function * iteration_work_;
}

bool WorkLimit::IsStepPossible() const {
  return step_work_ <=
         (max_relative_work_ - 1.0) * max_num_iterations_ * iteration_work_;
}

void WorkLimit::SetComparison(std::optional<int> num_iterations) {
  num_plain_iterations_ = num_iterations;
  has_comparison_ = num_iterations.has_value();
}

bool WorkLimit::NeedsComparison() const {
  return has_comparison_ && !num_plain_iterations_ &&
         NextStep() > iteration_work_;
}

bool WorkLimit::Allows(double iterations, double rule_work) const {
  iterations += num_iterations_;
  rule_work += rule_work_;
  const double relative = max_relative_work_ - 1.0;
  if (!has_comparison_) {
    return rule_work <=
           relative * (iterations + kNumFreeIterations) * iteration_work_;
  }
  return !num_plain_iterations_ ||
         (iterations + kNumLastIterations) * iteration_work_ + rule_work <=
             relative * *num_plain_iterations_ * iteration_work_;
}

bool WorkLimit::AllowsStep() const { return Allows(1.0, NextStep()); }

bool WorkLimit::AllowsIteration() const { return Allows(1.0, 0.0); }

std::string WorkLimit::Message() const {
  return fmt::format(
      "no further proposals: one takes as long as {:.2g} iterations of Ceres, "
      "and max_relative_work = {:g} is the limit for the whole solve; set it "
      "higher, or use a rule with cheaper steps (krylov); of a proposal "
      "function, iterations_of_function is the estimate",
      NextStep() / iteration_work_,
      max_relative_work_);
}

}  // namespace invgrad
