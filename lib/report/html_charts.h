// The parts of a report (html_report.h) that show plots: the curves as data for
// its script, and heat maps as tables.
#ifndef REPORT_HTML_CHARTS_H_
#define REPORT_HTML_CHARTS_H_

#include <string>

#include "report/html_report.h"

namespace invgrad {

// An array with an object for each chart that has views. It has no "<", so that
// it cannot end the element that it stands in.
std::string ChartsJson(const HtmlReport& report);

std::string MapsHtml(const HtmlReport::Maps& maps);

}  // namespace invgrad

#endif  // REPORT_HTML_CHARTS_H_
