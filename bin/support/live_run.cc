#include "bin/support/live_run.h"

#include "report/interrupt.h"

DEFINE_bool(progress, true, "show live how the runs are doing");

namespace invgrad {

bool ShowProgress(const ProgressState& state, Progress* progress) {
  if (FLAGS_progress) progress->Update(state);
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
