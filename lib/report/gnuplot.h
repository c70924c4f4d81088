// Running gnuplot, and texts in its scripts.
#ifndef REPORT_GNUPLOT_H_
#define REPORT_GNUPLOT_H_

#include <string>
#include <string_view>

namespace invgrad {

// Quotes any text as a string for a gnuplot script.
std::string QuoteForGnuplot(std::string_view text);

// Runs the file `script` in `folder`. Returns an error message, or an empty
// string. gnuplot is killed after `max_seconds`, and when an Interrupt gets a
// signal.
std::string RunGnuplot(const std::string& folder,
                       const std::string& script,
                       double max_seconds);

}  // namespace invgrad

#endif  // REPORT_GNUPLOT_H_
