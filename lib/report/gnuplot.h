// The parts of a script for gnuplot, and a function that runs a script.
#ifndef REPORT_GNUPLOT_H_
#define REPORT_GNUPLOT_H_

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "report/plot.h"

namespace invgrad {

// Quotes any text as a string for a gnuplot script.
std::string QuoteForGnuplot(std::string_view text);

// Runs the file `script` in `folder`. Returns an error message, or an empty
// string. gnuplot is killed after `max_seconds`, and when an Interrupt gets a
// signal.
std::string RunGnuplot(const std::string& folder,
                       const std::string& script,
                       double max_seconds);

struct Axis {
  bool is_log = false;
  double low = 0.0;
  double high = 1.0;
};

bool CanDraw(double value, bool is_log);

// The range of the values plus `margin`, a share of its length, on each side;
// the given ends of `range` take precedence.
Axis FitAxis(bool is_log,
             const AxisRange& range,
             double margin,
             const std::vector<double>& values);

// The commands for the axis `name` (x, y, cb). Without `ticks`, round numbers.
using Ticks = std::vector<std::pair<double, std::string>>;
std::string AxisCommands(const std::string& name,
                         const Axis& axis,
                         Ticks ticks = {});

// Appends lines "x y [low high]" as the data block `name`, an empty line for a
// gap. Returns the number of points.
int AppendSeries(const std::string& name,
                 const Series& series,
                 const Axis& x_axis,
                 const Axis& y_axis,
                 std::string* script);

// Appends the contour lines. Returns false if there are none.
bool AppendContours(const std::string& name,
                    const ContourField& field,
                    std::string* script);

// Appends a line "column row value" for each cell that has a colour. Returns
// false if there are none.
bool AppendCells(const std::string& name,
                 const HeatMap& map,
                 std::string* script);

}  // namespace invgrad

#endif  // REPORT_GNUPLOT_H_
