// Methods side by side on problems of estimation, from the same starts.
//
//   DIR/table.txt, table.md, results.csv    a row a run
//   DIR/summary.txt, summary.md             a row a method
//   DIR/report.html                         estimation_report.h
//   DIR/START/METHOD.dat (.txt, .g2o)       the result, in the input's format
//   DIR/START/METHOD.csv                    iteration, cost, seconds, accepted
//   DIR/START/METHOD.json                   the run for programs (docs/json.md)
//   DIR/START/METHOD.run                    the run, for --resume
//   DIR/START/result.png                    the start and every result
//   DIR/START/cost.png                      cost against iterations and seconds
//
// With --covariance also
//
//   DIR/START/METHOD.report.txt             standard deviations, correlations,
//                                           what is not determined
//   DIR/START/covariance.png                bands (nist), ellipses (g2o)
//
// START is the name of the input, with -startK if it has several starts, and
// -seedS if they are drawn or perturbed.
//
// On several ranks, each takes the next run of the list in turn, until all are
// done; rank 0 then reads them, as --resume does.
#ifndef BIN_ESTIMATE_ESTIMATION_COMPARISON_H_
#define BIN_ESTIMATE_ESTIMATION_COMPARISON_H_

#include <memory>
#include <string>
#include <vector>

#include "bin/support/program.h"
#include "invgrad/method.h"
#include "problems/estimation/estimation.h"

namespace invgrad {

struct EstimationInput {
  std::string name;  // unlike all others'
  std::unique_ptr<Estimation> estimation;
};

struct EstimationOptions {
  std::string separable = "off";  // on, both: over nonlinear parameters, way.h
  std::string start = "both";     // "1", "2": of a problem with two starts
  MakeLossFunction make_loss = [] { return nullptr; };
  bool covariance = false;
  double perturb = 0.0;              // of the starts; 0: no seeds
  std::vector<int> seeds = {1};      // of the noise
  int max_iterations = 0;            // 0: the problem's own
  double seconds = 0.0;              // 0: no limit
  double function_tolerance = -1.0;  // -1: the problem's own
  int threads = 1;
  std::vector<double> levels;  // costs above the minimum; for seconds to
  bool resume = false;         // what is done is not run again
};

// Runs all methods from the starts of the options. A method that does not
// support a problem has a row with the reason, and failed. Returns false, with
// *error set, if a problem has no such start or if a file cannot be written.
bool CompareEstimations(const EstimationOptions& options,
                        const std::vector<EstimationInput>& inputs,
                        const std::vector<Method>& methods,
                        RunCounts* counts,
                        std::string* error);

}  // namespace invgrad

#endif  // BIN_ESTIMATE_ESTIMATION_COMPARISON_H_
