#include "bin/support/live_run.h"

#include "report/interrupt.h"

DEFINE_bool(progress, true, "show live how the runs are doing");

namespace invgrad {

bool ShowProgress(const ProgressState& state, Progress* progress) {
  if (FLAGS_progress) progress->Update(state);
  return !Interrupt::IsRequested();
}

}  // namespace invgrad
