#include "bin/support/live_run.h"

#include <utility>

#include "report/interrupt.h"

DEFINE_bool(progress, true, "show live how the runs are doing");

namespace invgrad {

LiveRun::LiveRun(const std::string& label, Describe describe)
    : describe_(std::move(describe)) {
  state_.label = label;
}

ceres::CallbackReturnType LiveRun::operator()(
    const ceres::IterationSummary& iteration) {
  state_.step = iteration.iteration;
  describe_(iteration, &state_);
  if (FLAGS_progress) progress_.Update(state_);
  return Interrupt::IsRequested() ? ceres::SOLVER_TERMINATE_SUCCESSFULLY
                                  : ceres::SOLVER_CONTINUE;
}

}  // namespace invgrad
