// Makes sure that a solve with proposals never ends at a higher cost than the
// solve without them.
//
// Convergence. Ceres applies its tolerances to every step, so a short proposal
// could end the run far from a minimum. The safeguard sets the tolerances of
// the solve to zero and applies them to the steps of Ceres alone:
//
//   |x_candidate - x| <= parameter_tolerance (|x| + parameter_tolerance),
//   |L_candidate - L| <= function_tolerance L,
//   or |gradient|_max <= gradient_tolerance
//
// One of the first two that is met where the linear model predicts that the cost
// still falls (internal/model_decrease.h) ends the run only after 30 iterations
// that gain nothing. This is computed for problems with at most 50 parameters,
// more residuals than these, and no bounds.
//
// Comparison. An accepted proposal can lead to a worse minimum, and a rejected
// one shrinks the trust region. So the plain solve (the same options, start and
// cost functions, no proposals) runs once, before the first proposal. If its
// result is lower, the run moves there when it converges, when its steps change
// next to nothing, or when no work (work_limit.h), iteration or time is left.
//
// Time.    Half of the time that is left is for the plain solve, if
//          max_solver_time_in_seconds is set, and half of the rest for
//          proposals.
// Fails:   no comparison if the cost functions depend on more than their
//          parameters, as with an evaluation callback that is not known;
//          message() says so. No move to
//          the lower result if Ceres itself fails before (a step of its own to
//          where the Jacobian is not finite), or has no valid step.
// Source: Ceres Solver 2.1, internal/ceres/trust_region_minimizer.cc.
#ifndef INVGRAD_CERES_SAFEGUARD_H_
#define INVGRAD_CERES_SAFEGUARD_H_

#include <optional>
#include <string>

#include "Eigen/Core"
#include "ceres/evaluation_callback.h"
#include "ceres/iteration_callback.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/ceres/predicted_decrease.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/ceres/work_limit.h"

namespace invgrad {

class Safeguard {
 public:
  enum class Verdict { kContinue, kConverged, kPlainIsBetter };

  // Whether Ceres widens the trust region after the step.
  static bool IsLimited(const ceres::IterationSummary& iteration) {
    constexpr double kWidens = 0.75;  // of the gain ratio
    return iteration.step_is_successful && iteration.iteration > 0 &&
           iteration.relative_decrease > kWidens;
  }

  // The result of the plain solve.
  struct Plain {
    double cost = 0.0;  // without the fixed cost
    int num_iterations = 0;
    int num_limited_steps = 0;  // UpdateCallback::Summary
    bool has_converged = false;
    Eigen::VectorXd state;  // as ProblemLinearizer::State
  };

  // Sets the tolerances of `options` to zero. Keeps all pointers but that. The
  // linearizer has read the problem before its manifolds were wrapped.
  // compares = false: no plain solve.
  Safeguard(bool compares,
            bool has_bounds,
            ceres::Solver::Options* options,
            ceres::EvaluationCallback* evaluation_callback,
            const ceres::Problem* problem,
            ProblemLinearizer* linearizer,
            WorkLimit* work);

  // Call after each iteration, in order, the 0th included. The iteration's cost
  // is that without the fixed cost. `state`: of the blocks. `is_own`: the step,
  // if any, was computed by Ceres.
  void Observe(const ceres::IterationSummary& iteration,
               const Eigen::VectorXd& state,
               bool is_own);
  Verdict verdict() const;
  // Whether the result of the plain solve, if known, is better than a state of
  // this cost.
  bool IsPlainBetterThan(double cost) const;

  // Runs the plain solve, once. Call it before the first proposal.
  void Compare();

  // Of the last tolerance that was met: the relative decrease of the cost that
  // the linear model predicts; 0 at a minimum.
  double predicted_decrease() const { return predicted_decrease_; }

  // Nothing before the plain solve, or if it failed.
  const std::optional<Plain>& plain() const { return plain_; }
  // Why there was no comparison, if there should have been one.
  const std::string& message() const { return message_; }

 private:
  bool MeetsGradientTolerance(const ceres::IterationSummary& iteration) const;
  bool MeetsStepTolerance(const ceres::IterationSummary& iteration) const;
  // Whether the state is no minimum although a tolerance is met.
  bool Doubts();
  double PredictedDecreaseHere() const {
    return PredictedDecrease(options_.function_tolerance,
                             options_.parameter_tolerance,
                             has_bounds_,
                             linearizer_);
  }
  double TangentGradientMaxNorm() const;
  bool IsFlat(const ceres::IterationSummary& iteration) const;

  const bool compares_;
  const bool has_bounds_;
  const ceres::Solver::Options options_;  // of the user
  ceres::EvaluationCallback* const evaluation_callback_;
  const ceres::Problem& problem_;
  ProblemLinearizer& linearizer_;
  WorkLimit& work_;
  Eigen::VectorXd start_;
  double start_cost_ = 0.0;
  // At the last accepted state.
  double cost_ = 0.0;
  double norm_ = 0.0;
  bool is_at_start_ = true;
  double gradient_max_norm_ = 0.0;
  double seconds_ = 0.0;
  // The next call may be too late to move to the result of the plain solve.
  bool is_late_ = false;
  bool has_converged_ = false;
  double predicted_decrease_ = 0.0;
  int num_doubts_ = 0;  // since cost_at_doubt_
  double cost_at_doubt_ = 0.0;
  bool has_proposals_ = false;
  bool is_compared_ = false;
  std::optional<Plain> plain_;
  std::string message_;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_SAFEGUARD_H_
