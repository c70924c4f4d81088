// Lets an update rule, or a function of yours, propose steps inside an ordinary
// ceres::Solve. Use it to try whether half-inverse steps help your solve, or to
// give it what you know: a closed-form inverse, scale-invariant physics training
// (proposal.h). docs/tutorials/propose_steps.md says when they help. To take
// the steps of a rule without Ceres use minimize.h.
//
//   auto rule = MakeRule("geodesic");
//   UpdateCallback callback(rule.get(), &problem);
//   callback.AddTo(&options);
//   ceres::Solve(options, &problem, &summary);
//
// What follows says "rule" for both.
//
// After each accepted step, at the rule's turns, the callback linearizes the
// problem and computes the rule's step, which replaces Ceres' next step: a
// wrapper around the manifold of each parameter block adds it when Ceres forms
// its candidate. Ceres accepts or rejects the candidate by its gain ratio, so
// the cost never rises, unless nonmonotonic steps are on. Progress table,
// summary, robust losses, constant blocks, manifolds and threads work as
// without the callback.
//
// Tolerances apply to Ceres' own steps only. The solve without proposals runs
// once, before the first proposal, and the better result is kept (safeguard.h).
// Proposals end when they have taken as long (work_limit.h), and a rule whose
// step takes longer than all of Ceres' iterations makes none.
//
// Rule and Ceres take turns; the one whose steps decrease the cost more has
// more turns (turn_taking.h). The turns of a rule become rarer if it has no
// step, or if the linear model predicts no sufficient decrease.
//
// A step that does not lower the cost is halved, up to two times, before it is
// proposed (proposal.h). If a step of Ceres leads to where the problem cannot
// be evaluated, the rule has the next turn, once at each state, unless it waits
// because its last turn was in vain. The summary names the parameter that did
// it (domain_failure.h).
//
// Needs:   minimizer_type = TRUST_REGION (LM or dogleg; inner iterations and
//          nonmonotonic steps may be on. Without an inner_iteration_ordering
//          Ceres orders inner iterations by the addresses of its blocks, so
//          that two solves differ, and the solve without proposals is no longer
//          the one without a callback); otherwise the callback aborts the
//          solve, and summary().message gives the reason. One callback for a
//          problem at a time, AddTo before each solve, and no solve of the
//          problem without AddTo while the callback exists. Rules must not
//          throw.
// Bounds:  a candidate is projected onto them, as Ceres does after each Plus.
//          AddTo switches Ceres' projected line search off (Solver::Options::
//          max_num_line_search_step_size_iterations = 0) for the solve with
//          proposals, because it calls Plus several times for a candidate; the
//          solve without proposals has it. Where a bound is active, Ceres may
//          stop above the minimum, with or without proposals: its step is
//          computed without the bounds. MinimizeProblem (minimize.h) goes on
//          from there.
// Cost:    at each turn of the rule one step and one or two linearizations, at
//          x and at the candidate, which evaluate all residual blocks. While a
//          step is staged, Ceres multiplies J by a k x k matrix for a Euclidean
//          block of size k. With compare_with_plain one more solve. The first
//          step of Ceres that leaves the domain is computed again.
// Fails:   as Ceres does. A step that leads to where the Jacobian is not finite
//          is not proposed. After a numerical failure of the rule Ceres has the
//          turn.
#ifndef INVGRAD_UPDATE_CALLBACK_H_
#define INVGRAD_UPDATE_CALLBACK_H_

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ceres/evaluation_callback.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "ceres/types.h"
#include "invgrad/proposal.h"
#include "invgrad/update_rule.h"

namespace invgrad {

// Why a problem cannot be evaluated at a candidate: the first residual block
// that fails, and the fewest parameters that explain it.
//
//   r = log(b0 + b1 t):  "residual block 12 (cost function returned false):
//                         parameter `b`[1] = -0.31 (was 400)"
struct DomainFailure {
  enum class Reason {
    kPlus,      // a Plus returned false
    kReturned,  // a cost function returned false
    kResidual,  // not finite
    kCost,      // 1/2 rho(|r|^2) is not finite, r is
    kJacobian,  // not finite
  };

  struct Options {
    // The name of a block; "" or no function: "block i", as in a RankReport.
    std::function<std::string(const double* values)> block_name;
    // The evaluation callback of the problem, if any. Not owned.
    ceres::EvaluationCallback* evaluation_callback = nullptr;
  };

  struct Parameter {
    int block = 0;       // of ProblemStructure::parameter_blocks
    std::string name;    // of the block
    int component = -1;  // -1: the whole block
    // Of the component; of a whole block, the norms.
    double value = 0.0;  // at the bad state
    double was = 0.0;    // at the good state
  };

  Reason reason = Reason::kReturned;
  int residual_block = -1;  // its index in the problem; -1: kPlus
  // Outside at the bad state; kPlus: parameter blocks whose Plus fails.
  int num_failing_blocks = 0;
  // The good state lies outside, too, and no parameter explains it.
  bool fails_at_good_state = false;
  // Only without Jacobians, as for cost functions that return false for
  // jacobians = nullptr.
  bool only_without_jacobians = false;
  // The bad state is the start, and `was` is a value at which the residual block
  // can be evaluated.
  bool is_start = false;
  std::vector<Parameter> parameters;

