// The chart of a report (html_report.h) with performance and data profiles.
#ifndef REPORT_HTML_PROFILES_H_
#define REPORT_HTML_PROFILES_H_

#include <string>
#include <vector>

#include "report/html_report.h"
#include "report/profiles.h"

namespace invgrad {

// A measure of work, and by it how each solver (column) went on each problem
// (row).
struct ProfileWork {
  std::string name;  // "seconds"
  std::vector<std::vector<SolveTrace>> traces;
};

// Views for each measure and for several tolerances. `places`: what problems are
// called, "starts". No views with fewer than two problems that count.
HtmlReport::Chart ProfileChart(const std::string& places,
                               const std::vector<ProfileWork>& works);

}  // namespace invgrad

#endif  // REPORT_HTML_PROFILES_H_
