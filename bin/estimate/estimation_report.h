// The report of a comparison of estimations (report/html_report.h): profiles
// over the starts, costs from each start, and the local minima.
#ifndef BIN_ESTIMATE_ESTIMATION_REPORT_H_
#define BIN_ESTIMATE_ESTIMATION_REPORT_H_

#include <string>
#include <vector>

#include "bin/estimate/estimation_comparison.h"
#include "bin/estimate/estimation_table.h"
#include "bin/estimate/way.h"
#include "report/html_report.h"
#include "report/plot.h"

namespace invgrad {

// Of one start: costs against iterations, and against seconds. The color of a
// line is the number of its way.
struct StartCosts {
  std::string start;
  std::vector<Plot> plots;
};

// `rows` and `costs`: of the first starts, all if is_over.
HtmlReport EstimationReport(const EstimationOptions& options,
                            const std::vector<EstimationInput>& inputs,
                            const std::vector<Way>& ways,
                            const std::vector<EstimationRow>& rows,
                            const std::vector<StartCosts>& costs,
                            bool is_over);

}  // namespace invgrad

#endif  // BIN_ESTIMATE_ESTIMATION_REPORT_H_
