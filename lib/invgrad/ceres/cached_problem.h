// A copy of a ceres::Problem over the same parameter values, which remembers
// each residual block's last residuals and Jacobians.
//
//   CachedProblem cached({}, &problem);
//   UpdateCallback callback({}, &rule, &cached);
//   ceres_options.callbacks.push_back(&callback);
//   ceres_options.update_state_every_iteration = true;
//   ceres::Solve(ceres_options, cached.problem(), &summary);
//
// Ceres has evaluated all residual blocks, with their Jacobians, at the state
// at which an UpdateCallback linearizes: the copy's cost functions answer from
// what they remember, so that a linearization costs no evaluation of the
// user's. A cost function answers so when it is asked for Jacobians and its
// parameters are, bit for bit, those of the last time.
//
// The user's problem is not changed: its cost functions, loss functions and
// manifolds are used by both, its values are moved by a solve of either, and
// the order of residual blocks is the same. A linear_solver_ordering, which
// names values, holds for both; residual block ids do not.
//
// Memory:  a residual block's parameters, residuals and Jacobians once more,
//          in one piece.
// Threads: as ceres::Solve; a residual block is evaluated by one at a time.
// Fails:   never by itself. Cost functions must be functions of their
//          parameters (and of what the evaluation callback prepares from
//          them); one whose other inputs change during a solve must not be
//          cached, and confuses Ceres too.
#ifndef INVGRAD_CERES_CACHED_PROBLEM_H_
#define INVGRAD_CERES_CACHED_PROBLEM_H_

#include <map>
#include <memory>
#include <vector>

#include "ceres/evaluation_callback.h"
#include "ceres/problem.h"

namespace invgrad {

struct CostFunctionShape;

class CachedProblem {
 public:
  struct Options {
    // The problem's own, which Ceres 2.1 does not let anyone ask for; the copy
    // calls it too. Not owned.
    ceres::EvaluationCallback* evaluation_callback = nullptr;
  };

  // Blocks, manifolds, bounds and constness are those of now. The problem must
  // outlive the copy, and keep its residual blocks.
  CachedProblem(const Options& options, ceres::Problem* problem);
  ~CachedProblem();

  ceres::Problem* problem() { return &copy_; }

 private:
  void CopyParameterBlocks(const ceres::Problem& problem);
  void CopyResidualBlocks(const ceres::Problem& problem);
  const CostFunctionShape* ShapeOf(const ceres::CostFunction& function);

  // Of all cost functions, by their sizes.
  std::map<std::vector<int>, std::unique_ptr<CostFunctionShape>> shapes_;
  // What they remember, one after the other, and of which Jacobians.
  std::vector<double> memory_;
  std::vector<char> has_jacobian_;
  ceres::Problem copy_;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_CACHED_PROBLEM_H_
