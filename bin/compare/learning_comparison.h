// All methods on a learning problem, from all seeds: table, CSV and pictures.
//
//   DIR/METHOD-seedK/...   see bin/support/learning_run.h
//   DIR/initial_weights-seedK.npy, DIR/data.npy
//   DIR/table.txt, DIR/table.md, DIR/summary.csv
//   DIR/report.html   all of it for a browser (learning_report.h)
//   DIR/loss.png, neurons.png, map.png, fields.png, sample_path.png:
//                     see learning_plots.h
//
// The table shows the median over the seeds of a method for each column; curves
// and times show the run with the median final train loss. A failed run counts
// as worst.
#ifndef BIN_COMPARE_LEARNING_COMPARISON_H_
#define BIN_COMPARE_LEARNING_COMPARISON_H_

#include <string>
#include <vector>

#include "bin/compare/compare_options.h"
#include "bin/support/program.h"
#include "invgrad/compare/problem.h"
#include "invgrad/method.h"

namespace invgrad {

// Runs everything by the options, whose budget is the problem's if they have
// none, and prints the table. Returns false, with *error, if an option does not
// fit the problem or if results cannot be written.
bool CompareLearning(CompareOptions* options,
                     LearningProblem problem,
                     const std::vector<Method>& methods,
                     RunCounts* counts,
                     std::string* error);

}  // namespace invgrad

#endif  // BIN_COMPARE_LEARNING_COMPARISON_H_
