// What runs of estimate report: a row a run, a summary a method.
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
  std::string start;   // "Misra1a-start1-seed3": runs from there compare
  std::string method;  // its label
  double initial_cost = std::numeric_limits<double>::quiet_NaN();
  double final_cost = std::numeric_limits<double>::quiet_NaN();
  int num_iterations = 0;
  int num_accepted = 0;  // steps
  int num_rejected = 0;
  double seconds = 0.0;
  // Of every parameter, if there are certified values.
  std::optional<Eigen::VectorXd> digits;
  std::string status;
  bool was_run = true;
};

Table EstimationTable(const std::vector<EstimationRow>& rows);

// Over all starts of a method: how many were solved (as NIST's digits say), to
// how many digits those agree with the certified values, the mean of the
// starts' worst and mean parameters; how often the method's cost is the least
// of all methods, to kSameCost of it; and sums.
constexpr double kSameCost = 1e-6;
Table EstimationSummary(const std::vector<EstimationRow>& rows);

// With all digits.
std::string EstimationCsv(const std::vector<EstimationRow>& rows);

}  // namespace invgrad

#endif  // BIN_ESTIMATE_ESTIMATION_TABLE_H_
