// All methods on a point problem: where each one goes and how far it gets.
//
//   DIR/path-METHOD.csv   iteration, L, x, y
//   DIR/table.txt, DIR/table.md
//   DIR/loss.png          L against iterations
//
// With more than kMaxPrintedSize unknowns the points are not printed:
//
//   DIR/path-METHOD.csv   iteration, L, |x|, |x - x*|, seconds
//   DIR/x-METHOD.npy      the final x
//   DIR/x-true.npy        x*, if it is known
//   DIR/fields.png        x* and every final x as a picture, if x is a field
//
// |x - x*| is nan if x* is not known. Norms are Euclidean; "mean |x - x*|" in
// the table is the mean over entries.
#ifndef BIN_SUPPORT_POINT_COMPARISON_H_
#define BIN_SUPPORT_POINT_COMPARISON_H_

#include <limits>
#include <ostream>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/minimize/method_minimization.h"
#include "problems/problem.h"

namespace invgrad {

constexpr int kMaxPrintedSize = 16;

struct PointComparisonOptions {
  std::string output;
  bool plots = true;
  int max_num_iterations = 100;
  double max_time_in_seconds = std::numeric_limits<double>::infinity();
  // Ends a run early when it has converged; 0: every run takes all iterations.
  double gradient_tolerance = 1e-12;
};

// One method's way from the start.
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

// Runs one method. False if it cannot take the problem.
bool TracePath(const PointProblem& problem,
               const Method& method,
               const PointComparisonOptions& options,
               PointPath* path,
               std::string* error);

bool WritePathCsv(const std::string& file,
                  const PointPath& path,
                  std::string* error);

// A method that cannot take the problem gets a row that says so.
bool ComparePoint(const PointProblem& problem,
                  const std::vector<Method>& methods,
                  const PointComparisonOptions& options,
                  std::ostream& out,
                  std::string* error);

}  // namespace invgrad

#endif  // BIN_SUPPORT_POINT_COMPARISON_H_
