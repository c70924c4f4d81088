// Runs gnuplot on a script.
#ifndef REPORT_GNUPLOT_H_
#define REPORT_GNUPLOT_H_

#include <string>
#include <string_view>

namespace invgrad {

// Quotes any text as a string for a gnuplot script.
std::string QuoteForGnuplot(std::string_view text);

// Runs the file `script` in `folder`. Returns an error message, or an empty
// string.
std::string RunGnuplot(const std::string& folder, const std::string& script);

}  // namespace invgrad

#endif  // REPORT_GNUPLOT_H_
