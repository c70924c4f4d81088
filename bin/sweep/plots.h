// The pictures of a sweep, each of the best alternative of every rule.
//
//   DIR/lines.png     the value against the first numeric axis, or if there is
//                     none the first other one; a line a rule, the band from
//                     the lowest to the highest seed; a panel for each point of
//                     the other axes
//   DIR/heat_map.png  the value over the first two numeric axes, a panel a rule
//                     and point of the other axes, in the same colours
//   DIR/curves.png    the value against seconds of training, of the median
//                     seed; a panel for each point of the grid
//
// A numeric axis is one, other than `seed` and `rule`, with two numbers or more
// and nothing else. Numbers over more than a decade have a logarithmic scale;
// numbers that no scale can separate, such as 0, 1e-6 and 1, are equidistant.
// The panels of lines.png have the same axes, with ticks at the grid's values;
// those of curves.png the same range of values. Of more than 16 panels the
// first 16 are drawn, with a warning.
#ifndef BIN_SWEEP_PLOTS_H_
#define BIN_SWEEP_PLOTS_H_

#include <vector>

#include "bin/sweep/results.h"
#include "report/plot.h"

namespace invgrad {

// No panels if the grid has too few axes.
std::vector<Plot> SweepLines(const SweepResults& results);
std::vector<Plot> SweepHeatMaps(const SweepResults& results);
std::vector<Plot> SweepCurves(const SweepResults& results);

}  // namespace invgrad

#endif  // BIN_SWEEP_PLOTS_H_
