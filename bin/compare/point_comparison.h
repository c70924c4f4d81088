// All methods on a point problem: paths and final losses.
//
//   DIR/path-METHOD.csv         see point_path.h
//   DIR/table.txt, DIR/table.md
//   DIR/loss.png                L against iterations
//
// With more than kMaxPrintedSize unknowns also:
//
//   DIR/x-METHOD.npy            the final x
//   DIR/x-true.npy              x*, if it is known
//   DIR/fields.png              x* and every final x, if x is a field
//
// |x - x*| is nan if x* is not known. Norms are Euclidean; "mean |x - x*|" in
// the table is the mean over entries.
#ifndef BIN_COMPARE_POINT_COMPARISON_H_
#define BIN_COMPARE_POINT_COMPARISON_H_

#include <ostream>
#include <string>
#include <vector>

#include "bin/compare/point_path.h"

namespace invgrad {

// A method that does not support the problem has a row with the reason. Returns
// false if results cannot be written, or if no method could run.
bool ComparePoint(const PointProblem& problem,
                  const std::vector<Method>& methods,
                  const PointPathOptions& options,
                  const std::string& directory,
                  std::ostream& out,
                  std::string* error);

}  // namespace invgrad

#endif  // BIN_COMPARE_POINT_COMPARISON_H_
