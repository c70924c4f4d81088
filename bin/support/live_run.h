// Shows the progress of a run (--progress), and ends it on Ctrl-C.
#ifndef BIN_SUPPORT_LIVE_RUN_H_
#define BIN_SUPPORT_LIVE_RUN_H_

#include "gflags/gflags.h"
#include "report/progress.h"

DECLARE_bool(progress);

namespace invgrad {

// Call after every step. Returns false if the run must end, after an Interrupt
// (report/interrupt.h).
bool ShowProgress(const ProgressState& state, Progress* progress);

}  // namespace invgrad

#endif  // BIN_SUPPORT_LIVE_RUN_H_
