// Minimizes a ceres::Problem, or a simulator and a loss over the simulator's
// input. Minimize takes the steps of an update rule as they are; use it to
// study a rule. MinimizeProblem and MinimizeByMethod run a method given as text
// (method.h); use them to compare methods. To solve a problem as well as
// possible use update_callback.h; to train a network use train.h.
//
// Options, summary and termination use Ceres' types, so that runs compare with
// ceres::Solve.
#ifndef INVGRAD_MINIMIZE_H_
#define INVGRAD_MINIMIZE_H_

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/evaluation_callback.h"
#include "ceres/iteration_callback.h"
#include "ceres/ordered_groups.h"
#include "ceres/problem.h"
#include "ceres/types.h"
#include "invgrad/data.h"
#include "invgrad/internal/objective.h"
#include "invgrad/linearization.h"
#include "invgrad/loss.h"
#include "invgrad/model.h"
#include "invgrad/simulator.h"
#include "invgrad/update_callback.h"
#include "invgrad/update_rule.h"

namespace invgrad {

class InverseSimulator;
struct Method;

struct MinimizerOptions {
  int max_num_iterations = 50;
  // No step begins after it, or if its factorization would take longer
  // (step_cost.h).
  double max_time_in_seconds = 1e9;
  //  max_i |gradient_i| <= gradient_tolerance, in the tangent space
  double gradient_tolerance = 1e-10;
  //  |L_{k+1} - L_k| <= function_tolerance L_k; 0 switches it off
  double function_tolerance = 1e-6;
  //  |x_{k+1} - x_k| <= parameter_tolerance (|x_k| + parameter_tolerance);
  // 0 switches it off
  double parameter_tolerance = 1e-8;
  // A mini-batch. Empty: all of the problem's residual blocks.
  std::vector<ceres::ResidualBlockId> residual_blocks;
  // Called at x_0 and after every step, with up-to-date blocks. Not owned.
  // SOLVER_ABORT ends the run with USER_FAILURE, SOLVER_TERMINATE_SUCCESSFULLY
  // with USER_SUCCESS; the blocks keep their values.
  std::vector<ceres::IterationCallback*> callbacks;
  // The evaluation callback of the problem, if any (see ProblemLinearizer). Not
  // owned.
  ceres::EvaluationCallback* evaluation_callback = nullptr;
  // The problem's Problem::Options::manifold_ownership, for proposals
  // (UpdateCallback::Options).
  ceres::Ownership manifold_ownership = ceres::TAKE_OWNERSHIP;
  // Of a block, in MinimizerSummary::first_outside_domain; "" or no function:
  // "block i".
  std::function<std::string(const double* values)> block_name;
};

struct MinimizerSummary {
  ceres::TerminationType termination_type = ceres::FAILURE;
  std::string message;
  double initial_cost = -1.0;
  double final_cost = -1.0;
  // [0] is the start. Minimize fills cost, cost_change, the norms of gradient
  // (tangent space) and step (ambient), the flags (nonmonotonic: the cost rose;
  // successful: the rule did not undo the step) and the times.
  std::vector<ceres::IterationSummary> iterations;
  double total_time_in_seconds = 0.0;
  int num_undone = 0;  // steps that the rule undid
  // Candidates of ceres::Solve, proposals included, at which the problem cannot
  // be evaluated (domain_failure.h).
  int num_outside_domain = 0;
  // Why not at the first of them, for trust regions; none if no reason was
  // found.
  std::optional<DomainFailure> first_outside_domain;
  // Of ceres::Solve with proposals.
  std::optional<UpdateCallback::Summary> proposals;

