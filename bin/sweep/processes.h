// Runs jobs in processes of their own, a few at a time: one that crashes takes
// no other with it.
//
// A job is a function of its number, run in a child (fork), whose files are all
// that it leaves. It may return false with an error, which is passed on. While
// an Interrupt (report/interrupt.h) exists, SIGINT and SIGTERM reach the parent
// alone: it starts no further job and sends SIGINT to those that run, which
// should look at IsStopRequested and end early.
//
// Fails:   CHECKs that num_processes >= 1. The caller must have no threads that
//          hold locks, as always with fork.
#ifndef BIN_SWEEP_PROCESSES_H_
#define BIN_SWEEP_PROCESSES_H_

#include <functional>
#include <string>
#include <vector>

namespace invgrad {

struct ProcessStatus {
  enum class State {
    kWaiting,
    kRunning,
    kDone,
    kFailed,   // returned false; see message
    kCrashed,  // "ended by signal 11 (Segmentation fault)"
  };
  State state = State::kWaiting;
  std::string message;
  double seconds = 0.0;  // since it was started, while it runs
};

// Returns when all jobs have ended, or, after an interrupt, those that were
// running. `on_wait` is called some times a second.
std::vector<ProcessStatus> RunInProcesses(
    int num_jobs,
    int num_processes,
    const std::function<bool(int job, std::string* error)>& run,
    const std::function<void(const std::vector<ProcessStatus>&)>& on_wait);

// In a job: whether the parent wants it to end, or is no more.
bool IsStopRequested();

}  // namespace invgrad

#endif  // BIN_SWEEP_PROCESSES_H_
