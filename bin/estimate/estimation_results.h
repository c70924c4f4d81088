// What is read off a run of a comparison of estimations.
#ifndef BIN_ESTIMATE_ESTIMATION_RESULTS_H_
#define BIN_ESTIMATE_ESTIMATION_RESULTS_H_

#include <string>
#include <vector>

#include "bin/estimate/estimation_table.h"
#include "ceres/problem.h"
#include "invgrad/method.h"
#include "invgrad/minimize.h"
#include "problems/estimation/estimation.h"

namespace invgrad {

// The cost after each iteration: a rejected step keeps it.
std::vector<double> Costs(const MinimizerSummary& summary);

// Sets all of the row but its names and its covariance. The parameters are the
// result. `num_evaluations`: -1 if they are not counted. `levels`: costs above
// the minimum.
void SetResults(const Method& method,
                const MinimizerSummary& summary,
                long num_evaluations,
                const std::vector<double>& levels,
                const Estimation& estimation,
                ceres::Problem* problem,
                EstimationRow* row);

std::string IterationsCsv(const MinimizerSummary& summary);

}  // namespace invgrad

#endif  // BIN_ESTIMATE_ESTIMATION_RESULTS_H_
