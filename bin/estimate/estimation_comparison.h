// Methods side by side on problems of estimation, from the same starts.
//
//   DIR/table.txt, table.md, results.csv    a row a run
//   DIR/summary.txt, summary.md             a row a method
//   DIR/START/METHOD.dat (.txt, .g2o)       the result, in the input's format
//   DIR/START/METHOD.csv                    iteration, cost, seconds, accepted
//   DIR/START/METHOD.json                   the run for programs (docs/json.md)
//   DIR/START/result.png                    the start and every result
//   DIR/START/cost.png                      cost against iterations and seconds
//
// With --covariance also
//
//   DIR/START/METHOD.report.txt             standard deviations, correlations,
//                                           what is not determined
//   DIR/START/covariance.png                bands (nist), ellipses (g2o)
//
// START is the name of the input, with -startK if it has several starts and
// -seedS if they are perturbed.
#ifndef BIN_ESTIMATE_ESTIMATION_COMPARISON_H_
#define BIN_ESTIMATE_ESTIMATION_COMPARISON_H_

#include <memory>
#include <string>
#include <vector>

#include "bin/support/program.h"
#include "gflags/gflags.h"
#include "invgrad/method.h"
#include "problems/estimation/estimation.h"

// Defined in estimate.cc, because compare has flags of the same names.
DECLARE_string(separable);
DECLARE_string(start);
DECLARE_string(loss);
DECLARE_bool(covariance);
DECLARE_double(perturb);
DECLARE_string(seeds);
DECLARE_int32(max_iterations);
DECLARE_double(seconds);
DECLARE_double(function_tolerance);
DECLARE_int32(threads);

namespace invgrad {

struct EstimationInput {
  std::string name;  // unlike all others'
  std::unique_ptr<Estimation> estimation;
};

// Runs all methods from the starts of the flags. A method that does not support
// a problem has a row with the reason, and failed. Returns false, with *error
// set, if a flag's value is not allowed or if a file cannot be written.
bool CompareEstimations(const std::vector<EstimationInput>& inputs,
                        const std::vector<Method>& methods,
                        RunCounts* counts,
                        std::string* error);

}  // namespace invgrad

#endif  // BIN_ESTIMATE_ESTIMATION_COMPARISON_H_
