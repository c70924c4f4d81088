#include "bin/sweep/schedule.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace invgrad {

int Schedule::Next() {
  int next = -1;
  for (int i = 0; i < num_jobs(); ++i) {
    if (is_waiting_[i] &&
        (next < 0 || ExpectedSeconds(i) > ExpectedSeconds(next))) {
      next = i;
    }
  }
  if (next >= 0) is_waiting_[next] = false;
  return next;
}

void Schedule::Finish(int job, double seconds) {
  is_waiting_[job] = false;
  is_finished_[job] = true;
  if (!(jobs_[job].work > 0.0) || !(seconds > 0.0)) return;
  for (const std::string& kind : {jobs_[job].kind, std::string()}) {
    double& known = seconds_per_work_[kind];
    known = std::max(known, seconds / jobs_[job].work);
  }
}

double Schedule::ExpectedSeconds(int job) const {
  double seconds_per_work = 1.0 / UpdateRule::kOperationsPerSecond;
  for (const std::string& kind : {std::string(), jobs_[job].kind}) {
    const auto known = seconds_per_work_.find(kind);
    if (known != seconds_per_work_.end()) seconds_per_work = known->second;
  }
  return std::min(jobs_[job].max_seconds, jobs_[job].work * seconds_per_work);
}

double Schedule::FractionDone(
    const std::vector<double>& running_seconds) const {
  double done = 0.0, all = 0.0;
  for (int i = 0; i < num_jobs(); ++i) {
    const double expected = ExpectedSeconds(i);
    // Before a job has finished only the limits say how long one takes.
    const bool is_known =
        !seconds_per_work_.empty() || expected == jobs_[i].max_seconds;
    all += expected;
    done += is_finished_[i] ? expected
            : is_known      ? std::min(expected, running_seconds[i])
                            : 0.0;
  }
  return all > 0.0 ? done / all : 1.0;
}

Schedule::Job ScheduledJob(const SweepJob& job, const TrainOptions& options) {
  const Model& model = *job.problem->model;
  const int num_samples = job.problem->train.num_samples();
  const double num_weights = model.num_weights();
  double work_per_sample = 0.0;  // the largest of the phases
  int batch_size = 1;
  for (const Phase& phase : job.method.phases) {
    const int size = phase.BatchSize(job.batch_size, num_samples);
    JacobianSizes sizes;
    sizes.rows = 1.0 * size * model.simulator().num_outputs();
    sizes.cols = num_weights;
    const double step =
        phase.rule != nullptr ? phase.MakeRule()->StepWork(sizes) : 0.0;
    constexpr double kPasses = 6.0;  // forward and backward, by two each
    work_per_sample =
        std::max(work_per_sample, kPasses * num_weights + step / size);
    batch_size = std::max(batch_size, size);
  }
  const double trained =
      std::min(1.0 * options.max_num_epochs * num_samples,
               1.0 * static_cast<double>(options.max_num_steps) * batch_size);
  return {
      job.method.label, trained * work_per_sample, options.max_time_in_seconds};
}

}  // namespace invgrad
