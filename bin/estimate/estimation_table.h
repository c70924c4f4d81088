// The tables of `estimate`: one row per run, and one summary per method.
#ifndef BIN_ESTIMATE_ESTIMATION_TABLE_H_
#define BIN_ESTIMATE_ESTIMATION_TABLE_H_

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "report/table.h"

namespace invgrad {

struct EstimationRow {
  std::string start;   // "Misra1a-start1-seed3": runs from one start compare
  std::string method;  // its label
  double initial_cost = std::numeric_limits<double>::quiet_NaN();
  double final_cost = std::numeric_limits<double>::quiet_NaN();
  int num_iterations = 0;
  int num_accepted = 0;  // steps
  int num_rejected = 0;
  double seconds = 0.0;
  // Correct digits of every parameter, if there are certified values.
  std::optional<Eigen::VectorXd> digits;
  std::string status;
  bool was_run = true;
};

// For people; or with all digits, for CSV.
Table EstimationTable(const std::vector<EstimationRow>& rows, bool is_exact);

// For each method, over all starts: the number of solved starts (by NIST's
// digits); the digits of the worst and of the mean parameter, averaged over the
// solved starts; the number of starts with the least cost of all methods, to
// kSameCost; and sums.
constexpr double kSameCost = 1e-6;
Table EstimationSummary(const std::vector<EstimationRow>& rows);

}  // namespace invgrad

#endif  // BIN_ESTIMATE_ESTIMATION_TABLE_H_
