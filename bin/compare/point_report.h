// The report of a point comparison (report/html_report.h): the loss, and the
// distance to x* if it is known, against steps, seconds and calls of the
// simulator.
#ifndef BIN_COMPARE_POINT_REPORT_H_
#define BIN_COMPARE_POINT_REPORT_H_

#include <vector>

#include "bin/support/point_path.h"
#include "invgrad/compare/problem.h"
#include "invgrad/method.h"
#include "report/html_report.h"
#include "report/table.h"

namespace invgrad {

// `paths`: of the first methods, all if is_over.
HtmlReport PointReport(const PointProblem& problem,
                       const std::vector<Method>& methods,
                       const std::vector<PointPath>& paths,
                       const Table& table,
                       bool is_over);

}  // namespace invgrad

#endif  // BIN_COMPARE_POINT_REPORT_H_
