// Lets any update rule propose its steps inside a stock ceres::Solve.
//
//   UpdateCallback callback(UpdateCallback::Options{}, &rule, &problem);
//   ceres_options.callbacks.push_back(&callback);
//   ceres_options.update_state_every_iteration = true;
//   ceres::Solve(ceres_options, &problem, &summary);
//
// At an accepted state, if it is the rule's turn, the callback linearizes the
// problem, asks the rule for a step and stages it. A manifold wrapped around
// each parameter block's own puts the staged step in the place of Ceres' own at
// the next Plus, which is where the trust-region minimizer forms its candidate.
// Ceres then accepts or rejects the candidate by its gain ratio, as ever: the
// cost never rises, and progress table, summary, tolerances, robust losses,
// constant blocks, manifolds and threads are those of the user.
//
// Rule and Ceres take turns, which go to the one whose steps decrease the cost
// more (turn_taking.h): a rule that is slow near the minimum leaves that part
// of the way to Ceres, and one that has no step, or none from which the linear
// model promises enough, is asked less and less, because each question costs a
// linearization.
//
// A rejected proposal is halved and proposed again; the scale is remembered and
// doubles, up to 1, with every proposal that is accepted or promises too
// little. If max_num_backoffs do not help, the turn is Ceres' until its trust
// region, which rejections shrink, is as large again as before, or Ceres finds
// it too large itself, or has had eight turns. A rule that judges its steps
// (control=gain) is told what cost each proposal led to, and at what scale; the
// verdict is Ceres', and the scale is not remembered beside the rule's own.
//
// Needs:   minimizer_type = TRUST_REGION (LM or dogleg; inner iterations and
//          nonmonotonic steps may be on) and update_state_every_iteration; the
//          callback aborts the solve, and says why in summary().message, if
//          either is missing. No bounds on blocks that are not constant,
//          because Ceres' projected line search calls Plus repeatedly. One
//          callback a problem at a time, one solve a callback, and no other
//          solve of the problem while it lives. Rules must not throw.
// Cost:    one linearization and one step of the rule at each of its turns, on
//          top of Ceres' own (a linearization evaluates all residual blocks,
//          unless the problem is a CachedProblem; for a rule that needs none it
//          is made only once there is a step); k^2 numbers for a block of size
//          k that had no manifold, and while a step is staged a product with J.
// Fails:   numerical failures of the rule are Ceres' turn, never errors.
#ifndef INVGRAD_CERES_UPDATE_CALLBACK_H_
#define INVGRAD_CERES_UPDATE_CALLBACK_H_

#include <memory>
#include <string>

#include "ceres/iteration_callback.h"
#include "ceres/problem.h"
#include "ceres/types.h"
#include "invgrad/ceres/cached_problem.h"
#include "invgrad/core/update_rule.h"

namespace invgrad {

class UpdateCallback final : public ceres::IterationCallback {
 public:
  struct Options {
    // Problem::Options::manifold_ownership of the problem, which Ceres 2.1 does
    // not let anyone ask for. It must be the problem's: wrongly told, a
    // manifold is deleted twice or not at all.
    ceres::Ownership manifold_ownership = ceres::TAKE_OWNERSHIP;
    // The rule has its turns only while its steps gain more than Ceres' own
    // (turn_taking.h). False: at every accepted state, as long as it has steps.
    bool by_merit = true;
    // A rejected proposal is halved and proposed again at most so many times.
    int max_num_backoffs = 2;
    // Blocks with a larger tangent space are refused: Ceres multiplies J by a
    // k x k matrix for a block with a manifold of size k.
    int max_block_size = 512;
    // A proposal for which the linear model promises a smaller relative
    // decrease of the cost is left to Ceres, so that the run does not end by
    // Ceres' function tolerance on a step that was not Ceres' own.
    double min_relative_model_decrease = 1e-3;
  };

  // Of the last solve. num_proposed = num_accepted + num_rejected, and one more
  // if a proposal's change was within Ceres' tolerances, which ends the run.
  struct Summary {
    int num_proposed = 0;
    int num_accepted = 0;     // of those proposed
    int num_rejected = 0;     // of those proposed
    int num_ceres_steps = 0;  // iterations left to Ceres
    std::string message;      // why the last proposal was not made

    // "12 proposed, 9 accepted, 3 rejected, 4 steps of Ceres"
    std::string BriefReport() const;
  };

  // False, with *error saying what to do, if the problem has bounds or blocks
  // that are too large.
  static bool IsSupported(const Options& options,
                          const ceres::Problem& problem,
                          std::string* error);

  // Wraps the manifolds of the problem's blocks; ~UpdateCallback restores them,
  // so the problem must outlive the callback, and the callback the solve.
  // Blocks and their constness must not change in between. CHECKs IsSupported,
  // and that no other callback of the problem wraps them.
  UpdateCallback(const Options& options,
                 UpdateRule* rule,
                 ceres::Problem* problem);
  // The same for a problem that spares the callback an evaluation; its
  // manifolds are its own, and options.manifold_ownership is not read.
  UpdateCallback(const Options& options,
                 UpdateRule* rule,
                 CachedProblem* problem);
  ~UpdateCallback() override;

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override;

  Summary summary() const;

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_UPDATE_CALLBACK_H_
