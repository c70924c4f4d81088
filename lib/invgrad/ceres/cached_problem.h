// A copy of a ceres::Problem over the same parameter values that stores each
// residual block's last residuals and Jacobians.
//
//   CachedProblem cached({}, &problem);
//   UpdateCallback callback(rule.get(), cached.problem());
//   callback.AddTo(&options);
//   ceres::Solve(options, cached.problem(), &summary);
//
// An UpdateCallback linearizes at a state where Ceres has already evaluated all
// residual blocks with their Jacobians, so the linearization needs no
// evaluation of the user's cost functions. A request for Jacobians uses the
// stored values if all parameters equal, bit for bit, the parameters of the
// last evaluation (with an evaluation callback, of one after its last call for a
// new state).
//
// The user's problem is not changed. Both problems use the same cost functions,
// loss functions, manifolds and values, in the same order of residual blocks. A
// linear_solver_ordering is valid for both; residual block ids are not.
//
// Memory:  parameters, residuals and Jacobians of all residual blocks.
// Threads: as ceres::Solve, which evaluates a residual block by one thread at a
//          time.
// Needs:   cost functions that depend only on their parameters and on values
//          that the evaluation callback computes from these.
#ifndef INVGRAD_CERES_CACHED_PROBLEM_H_
#define INVGRAD_CERES_CACHED_PROBLEM_H_

#include <memory>

#include "ceres/evaluation_callback.h"
#include "ceres/problem.h"

namespace invgrad {

class CachedProblem {
 public:
  struct Options {
    // The evaluation callback of the problem, which Ceres 2.1 does not expose;
    // the copy calls it, too. Not owned.
    ceres::EvaluationCallback* evaluation_callback = nullptr;
  };

  // Later changes of blocks, manifolds, bounds and constness have no effect.
  // The problem must outlive the copy, and keep its residual blocks.
  CachedProblem(const Options& options, ceres::Problem* problem);
  ~CachedProblem();

  ceres::Problem* problem() { return &copy_; }

 private:
  class Preparation;

  std::unique_ptr<Preparation> preparation_;
  ceres::Problem copy_;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_CACHED_PROBLEM_H_
