// The report of a learning comparison (report/html_report.h): losses and the
// problem's metric against seconds, steps, epochs and calls of the simulator
// (chain/counted_simulator.h), the median over the seeds with their range.
#ifndef BIN_COMPARE_LEARNING_REPORT_H_
#define BIN_COMPARE_LEARNING_REPORT_H_

#include <string>
#include <vector>

#include "bin/support/learning_run.h"
#include "bin/support/run_output.h"
#include "invgrad/compare/problem.h"
#include "invgrad/method.h"
#include "report/html_report.h"
#include "report/table.h"

namespace invgrad {

// A method from all seeds.
struct MethodResults {
  std::string label;
  std::string refusal;  // why runs are missing; empty: they are still to come
  std::vector<LearningRunResult> runs;

  SeedSpread Spread(double HistoryRow::*loss) const;
  // The run with the median of this final loss; null if there are no runs.
  const LearningRunResult* MedianRun(double HistoryRow::*loss) const;
};

// `all`: one a method. `budget`: of a run, "6 s of training". is_over: otherwise
// runs are still to come.
HtmlReport LearningReport(const LearningProblem& problem,
                          const std::vector<Method>& methods,
                          const std::vector<MethodResults>& all,
                          const Table& table,
                          const std::vector<int>& seeds,
                          const std::string& budget,
                          bool is_over);

}  // namespace invgrad

#endif  // BIN_COMPARE_LEARNING_REPORT_H_
