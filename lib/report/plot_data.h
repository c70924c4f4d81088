// The data of a plot as data blocks of a gnuplot script.
#ifndef REPORT_PLOT_DATA_H_
#define REPORT_PLOT_DATA_H_

#include <string>

#include "report/plot.h"
#include "report/plot_axis.h"

namespace invgrad {

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

// Appends a line "column row value" for each cell that has a colour.
void AppendCells(const std::string& name,
                 const HeatMap& map,
                 std::string* script);

}  // namespace invgrad

#endif  // REPORT_PLOT_DATA_H_
