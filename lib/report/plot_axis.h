// The axes of a plot: valid values, ranges and ticks.
#ifndef REPORT_PLOT_AXIS_H_
#define REPORT_PLOT_AXIS_H_

#include <string>
#include <utility>
#include <vector>

#include "report/plot.h"

namespace invgrad {

struct Axis {
  bool is_log = false;
  double low = 0.0;
  double high = 1.0;
};

using PlotTicks = std::vector<std::pair<double, std::string>>;

bool CanDraw(double value, bool is_log);

// The range of the data plus `margin`, a share of its length, on each side; the
// given ends of `range` take precedence.
Axis FitAxis(bool is_log,
             const AxisRange& range,
             double margin,
             const std::vector<const std::vector<double>*>& data);

// The commands for the axis `name` (x, y, cb). Without `ticks`, round numbers.
std::string AxisCommands(const std::string& name,
                         const Axis& axis,
                         PlotTicks ticks = {});

}  // namespace invgrad

#endif  // REPORT_PLOT_AXIS_H_
