// The results of a sweep: one line per run, and the best alternative of every
// rule at every point of the grid.
//
// A minimization counts as a training run: its cost is the train loss.
//
// The value of a run is its last one, or the mean over the last part of its
// history, by the seconds of training. The best alternative has the lowest
// median over the seeds (SeedSpread in bin/support/run_output.h), the first one
// of several.
#ifndef BIN_SWEEP_RESULTS_H_
#define BIN_SWEEP_RESULTS_H_

#include <optional>
#include <string>
#include <vector>

#include "bin/support/learning_run.h"
#include "bin/support/run_output.h"
#include "bin/sweep/plan.h"
#include "report/table.h"

namespace invgrad {

struct SweepValue {
  std::string name;  // "test loss"
  double HistoryRow::*field = &HistoryRow::train_loss;
  double tail = 0.0;  // the part of the history that is averaged, in [0, 1)
};

// `name`: train_loss, test_loss, metric; or auto, the last of these that all
// problems have. Returns false, with *error set, for others.
bool FindSweepValue(const SweepPlan& plan,
                    const std::string& name,
                    double tail,
                    SweepValue* value,
                    std::string* error);

// The mean of the rows in the last part of the history, at least of the last.
double TailMean(const History& history, double HistoryRow::*field, double tail);

// A run, or the reason why there is none.
struct SweepRun {
  std::optional<LearningRunResult> result;
  std::string status;
};

// A rule at a point of the grid: its best alternative, all seeds.
struct SweepBest {
  std::vector<int> at;  // for every axis, which of its values; seed: 0
  const RuleAlternative* alternative = nullptr;  // in the plan
  std::vector<int> points;  // numbers in plan.points, one a seed
  SeedSpread spread;        // of their values

  int median_point() const { return points[spread.median_run]; }
};

struct SweepResults {
  const SweepPlan& plan;
  const std::vector<SweepRun>& runs;  // one a job
  const SweepValue& value;
  std::vector<SweepBest> best;  // in the order of the plan's points
};

// The arguments must outlive the results.
SweepResults FindBest(const SweepPlan& plan,
                      const std::vector<SweepRun>& runs,
                      const SweepValue& value);

// A row a run, all digits: every axis, alternative, train_loss, test_loss,
// metric, best_train_loss, steps, seconds, ms_per_step, best (1 or 0), at_edge,
// status. Unknown values are empty.
std::string SweepCsv(const SweepResults& results);

// A row a rule and point of the grid.
Table SweepTable(const SweepResults& results);

}  // namespace invgrad

#endif  // BIN_SWEEP_RESULTS_H_