  // As above; after 5 parameters the rest is a count.
  std::string ToText() const;
};

class UpdateCallback final {
 public:
  struct Options {
    // True: the rule has turns while its steps decrease the cost more than
    // Ceres' own (turn_taking.h). False: the rule has every turn for which it
    // has a step.
    bool by_merit = true;
    // True: Ceres makes no step of its own, and there is no comparison with the
    // plain solve and no limit on work. The solve ends, with USER_SUCCESS, at
    // the first state where the rule has no step that lowers the cost, where
    // its step promises less than min_relative_model_decrease, or after Ceres
    // has rejected one. For rules that leave directions alone
    // (determined_rule.cc), along which a step of Ceres would drift.
    bool only_proposals = false;
    // The limit on tangent spaces (see Cost).
    int max_block_size = 512;
    // A proposal is made only if the linear model predicts
    //   L(x) - L(x + step) >= min_relative_model_decrease * L(x).
    // With only_proposals no step of Ceres comes after the last proposal, and
    // this is the only tolerance: of m residuals, each with the same noise, the
    // end may be sqrt(min_relative_model_decrease m) standard errors from the
    // minimum. 1e-6, Ceres' default function tolerance, goes on to it.
    double min_relative_model_decrease = 1e-3;
    // True: the solve without proposals runs as well, and its result is kept if
    // it is better (safeguard.h).
    bool compare_with_plain = true;
    // The limit on the time of the solve, the comparison included, relative to
    // that of the solve without proposals: by an estimate from the sizes of the
    // problem (work_limit.h). Infinity: none.
    double max_relative_work = 2.0;
    // Of a proposal function, for that estimate: the time of a call, relative
    // to an iteration of Ceres.
    double iterations_of_function = 1.0;
    // The problem's Problem::Options::manifold_ownership, which Ceres 2.1 does
    // not expose. A problem that owns its manifolds keeps those of the
    // callback, 64 bytes for each parameter block, until it is destroyed. If
    // the option is wrong, they leak or are deleted twice.
    ceres::Ownership manifold_ownership = ceres::TAKE_OWNERSHIP;
    // The evaluation callback of the problem, which Ceres 2.1 does not expose.
    // Without it, candidates are evaluated with the values that it prepared for
    // another state, and there may be no comparison. Not owned.
    ceres::EvaluationCallback* evaluation_callback = nullptr;
    // Of a block, for the explanation of a domain failure; "" or no function:
    // "block i", as in a RankReport.
    std::function<std::string(const double* values)> block_name;
  };

  // Summary of the last solve. num_proposed = num_accepted + num_rejected, plus
  // one if a proposal met one of Ceres' tolerances and ended the run.
  struct Summary {
    int num_proposed = 0;
    int num_accepted = 0;  // of those proposed
    int num_rejected = 0;  // of those proposed
    // Steps and halves that would not lower the cost, or lead to where Ceres
    // could not continue (proposal.h).
    int num_withheld = 0;
    int num_ceres_steps = 0;  // iterations with a step of Ceres
    // Steps of the solve without proposals, or if there was none of Ceres, after
    // which Ceres widens the trust region. If it does so in many steps, the
    // region may have been what limited them.
    int num_limited_steps = 0;
    // Candidates, of Ceres and of the rule, at which the problem cannot be
    // evaluated, and why not at the first of them. No explanation if none was
    // found, as after inner iterations. A start that cannot be evaluated counts
    // as one.
    int num_outside_domain = 0;
    std::optional<DomainFailure> first_outside_domain;
    // Why there was no proposal at the last turn, or none at all.
    std::string message;
    // A proposal changed the cost by nothing at all, or the tolerances were set
    // after AddTo.
    bool ended_on_proposal = false;
    // The run has met a tolerance, but Ceres, without a valid step at the end,
    // reports USER_SUCCESS in place of CONVERGENCE.
    bool has_converged = false;
    // The relative decrease of the cost that the linear model predicts where a
    // tolerance was met last; above 0 the end is no minimum (safeguard.h).
    double predicted_decrease = 0.0;
    int num_plain_iterations = 0;  // of the solve without proposals
    // The solve without proposals was better, and its result is the run's.
    bool took_plain_result = false;

    // "12 proposed, 9 accepted, 3 rejected, 4 steps of Ceres", and what else is
    // notable.
    std::string BriefReport() const;
  };

  // False, with *error, if a block is too large.
  static bool IsSupported(const Options& options,
                          const ceres::Problem& problem,
                          std::string* error);

  // Wraps the manifolds of the problem's blocks; the destructor restores them
  // (a LocalParameterization of Ceres 2.1 as its manifold), but for those that
  // you have set since. Rule and problem must outlive the callback, and the
  // callback all solves with the options of AddTo. Before blocks, manifolds or
  // constness change, end the callback; make a new one for the next solve.
  // CHECKs IsSupported, and that the problem has no other UpdateCallback.
  UpdateCallback(UpdateRule* rule, ceres::Problem* problem);
  UpdateCallback(UpdateRule* rule,
                 ceres::Problem* problem,
                 const Options& options);
  // The same with proposals of a function.
  UpdateCallback(ProposalFunction function, ceres::Problem* problem);
  UpdateCallback(ProposalFunction function,
                 ceres::Problem* problem,
                 const Options& options);
  ~UpdateCallback();

  // Adds the callback, sets update_state_every_iteration, and sets the three
  // tolerances to zero, because the callback applies them to the steps of Ceres
  // only (safeguard.h). Set all other options before: a tolerance that is set
  // later can end the run on a proposal. For another solve call it again, with
  // new options or the same; the rule keeps its memory. In the same options a
  // tolerance of 0 is replaced by the earlier one: set 1e-300 instead. The
  // options then point to the callback: do not solve with them after its end.
  // CHECKs that no manifold was set, and no block held constant, since the
  // callback exists.
  void AddTo(ceres::Solver::Options* options);

  Summary summary() const;

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace invgrad

#endif  // INVGRAD_UPDATE_CALLBACK_H_
