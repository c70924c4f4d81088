// Shows the progress of a run (--progress), and ends it on Ctrl-C.
#ifndef BIN_SUPPORT_LIVE_RUN_H_
#define BIN_SUPPORT_LIVE_RUN_H_

#include <string>

#include "gflags/gflags.h"
#include "report/progress.h"

DECLARE_bool(progress);

namespace invgrad {

class LiveRun {
 public:
  explicit LiveRun(const std::string& label) { state_.label = label; }

  struct Now {
    long step = 0;
    double loss = ProgressState::kUnknown;
    double epoch = ProgressState::kUnknown;
    double fraction = ProgressState::kUnknown;  // of the budget
  };
  // Call after every step. Returns false if the run must end, after an
  // Interrupt (report/interrupt.h).
  bool Update(const Now& now);

 private:
  ProgressState state_;
  Progress progress_;
};

}  // namespace invgrad

#endif  // BIN_SUPPORT_LIVE_RUN_H_
