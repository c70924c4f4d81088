// Shows how a run is doing (--progress), and says when Ctrl-C is to end it.
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
  // After every step. False if the run is to end: an Interrupt
  // (report/interrupt.h) was requested.
  bool Update(const Now& now);

 private:
  ProgressState state_;
  Progress progress_;
};

}  // namespace invgrad

#endif  // BIN_SUPPORT_LIVE_RUN_H_
