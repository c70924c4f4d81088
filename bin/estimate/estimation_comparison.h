// Methods side by side on problems of estimation, from the same starts.
//
//   DIR/table.txt, table.md, results.csv    a row a run
//   DIR/summary.txt, summary.md             a row a method
//   DIR/START/METHOD.dat (.txt, .g2o)       the result, in the input's format
//   DIR/START/METHOD.csv                    iteration, cost, seconds, accepted
//   DIR/START/result.png                    the start and every result
//   DIR/START/cost.png                      cost against iterations and seconds
//
// START is the name of the input, with -startK if it has several starts and
// -seedS if they are perturbed.
#ifndef BIN_ESTIMATE_ESTIMATION_COMPARISON_H_
#define BIN_ESTIMATE_ESTIMATION_COMPARISON_H_

#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "invgrad/methods/method.h"
#include "problems/estimation/estimation.h"
#include "problems/estimation/robust_loss.h"

namespace invgrad {

struct EstimationInput {
  std::string name;  // unlike all others'
  std::unique_ptr<Estimation> estimation;
};

struct EstimationComparisonOptions {
  std::string output;
  std::vector<int> starts;  // from 0; those that an input has
  double perturbation = 0.0;
  std::vector<int> seeds;            // of the perturbations
  int max_num_iterations = 0;        // 0: what is usual for the input
  double max_time_in_seconds = 0.0;  // a run; 0: no limit
  double function_tolerance = -1.0;  // < 0: what is usual for the input
  MakeLossFunction make_loss;
  int num_threads = 1;
};

// A method that does not support a problem has a row with the reason. Returns
// false, with *error set, if a file cannot be written, or if no method could
// run.
bool CompareEstimations(const std::vector<EstimationInput>& inputs,
                        const std::vector<Method>& methods,
                        const EstimationComparisonOptions& options,
                        std::ostream& out,
                        std::string* error);

}  // namespace invgrad

#endif  // BIN_ESTIMATE_ESTIMATION_COMPARISON_H_
