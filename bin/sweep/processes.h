// Runs jobs in separate processes, a few at a time, so that a crash affects
// only one job.
//
// A job is a function of its number, called in a child process (fork); its only
// output are files. The error of a job that returns false is passed on. While
// an Interrupt (report/interrupt.h) exists, only the parent receives SIGINT and
// SIGTERM. It then starts no further job and sends SIGINT to the running jobs,
// which should check IsStopRequested and end early.
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

// Returns when all jobs have ended, or, after an interrupt, all running jobs.
// Calls `on_wait` several times a second.
std::vector<ProcessStatus> RunInProcesses(
    int num_jobs,
    int num_processes,
    const std::function<bool(int job, std::string* error)>& run,
    const std::function<void(const std::vector<ProcessStatus>&)>& on_wait);

// In a job: whether the parent has requested the end, or has ended.
bool IsStopRequested();

}  // namespace invgrad

#endif  // BIN_SWEEP_PROCESSES_H_
