// All methods on a point problem: paths and final losses.
//
//   DIR/path-METHOD.csv, .run   see point_run.h
//   DIR/table.txt, DIR/table.md
//   DIR/loss.png                L against iterations
//   DIR/report.html             all of it for a browser (point_report.h)
//
// With more than kMaxPrintedSize unknowns there are also:
//
//   DIR/x-METHOD.npy            the final x
//   DIR/x-true.npy              x*, if it is known
//   DIR/fields.png              x* and every final x, if x is a field
//
// On several ranks, each takes the next method of the list in turn, until all
// are done; rank 0 then reads them, as --resume does.
//
// Norms are Euclidean; "mean |x - x*|" in the table is the mean over entries.
#ifndef BIN_COMPARE_POINT_COMPARISON_H_
#define BIN_COMPARE_POINT_COMPARISON_H_

#include <string>
#include <vector>

#include "bin/compare/compare_options.h"
#include "bin/support/program.h"
#include "invgrad/compare/problem.h"
#include "invgrad/method.h"

namespace invgrad {

// A method that does not support the problem has a row with the reason, and
// failed. Returns false, with *error, if an option does not fit the problem or
// if results cannot be written.
bool ComparePoint(CompareOptions* options,
                  const PointProblem& problem,
                  const std::vector<Method>& methods,
                  RunCounts* counts,
                  std::string* error);

}  // namespace invgrad

#endif  // BIN_COMPARE_POINT_COMPARISON_H_
