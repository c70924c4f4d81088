// Jobs in processes (child_process.h) on all ranks of MPI, or one after the
// other without MPI. Rank 0 hands them out as ranks get free, and runs some
// itself; its messages are a job's number, and a job's error back.
//
// After a signal to any rank, no job is started, and the running ones are
// stopped. If a rank is lost, MPI ends all.
#ifndef BIN_SWEEP_DISPATCH_H_
#define BIN_SWEEP_DISPATCH_H_

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "bin/sweep/child_process.h"
#include "bin/sweep/schedule.h"

namespace invgrad {

// Writes its results to files. Returns false, with *error, if it has failed.
using RunOfJob = std::function<bool(int job, std::string* error)>;

struct JobStatus {
  enum class State { kWaiting, kRunning, kEnded };
  State state = State::kWaiting;
  std::string error;     // of a job that has ended; empty: none
  double seconds = 0.0;  // since it was started, while it runs
};

// On rank 0.
class Dispatcher {
 public:
  explicit Dispatcher(RunOfJob run);
  Dispatcher(const Dispatcher&) = delete;
  Dispatcher& operator=(const Dispatcher&) = delete;
  // Stops what still runs; the other ranks then return from ServeJobs.
  ~Dispatcher();

  // Calls prepare(job) in this process, and run(job) on a rank, for all waiting
  // jobs of the schedule. Returns when they have ended; after a signal half a
  // second later, because mpirun then kills its ranks after a second. Calls
  // on_wait several times a second.
  std::vector<JobStatus> Run(
      Schedule* schedule,
      const RunOfJob& prepare,
      const std::function<void(const std::vector<JobStatus>&)>& on_wait);

 private:
  using Clock = std::chrono::steady_clock;
  struct Slot {
    int job = -1;  // -1: none is running
    Clock::time_point start;
  };

  bool Start(int rank, int job, std::string* error);
  bool HasEnded(int rank, std::string* error);
  bool IsIdle() const;

  RunOfJob run_;
  ChildProcess own_;
  std::vector<Slot> slots_;  // one a rank
};

// On the other ranks: runs the jobs that rank 0 hands out, until its end.
void ServeJobs(const RunOfJob& run);

}  // namespace invgrad

#endif  // BIN_SWEEP_DISPATCH_H_
