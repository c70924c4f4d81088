// One run of a comparison of estimations, one way from one start, and its files.
#ifndef BIN_ESTIMATE_ESTIMATION_RUN_H_
#define BIN_ESTIMATE_ESTIMATION_RUN_H_

#include <string>

#include "bin/estimate/estimation_comparison.h"
#include "bin/estimate/estimation_table.h"
#include "bin/estimate/run_report.h"
#include "bin/estimate/way.h"

namespace invgrad {

struct EstimationRun {
  EstimationRow row;
  // Of a run that was read: without its minimizer's proposals.
  RunReport report;
};

// Adds the files of the run to those of the program (run_directory.h).
bool ListEstimationRun(const EstimationOptions& options,
                       const std::string& start_name,
                       const Way& way,
                       const Estimation& estimation,
                       std::string* error);

// Reads the run if it is done; otherwise, and if may_run, runs the way from the
// start at which the estimation is. The estimation is then at the result. A way
// that does not support the problem has a row with the reason. A run that is not
// there has an empty status. Returns false, with *error, if a file cannot be
// written.
bool RunOrReadEstimation(const EstimationOptions& options,
                         const std::string& start_name,
                         const Way& way,
                         bool may_run,
                         Estimation* estimation,
                         EstimationRun* run,
                         std::string* error);

}  // namespace invgrad

#endif  // BIN_ESTIMATE_ESTIMATION_RUN_H_
