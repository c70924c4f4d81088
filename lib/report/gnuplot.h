// Runs gnuplot on a script.
#ifndef REPORT_GNUPLOT_H_
#define REPORT_GNUPLOT_H_

#include <string>
#include <string_view>

namespace invgrad {

// The text as a string in a gnuplot script, whatever it contains.
std::string QuoteForGnuplot(std::string_view text);

// Runs `script`, a file in `folder`, there. Returns what went wrong, or
// nothing.
std::string RunGnuplot(const std::string& folder, const std::string& script);

}  // namespace invgrad

#endif  // REPORT_GNUPLOT_H_
