// The tables of a comparison of estimations.
#ifndef BIN_ESTIMATE_ESTIMATION_TABLE_H_
#define BIN_ESTIMATE_ESTIMATION_TABLE_H_

#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "report/table.h"

namespace invgrad {

// A run.
struct EstimationRow {
  std::string input;   // "Misra1a"
  std::string start;   // "Misra1a-start1-seed3": runs from one start compare
  std::string method;  // its label
  double initial_cost = std::numeric_limits<double>::quiet_NaN();
  double final_cost = std::numeric_limits<double>::quiet_NaN();
  // Of the constant that fits the input's data best, if that is known.
  double constant_cost = std::numeric_limits<double>::quiet_NaN();
  int num_iterations = 0;
  int num_accepted = 0;  // steps
  int num_rejected = 0;
  int num_outside_domain = 0;  // candidates
  double seconds = 0.0;
  double gradient_norm = std::numeric_limits<double>::quiet_NaN();  // Euclidean
  long num_evaluations = -1;       // of all residuals; -1: not counted
  std::vector<double> seconds_to;  // each level; NaN: never
  std::optional<bool> is_solved;   // unknown: none
  // Correct digits of every parameter, if there are certified values.
  std::optional<Eigen::VectorXd> digits;
  // Of its covariance, and the correct digits of every standard deviation.
  std::optional<int> rank;
  int num_parameters = 0;
  std::optional<Eigen::VectorXd> deviation_digits;
  std::string estimate;  // of a user's own model
  std::string status;
  bool has_failed = true;
};

// Whether the run is a solution, as far as that is known.
bool IsSolved(const EstimationRow& row);

// The scale of an input's costs is the least initial cost of its runs or the
// cost of a constant, if that is less.

// For each method, from how many starts it reached the least cost of all
// methods, up to 1e-6 of it and 1e-16 of the scale, in the order of the methods'
// first runs. A run whose cost is not finite reaches none.
std::vector<std::pair<std::string, int>> LeastCostCounts(
    const std::vector<EstimationRow>& rows);

// For each input with several starts, the costs at which runs ended, up to 1e-4
// of them and 1e-12 of the scale, and how many runs of each method ended there:
// its local minima, if the runs converged. The ten lowest; of several inputs
// those with more than one.
Table LocalMinimaTable(const std::vector<EstimationRow>& rows);

// One row per run, for people; or with all digits, for CSV. `levels`: those of
// seconds_to.
Table EstimationTable(const std::vector<EstimationRow>& rows,
                      const std::vector<double>& levels,
                      bool is_exact);

// For each method, over all starts: the number of solved starts, if that is
// known; the digits of the worst and of the mean parameter, averaged over the
// solved starts; the number of starts with the least cost of all methods; and
// sums.
Table EstimationSummary(const std::vector<EstimationRow>& rows);

}  // namespace invgrad

#endif  // BIN_ESTIMATE_ESTIMATION_TABLE_H_
