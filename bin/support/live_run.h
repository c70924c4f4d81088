// Shows the progress of a run (--progress), and ends it on Ctrl-C.
#ifndef BIN_SUPPORT_LIVE_RUN_H_
#define BIN_SUPPORT_LIVE_RUN_H_

#include <string>

#include "ceres/iteration_callback.h"
#include "report/progress.h"

namespace invgrad {

// Call after every step. Returns false if the run must end, after an Interrupt
// (report/interrupt.h).
bool ShowProgress(const ProgressState& state, Progress* progress);

// The same for a minimization by Ceres or by a rule.
class LiveCallback final : public ceres::IterationCallback {
 public:
  explicit LiveCallback(const std::string& label) { state_.label = label; }

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override;

 private:
  ProgressState state_;
  Progress progress_;
};

}  // namespace invgrad

#endif  // BIN_SUPPORT_LIVE_RUN_H_
