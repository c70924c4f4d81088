// Lets any update rule propose its steps inside a stock ceres::Solve.
//
//   UpdateCallback callback(UpdateCallback::Options{}, &rule, &problem);
//   ceres_options.callbacks.push_back(&callback);
//   ceres_options.update_state_every_iteration = true;
//   ceres::Solve(ceres_options, &problem, &summary);
//
// (contract: see the class)
#ifndef INVGRAD_SOLVE_UPDATE_CALLBACK_H_
#define INVGRAD_SOLVE_UPDATE_CALLBACK_H_

#include <memory>
#include <string>

#include "ceres/iteration_callback.h"
#include "ceres/problem.h"
#include "invgrad/rules/update_rule.h"

namespace invgrad {

class UpdateCallback final : public ceres::IterationCallback {
 public:
  struct Options {
    // Problem::Options::manifold_ownership of the problem, which Ceres 2.1 does
    // not let anyone ask for.
    ceres::Ownership manifold_ownership = ceres::TAKE_OWNERSHIP;
    // A rejected proposal is halved and proposed again at most so many times;
    // then Ceres' own step follows.
    int max_num_backoffs = 2;
    // Blocks with a larger tangent space are refused: Ceres multiplies J by a
    // k x k matrix for a block with a manifold of size k.
    int max_block_size = 512;
    // A proposal for which the linear model promises a smaller relative decrease
    // of the cost is left to Ceres, so that the run does not end by Ceres'
    // function tolerance on a step that was not Ceres' own.
    double min_relative_model_decrease = 1e-5;
  };

  struct Summary {
    int num_proposed = 0;
    int num_accepted = 0;  // of those proposed
    int num_rejected = 0;  // of those proposed
    int num_ceres_steps = 0;  // iterations left to Ceres
    std::string message;      // why the last proposal was not made
  };

  // Wraps the manifolds of the problem's blocks; ~UpdateCallback restores them,
  // so the problem must outlive the callback, and the callback the solve.
  UpdateCallback(const Options& options,
                 UpdateRule* rule,
                 ceres::Problem* problem);
  ~UpdateCallback() override;

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override;

  const Summary& summary() const;

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace invgrad

#endif  // INVGRAD_SOLVE_UPDATE_CALLBACK_H_
