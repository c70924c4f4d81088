// Shows how a run is doing (--progress), and ends it on Ctrl-C.
#ifndef BIN_SUPPORT_LIVE_RUN_H_
#define BIN_SUPPORT_LIVE_RUN_H_

#include <functional>
#include <string>

#include "ceres/iteration_callback.h"
#include "gflags/gflags.h"
#include "report/progress.h"

DECLARE_bool(progress);

namespace invgrad {

// While an Interrupt exists (report/interrupt.h).
class LiveRun final : public ceres::IterationCallback {
 public:
  // `describe` sets what is known beside label and step: epoch, loss, share of
  // the budget.
  using Describe =
      std::function<void(const ceres::IterationSummary&, ProgressState*)>;
  LiveRun(const std::string& label, Describe describe);

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override;

 private:
  const Describe describe_;
  ProgressState state_;
  Progress progress_;
};

}  // namespace invgrad

#endif  // BIN_SUPPORT_LIVE_RUN_H_
