// Pictures of curves, paths and heat maps as PNG, drawn by gnuplot.
//
// NAME.csv beside NAME.png has the data, and NAME.gp the script: to restyle the
// picture, edit it and run `gnuplot NAME.gp` in its folder. All scripts end in
// the same drawing part (plot_script.h), behind what is particular to each.
//
// The columns of NAME.csv:
//
//   panel, line   numbers from 1; line 0: cells of the panel's heat map
//   title         of the line
//   x, y          NaN: a gap in the line
//   low, high     the band behind it
//   z             of a cell
//
// Values that are not finite, and values <= 0 on a logarithmic axis, are gaps. A
// logarithmic axis over less than a factor of five is drawn linear.
//
// Cost:    about 0.2 s for a picture.
// Fails:   returns false if gnuplot is missing (*error names the apt package),
//          if it fails or takes too long, or if a file cannot be written.
//          Callers should report a missing picture and continue. CHECKs that
//          sizes agree.
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
  // Lower and upper ends of a band behind the line, such as the spread over
  // seeds: both empty or as many as x.
  std::vector<double> y_low;
  std::vector<double> y_high;
  // Series with the same number look the same, also across panels; -1: the
  // position in Plot::series.
  int color = -1;
};

// Missing ends follow from the data.
struct AxisRange {
  std::optional<double> low;
  std::optional<double> high;
};

// A matrix in colours, with a colour bar, under the series. Values that are not
// finite, and values <= 0 on a logarithmic scale, are blank.
struct HeatMap {
  Eigen::MatrixXd z;
  // z(i, j) is the rectangle around x = x_first + j x_step, y = ...
  double x_first = 0.0;
  double x_step = 1.0;
  double y_first = 0.0;
  double y_step = 1.0;
  bool log_z = false;
  std::string z_label;   // of the colour bar
  AxisRange z_range;     // panels with the same range share their colours
  bool is_grey = false;  // a background for paths, in steps
};

using Ticks = std::vector<std::pair<double, std::string>>;

struct Plot {
  std::string title;
  std::string x_label;
  std::string y_label;
  bool log_x = false;
  bool log_y = false;
  // Labelled places on an axis; empty: round numbers.
  Ticks x_ticks;
  Ticks y_ticks;
  AxisRange x_range;
  AxisRange y_range;
  bool equal_aspect = false;  // one unit is as long on both axes
  std::optional<HeatMap> heat_map;
  std::vector<Series> series;
};

// Names that tell the labels apart: without settings, or without those that all
// labels of the same methods have.
//
//   adam:step_size=1e-3:batch_size=8, adam:step_size=1e-4:batch_size=8, adaptive
//   adam:step_size=1e-3, adam:step_size=1e-4, adaptive
std::vector<std::string> ShortNames(const std::vector<std::string>& labels);

// The range of the values that an axis can show, with a margin on both sides.
AxisRange RangeOf(const std::vector<double>& values, bool is_log);

// Writes path_png, which must end in ".png", and the two files beside it. The
// panels form rows of `num_columns`; 0: up to three stand side by side, more
// form rows of four. All have the same size, and the picture at most 2,000
// pixels of width. The place of a panel with nothing in it stays empty. The
// legend is that of the panel with most titles. gnuplot is ended after
// `max_seconds`, and by an Interrupt (interrupt.h).
bool WritePlots(const std::string& path_png,
                const std::vector<Plot>& panels,
                std::string* error,
                double max_seconds = 60.0,
                int num_columns = 0);

}  // namespace invgrad

#endif  // REPORT_PLOT_H_
