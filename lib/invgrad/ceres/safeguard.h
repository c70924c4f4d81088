// Ends a ceres::Solve with proposals where the solve without them would end, or
// lower.
//
// Convergence. Ceres applies its tolerances to every step, so a short proposal
// could end the run far from a minimum. The safeguard sets the tolerances of
// the solve to zero and applies them to the steps of Ceres alone:
//
//   |x_candidate - x| <= parameter_tolerance (|x| + parameter_tolerance),
//   |L_candidate - L| <= function_tolerance L,
//   or |gradient|_max <= gradient_tolerance
//
// Comparison. An accepted proposal can lead to a worse minimum, and a rejected one
// shrinks the trust region. The plain solve (the same options, start and cost
// functions, no proposals) runs once inside the run, as soon as the run has had
// proposals and has either converged or taken kNumFreeIterations. If its cost is
// lower, the run moves to its result at the end, and not later than after as
// many iterations as the plain solve took.
//
// Fails:   no comparison if the cost functions depend on more than their
//          parameters (an evaluation callback); message() says so. If a state
//          after an accepted proposal has no finite Jacobian, Ceres fails
//          without another call, and the run ends there.
// Source: Ceres Solver 2.1, internal/ceres/trust_region_minimizer.cc.
#ifndef INVGRAD_CERES_SAFEGUARD_H_
#define INVGRAD_CERES_SAFEGUARD_H_

#include <optional>
#include <string>

#include "Eigen/Core"
#include "ceres/iteration_callback.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/ceres/problem_linearizer.h"

namespace invgrad {

class Safeguard {
 public:
  enum class Verdict { kContinue, kConverged, kPlainIsBetter };

  // The result of the plain solve.
  struct Plain {
    double cost = 0.0;
    int num_iterations = 0;
    Eigen::VectorXd state;  // as ProblemLinearizer::State
  };

  // Sets the tolerances of `options` to zero. Keeps pointers to the problem and
  // the linearizer, which has read the problem before its manifolds were
  // wrapped. compares = false: no plain solve.
  Safeguard(bool compares,
            ceres::Solver::Options* options,
            const ceres::Problem* problem,
            ProblemLinearizer* linearizer);

  // Call after each iteration, in order, the 0th included. `state`: of the
  // blocks. `is_own`: the step, if any, was computed by Ceres.
  Verdict Judge(const ceres::IterationSummary& iteration,
                const Eigen::VectorXd& state,
                bool is_own);

  // Nothing before the plain solve, or if it failed.
  const std::optional<Plain>& plain() const { return plain_; }
  // Why there was no comparison, if there should have been one.
  const std::string& message() const { return message_; }

 private:
  bool MeetsTolerances(const ceres::IterationSummary& iteration) const;
  bool IsFlat(const ceres::IterationSummary& iteration) const;
  bool IsPlainBetter() const;
  void SolvePlain();

  static constexpr int kNumFreeIterations = 5;

  const bool compares_;
  const ceres::Solver::Options options_;  // of the user
  const ceres::Problem& problem_;
  ProblemLinearizer& linearizer_;
  const double fixed_cost_;
  Eigen::VectorXd start_;
  double start_cost_ = 0.0;
  // At the last accepted state, the cost without the fixed cost.
  double cost_ = 0.0;
  double norm_ = 0.0;
  bool is_at_start_ = true;
  double gradient_max_norm_ = 0.0;
  bool has_proposals_ = false;
  bool is_compared_ = false;
  bool is_moving_ = false;  // to the result of the plain solve
  std::optional<Plain> plain_;
  std::string message_;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_SAFEGUARD_H_
