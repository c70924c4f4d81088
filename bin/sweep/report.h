// The report of a sweep (report/html_report.h): curves at every point of the
// grid, the value along its axes, maps and profiles, of the best alternative of
// every rule.
#ifndef BIN_SWEEP_REPORT_H_
#define BIN_SWEEP_REPORT_H_

#include <string>
#include <vector>

#include "bin/sweep/results.h"
#include "report/html_report.h"
#include "report/plot.h"

namespace invgrad {

// `budget`: of a run, "6 s of training". `lines`, `maps`: SweepLines and
// SweepHeatMaps (plots.h).
HtmlReport SweepReport(const SweepResults& results,
                       const std::vector<Plot>& lines,
                       const std::vector<Plot>& maps,
                       const std::string& budget,
                       bool is_over);

}  // namespace invgrad

#endif  // BIN_SWEEP_REPORT_H_
