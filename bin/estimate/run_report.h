// The report of a run of estimate: METHOD.json for programs, and with
// --covariance METHOD.report.txt for people.
#ifndef BIN_ESTIMATE_RUN_REPORT_H_
#define BIN_ESTIMATE_RUN_REPORT_H_

#include <optional>
#include <string>

#include "ceres/problem.h"
#include "invgrad/covariance.h"
#include "invgrad/minimize.h"
#include "invgrad/rank_report.h"
#include "problems/estimation/estimation.h"

namespace invgrad {

struct RunReport {
  std::string start;  // "Misra1a-start1-seed3"
  std::string method;
  std::string status;
  MinimizerSummary minimizer;
  // At the result, if they were asked for.
  std::optional<RankReport> rank;
  std::optional<Covariance> covariance;

  std::string ToJson() const;
  std::string ToText() const;
};

// Sets rank and covariance.
bool AddCovariance(const Estimation& estimation,
                   const ceres::Problem& problem,
                   RunReport* report,
                   std::string* error);

}  // namespace invgrad

#endif  // BIN_ESTIMATE_RUN_REPORT_H_
