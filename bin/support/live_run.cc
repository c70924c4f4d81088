#include "bin/support/live_run.h"

#include "bin/support/output_options.h"
#include "report/interrupt.h"

namespace invgrad {

bool ShowProgress(const ProgressState& state, Progress* progress) {
  if (Output().progress) progress->Update(state);
  return !Interrupt::IsRequested();
}

ceres::CallbackReturnType LiveCallback::operator()(
    const ceres::IterationSummary& iteration) {
  state_.step = iteration.iteration;
  state_.loss = iteration.cost;
  return ShowProgress(state_, &progress_)
             ? ceres::SOLVER_CONTINUE
             : ceres::SOLVER_TERMINATE_SUCCESSFULLY;
}

}  // namespace invgrad
