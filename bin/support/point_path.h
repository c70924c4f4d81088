// The path of a method through a point problem.
//
//   PREFIX-METHOD.csv   iteration, L, x, y
//
// With more than kMaxPrintedSize unknowns: iteration, L, |x|, |x - x*| and
// seconds, then calls if the simulator does not form its Jacobian: the values
// and products that the method has computed until then
// (chain/counted_simulator.h); the calls of a known inverse are not counted.
// |x - x*| is nan if x* is not known.
#ifndef BIN_SUPPORT_POINT_PATH_H_
#define BIN_SUPPORT_POINT_PATH_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/compare/problem.h"
#include "invgrad/method.h"
#include "invgrad/minimize/method_minimization.h"

namespace invgrad {

// With more unknowns, tables and CSV files contain only norms.
constexpr int kMaxPrintedSize = 16;

struct PointPath {
  std::string label;
  std::vector<Eigen::VectorXd> x;  // x_0, x_1, ...
  std::vector<Eigen::VectorXd> y;  // P(x_k); empty where P fails
  std::vector<double> loss;        // L at x_k; NaN where it is not finite
  std::vector<double> distance;    // |x_k - x*|; NaN if x* is not known
  std::vector<double> seconds;     // since the start; NaN where not recorded
  std::vector<double> calls;       // of a simulator of fields; empty: another
  MinimizerSummary summary;
  std::string status;

  bool has_failed() const {
    return x.empty() || summary.termination_type == ceres::FAILURE ||
           summary.termination_type == ceres::USER_FAILURE;
  }
};

// Returns false, with *error, if the paths of so many steps do not fit in the
// memory.
bool PathsFitInMemory(const PointProblem& problem,
                      double num_steps,
                      size_t num_methods,
                      std::string* error);

// Runs one method until an Interrupt has a signal, without function and
// parameter tolerance. Returns false if the method does not support the problem.
bool TracePath(const PointProblem& problem,
               const Method& method,
               MinimizerOptions options,
               PointPath* path,
               std::string* error);

// Sets what follows from x and the summary.
void SetDistancesAndTimes(const PointProblem& problem, PointPath* path);

// Writes the columns above to PREFIX + METHOD.csv.
bool WritePathCsv(const std::string& prefix,
                  const PointPath& path,
                  std::string* error);

}  // namespace invgrad

#endif  // BIN_SUPPORT_POINT_PATH_H_
