// Pictures of curves, trajectories, contours and heat maps as PNG, drawn by
// gnuplot.
//
// Beside NAME.png lies NAME.gp, the script with all its data: edit it and run
// `gnuplot NAME.gp` in its folder to restyle the picture.
//
// Values that are not finite, and values <= 0 on a logarithmic axis, are gaps
// in their line: leave out rows whose value was not computed. Curves of more
// than 6000 points are thinned; what is left covers the same pixels, peaks
// included.
//
// Cost:    some 0.2 s a picture.
// Fails:   returns false if gnuplot is missing (*error names the apt package),
//          fails, or a file cannot be written. A missing picture is no reason
//          to end a run: report it and go on. CHECKs that sizes agree.
#ifndef REPORT_PLOT_H_
#define REPORT_PLOT_H_

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"

namespace invgrad {

struct Series {
  enum class Style { kLines, kPoints, kLinesAndPoints };

  std::string title;  // empty: not in the legend
  std::vector<double> x;
  std::vector<double> y;  // as many as x
  Style style = Style::kLines;
  // Lower and upper ends of a band drawn behind the line, such as the spread
  // over seeds: both empty or as many as x.
  std::vector<double> y_low;
  std::vector<double> y_high;
  // Series with the same number share colour and line type, also across panels;
  // -1 takes the position in Plot::series. There are 30 of them.
  int color = -1;
};

// A scalar field on a grid, drawn as contour lines under the series.
struct ContourField {
  std::vector<double> x;  // ascending
  std::vector<double> y;  // ascending
  Eigen::MatrixXd z;      // y.size() x x.size(): z(i, j) is at (x[j], y[i])
  // Empty: quantiles of z, so that the lines are spread evenly over the picture
  // whatever the scale of z.
  std::vector<double> levels;
};

// An end that is not given is fitted to the data.
struct AxisRange {
  std::optional<double> low;
  std::optional<double> high;
};

// A scalar field in colours, with a colour bar: one cell a value, under the
// contours and the series. The edges of the cells lie midway between
// neighbours, as the axis shows them: a grid need not be uniform. Values that
// are not finite, and values <= 0 on a logarithmic scale, are blank.
struct HeatMap {
  std::vector<double> x;  // ascending; positive if the plot's axis is log
  std::vector<double> y;  // the same
  Eigen::MatrixXd z;      // y.size() x x.size(): z(i, j) is at (x[j], y[i])
  // Cells of one size, numbered from 0 and labelled with their x and y: for a
  // grid of settings such as 1, 3, 10. The axes then count cells; they cannot
  // be logarithmic (CHECKed).
  bool equal_cells = false;
  bool log_z = false;
  std::string z_label;  // of the colour bar
  // Panels with the same range share their colours. Values beyond it get the
  // colour of its end.
  AxisRange z_range;
};

struct Plot {
  enum class Legend {
    kAuto,  // a corner where it hides nothing; outside for over 6 entries
    kTopRight,
    kTopLeft,
    kBottomRight,
    kBottomLeft,
    kOutside,
    kNone
  };

  std::string title;
  std::string x_label;
  std::string y_label;
  bool log_x = false;
  bool log_y = false;
  // Places on the x axis that are labelled, where round numbers would not do:
  // what was tried, or names in place of numbers. Empty: round numbers.
  std::vector<std::pair<double, std::string>> x_ticks;
  AxisRange x_range;
  AxisRange y_range;
  bool equal_aspect = false;  // a circle looks like one
  Legend legend = Legend::kAuto;
  std::optional<HeatMap> heat_map;
  std::optional<ContourField> contours;
  std::vector<Series> series;
};

// Writes path_png, which must end in ".png", and the script beside it.
bool WritePlot(const std::string& path_png,
               const Plot& plot,
               std::string* error);

// The same with several panels, row by row: up to three stand side by side,
// more of them make a picture that is about square, or four panels wide.
bool WritePlots(const std::string& path_png,
                const std::vector<Plot>& plots,
                std::string* error);

}  // namespace invgrad

#endif  // REPORT_PLOT_H_
