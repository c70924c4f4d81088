// DIR/report.html of a run: what all programs put into it, and when they write
// it. A report that cannot be written is a warning, as a picture is: tables and
// files have the results.
#ifndef BIN_SUPPORT_HTML_OUTPUT_H_
#define BIN_SUPPORT_HTML_OUTPUT_H_

#include <chrono>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "bin/support/run_output.h"
#include "invgrad/method.h"
#include "report/html_report.h"

namespace invgrad {

// With the title "PROGRAM: subject", the command, the methods, and the facts
// that all runs have: `facts`, date, machine and versions.
HtmlReport NewReport(
    const std::string& subject,
    const std::string& question,
    const std::vector<std::string>& labels,
    const std::vector<std::pair<std::string, std::string>>& facts);

// The specification of --problem (first), its formula and its source.
std::vector<std::pair<std::string, std::string>> ProblemFacts();

// Whether the steps read gradients alone, without the memory of a quasi-Newton
// method.
bool IsFirstOrder(const Method& method);

// Adds the line of a method, unless it has no points. A diverging line is cut
// off at a hundred times the highest of the values `at_start`.
void AddCurve(size_t method, Series curve, double at_start, Plot* view);

// Writes the report of a run that goes on: at once, then at most every 10
// seconds, and less often where making it takes more than half a second.
class LiveReport {
 public:
  void Update(const std::function<HtmlReport()>& make);

 private:
  std::chrono::steady_clock::time_point due_;
};

// "3 of 45 runs are done; ...", for HtmlReport::progress.
std::string ProgressText(size_t num_done, size_t num_all);

// At the end of a run: writes the report, draws the pictures, and writes the
// report again, with those that have a caption.
void FinishReport(HtmlReport report, const std::vector<Picture>& pictures);

}  // namespace invgrad

#endif  // BIN_SUPPORT_HTML_OUTPUT_H_
