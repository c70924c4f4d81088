// The path of one method through a point problem.
#ifndef BIN_COMPARE_POINT_PATH_H_
#define BIN_COMPARE_POINT_PATH_H_

#include <limits>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/methods/method.h"
#include "invgrad/minimize/method_minimization.h"
#include "problems/problem.h"

namespace invgrad {

// With more unknowns, tables and CSV files contain only norms.
constexpr int kMaxPrintedSize = 16;

struct PointPathOptions {
  int max_num_iterations = 100;
  double max_time_in_seconds = std::numeric_limits<double>::infinity();
  // Ends a run that has converged; 0: every run takes all iterations.
  double gradient_tolerance = 1e-12;
};

struct PointPath {
  std::string label;
  std::vector<Eigen::VectorXd> x;  // x_0, x_1, ...
  std::vector<Eigen::VectorXd> y;  // P(x_k); empty where P fails
  std::vector<double> loss;        // L at x_k; NaN where it is not finite
  std::vector<double> distance;    // |x_k - x*|; NaN if x* is not known
  std::vector<double> seconds;     // since the start; NaN where not recorded
  MinimizerSummary summary;
  std::string status;
};

// Runs one method. Returns false if the method does not support the problem.
bool TracePath(const PointProblem& problem,
               const Method& method,
               const PointPathOptions& options,
               PointPath* path,
               std::string* error);

// Iteration, L, x, y; with more than kMaxPrintedSize unknowns: iteration, L,
// |x|, |x - x*|, seconds.
bool WritePathCsv(const std::string& file,
                  const PointPath& path,
                  std::string* error);

}  // namespace invgrad

#endif  // BIN_COMPARE_POINT_PATH_H_
