// A run on a point problem that is read again when it is done.
//
//   PREFIX + METHOD.csv   the path (point_path.h)
//   PREFIX + METHOD.run   the same for programs (minimization_record.h)
#ifndef BIN_SUPPORT_POINT_RUN_H_
#define BIN_SUPPORT_POINT_RUN_H_

#include <string>

#include "bin/support/point_path.h"
#include "invgrad/compare/problem.h"
#include "invgrad/method.h"
#include "invgrad/minimize.h"

namespace invgrad {

// 100 steps, and a tolerance for the gradient.
MinimizerOptions PointBudget();

// Adds both files to those of the program (run_directory.h).
bool ListPointRun(const std::string& prefix,
                  const Method& method,
                  std::string* error);

// Reads the path if the run is done; otherwise, and if may_run, runs the method.
// Without a path the status says why, and is empty if the run is not there.
// Returns false, with *error, if a file cannot be written.
bool RunOrReadPath(const std::string& prefix,
                   const PointProblem& problem,
                   const Method& method,
                   const MinimizerOptions& options,
                   bool may_run,
                   PointPath* path,
                   std::string* error);

}  // namespace invgrad

#endif  // BIN_SUPPORT_POINT_RUN_H_
