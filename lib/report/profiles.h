// Profiles of solvers on many problems, from how each went.
//
//   f_p     least cost that any solver reached on problem p
//   t_ps    least work after which f <= f_p + tolerance (f(x_0) - f_p): solver s
//           has solved problem p; infinite if it never did
//
//   performance profile [1]   rho_s(r) = share of p with t_ps <= r min_s t_ps
//   data profile [2]          d_s(t)   = share of p with t_ps <= t
//
// Work is seconds or steps: here every step has exact derivatives, so that data
// profiles count steps, not groups of n + 1 values.
//
// Problems whose cost no solver lowered say nothing and count for none.
//
// [1] Dolan, More. Benchmarking optimization software with performance
//     profiles. Mathematical Programming 91 (2002) 201-213.
// [2] More, Wild. Benchmarking derivative-free optimization algorithms. SIAM
//     Journal on Optimization 20 (2009) 172-191.
#ifndef REPORT_PROFILES_H_
#define REPORT_PROFILES_H_

#include <vector>

#include "Eigen/Core"
#include "report/plot.h"

namespace invgrad {

// After work[k] the solver was at cost[k]; work rises, cost[0] is that of the
// start. Empty: it did not run.
struct SolveTrace {
  std::vector<double> work;
  std::vector<double> cost;
};

// A row for each problem that counts, a column for each solver.
// traces[p][s]: as many solvers for every problem (CHECKed).
Eigen::MatrixXd WorkToSolve(const std::vector<std::vector<SolveTrace>>& traces,
                            double tolerance);

// For each solver the points at which the share of problems, y, steps up; its
// number is the color.
std::vector<Series> PerformanceProfile(const Eigen::MatrixXd& work);
std::vector<Series> DataProfile(const Eigen::MatrixXd& work);

}  // namespace invgrad

#endif  // REPORT_PROFILES_H_
