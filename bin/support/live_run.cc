#include "bin/support/live_run.h"

#include "report/interrupt.h"

DEFINE_bool(progress, true, "show live how the runs are doing");

namespace invgrad {

bool LiveRun::Update(const Now& now) {
  state_.step = now.step;
  state_.loss = now.loss;
  state_.epoch = now.epoch;
  state_.fraction = now.fraction;
  if (FLAGS_progress) progress_.Update(state_);
  return !Interrupt::IsRequested();
}

}  // namespace invgrad
