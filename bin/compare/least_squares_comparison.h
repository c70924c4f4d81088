// All methods on a least-squares problem (compare/problem.h), from all seeds, as
// `estimate` compares them on files: see estimation_comparison.h for what DIR
// has. START is the problem's name with -seedS, and METHOD.txt the result: a
// parameter block a line. The table also has the gradient's norm, evaluations
// of all residuals, and the seconds until the cost was at most --levels above
// the known minimum.
#ifndef BIN_COMPARE_LEAST_SQUARES_COMPARISON_H_
#define BIN_COMPARE_LEAST_SQUARES_COMPARISON_H_

#include <string>
#include <vector>

#include "bin/compare/compare_options.h"
#include "bin/support/program.h"
#include "invgrad/compare/problem.h"
#include "invgrad/method.h"

namespace invgrad {

// Returns false, with *error, if an option does not fit the problem or if
// results cannot be written.
bool CompareLeastSquares(CompareOptions* options,
                         const LeastSquaresProblem& problem,
                         const std::vector<Method>& methods,
                         RunCounts* counts,
                         std::string* error);

}  // namespace invgrad

#endif  // BIN_COMPARE_LEAST_SQUARES_COMPARISON_H_