  int num_steps() const {
    return iterations.empty() ? 0 : static_cast<int>(iterations.size()) - 1;
  }
  // "CONVERGENCE, 12 steps, cost 4.5e+01 -> 1.2e-12: ..."
  std::string BriefReport() const;
};

// Minimizes a ceres::Problem by the unmodified steps of an update rule.
//
//   x_{k+1} = Plus(x_k, rule(linearization at x_k))
//
// There is no line search and no acceptance test; for these see
// update_callback.h.
//
// Cost:    one linearization and one step an iteration.
// Units:   a rule whose steps depend on the units of single parameters may meet
//          a tolerance far from a minimum. If the problem has at most 50
//          parameters, the message then says "no minimum", as it does after
//          Ceres (MinimizeProblem).
// Fails:   a numerical failure (no finite step; cost, gradient or Jacobian not
//          finite) ends the run with ceres::FAILURE and a message that names
//          the iteration; the blocks then have the last state at which all of
//          these were finite, and the failed step is not recorded. A problem
//          with bounds ends in the same way at its start. A rule that makes no
//          step because no trial has a finite cost has not converged
//          (ceres::NO_CONVERGENCE).
void Minimize(const MinimizerOptions& options,
              UpdateRule* rule,
              ceres::Problem* problem,
              MinimizerSummary* summary);

// The same for any objective; options about parts of a ceres::Problem are
// ignored.
void Minimize(const MinimizerOptions& options,
              UpdateRule* rule,
              Objective* objective,
              MinimizerSummary* summary);

// A simulator and a loss without a network, at a point: the unknowns are x, the
// simulator's input. With a network use model.h.
//
//   L(x) = L(P(x), y*),   J = dP/dx,   g = dL/dy
//   d2L/dx2 = J^T H_L J + sum_i g_i d2P_i/dx2
//
// It is a Model with a WeightsNetwork (weights_network.h), one sample, and a
// current point.
//
// Shapes:  x: n = |x|;  y: m = |y|.
// Units:   g and J are derivatives for y, not for a residual: L = c |y - y*|^2
//          has g = 2 c (y - y*) and H_L = 2 c I.
// Cost:    the gradient alone: the simulator's adjoint, without J. Otherwise
//          one simulator evaluation with Jacobian, or one Linearize if the
//          simulator does not form it; the Hessian adds one.
// Fails:   Linearize and Cost return false where the model does, and if J and
//          the Hessian, which are dense, do not fit into memory.
class PointObjective final : public Objective {
 public:
  // Sizes must fit, and the simulator must not need a context (CHECKed).
  PointObjective(std::shared_ptr<const Simulator> simulator,
                 std::shared_ptr<const Loss> loss,
                 Eigen::VectorXd target,
                 Eigen::VectorXd start);

  int num_parameters() const override { return model_.num_weights(); }
  bool Linearize(const LinearizationParts& parts,
                 Linearization* linearization,
                 std::string* error) const override;
  bool Cost(double* cost, std::string* error) const override {
    return model_.Cost(x_, data_, cost, error);
  }
  Eigen::VectorXd State() const override { return x_; }
  void SetState(const Eigen::VectorXd& state) override;
  bool Plus(const Eigen::VectorXd& step) override;

  // y = P(x); empty if the simulator fails.
  Eigen::VectorXd Outputs() const;

  // The network's outputs are its weights, x.
  const Model& model() const { return model_; }
  // One sample.
  const DataSet& data() const { return data_; }
  Eigen::VectorXd target() const { return data_.targets.col(0); }

 private:
  Model model_;
  DataSet data_;
  Eigen::VectorXd x_;
};

// Minimizes a ceres::Problem, or a simulator and a loss over the simulator's
// input, by a method (method.h).
//
//   half_inverse            Minimize, the pure iteration
//   ceres_lm, ceres_bfgs    Ceres (ceres_minimizer.h)
//   ceres_lm+half_inverse   Ceres with an UpdateCallback (update_callback.h)
//   newton/inverse/adam     pull-backs, for a simulator and a loss
//
// Bounds:  Ceres may stop above the minimum where a bound is active. The
//          components that the gradient pushes against their bounds are then
//          held constant, and Ceres goes on with the others
//          (minimize/within_bounds.h), or the summary says NO_CONVERGENCE. An
//          evaluation callback of the problem must be in the options.
// Fails:   returns false, before anything runs, if the method does not apply
//          (phases, batches; for a problem pull-backs), if its rule cannot
//          propose steps for this problem (UpdateCallback::IsSupported), if a
//          rule alone would leave bounds of the problem, or if J, a dense solver
//          or BFGS needs more than the available memory.

// Whether the method applies to a problem without a chain; if not, *error gives
// the reason.
bool IsForProblems(const Method& method, std::string* error);

// `elimination_order`: the ordering for Ceres' Schur solvers; null: Ceres
// chooses.
bool MinimizeProblem(
    const Method& method,
    const MinimizerOptions& options,
    std::shared_ptr<ceres::ParameterBlockOrdering> elimination_order,
    ceres::Problem* problem,
    MinimizerSummary* summary,
    std::string* error);

// Minimizes from the objective's current point; `path` receives the points from
// the start to the final one. `inverse`: the simulator's inverse, or null.
bool MinimizeByMethod(const Method& method,
                      const MinimizerOptions& options,
                      std::shared_ptr<const InverseSimulator> inverse,
                      PointObjective* objective,
                      std::vector<Eigen::VectorXd>* path,
                      MinimizerSummary* summary,
                      std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_MINIMIZE_H_
