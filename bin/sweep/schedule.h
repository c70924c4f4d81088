// Which job is next: the one that is expected to take longest, so that the jobs
// at the end are short.
//
//   expected seconds = min(max_seconds, work * seconds per work)
//
// The last factor is the largest that the finished jobs of the same kind had (a
// run that diverges takes less), or those of all kinds; before the first has
// finished it is 1 / UpdateRule::kOperationsPerSecond.
#ifndef BIN_SWEEP_SCHEDULE_H_
#define BIN_SWEEP_SCHEDULE_H_

#include <limits>
#include <map>
#include <string>
#include <vector>

#include "bin/sweep/plan.h"
#include "invgrad/train/train.h"

namespace invgrad {

class Schedule {
 public:
  struct Job {
    std::string kind;
    double work = 0.0;  // in operations
    double max_seconds = std::numeric_limits<double>::infinity();
  };

  explicit Schedule(std::vector<Job> jobs)
      : jobs_(std::move(jobs)), is_waiting_(jobs_.size(), true) {}

  int num_jobs() const { return static_cast<int>(jobs_.size()); }

  // Takes the next waiting job, the first one of several that are expected to
  // take as long; -1: none is waiting.
  int Next();

  // The job has finished, or is left out: it does not wait. seconds: it took so
  // long; NaN: not known.
  void Finish(int job, double seconds);

  double ExpectedSeconds(int job) const;

  // The share of the expected seconds of all jobs that is over, in [0, 1].
  // running_seconds[job]: since it was started; 0: it is not running.
  double FractionDone(const std::vector<double>& running_seconds) const;

 private:
  std::vector<Job> jobs_;
  std::vector<bool> is_waiting_;
  std::vector<bool> is_finished_ = std::vector<bool>(jobs_.size(), false);
  std::map<std::string, double> seconds_per_work_;  // of a kind; "": of all
};

// The kind is the method. The work is that of the passes through the network and
// of the rule's steps.
Schedule::Job ScheduledJob(const SweepJob& job, const TrainOptions& options);

}  // namespace invgrad

#endif  // BIN_SWEEP_SCHEDULE_H_
