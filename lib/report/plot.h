// Pictures of curves, paths, contours and heat maps as PNG, drawn by gnuplot.
//
// NAME.gp beside NAME.png is the script with all data: to restyle the picture,
// edit it and run `gnuplot NAME.gp` in its folder.
//
// Values that are not finite, and values <= 0 on a logarithmic axis, give gaps
// in their line. A line of one point is drawn as a point. A logarithmic axis
// over less than a factor of five is drawn linear.
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
  // Series with the same number share colour and line type, also across panels;
  // -1: the position in Plot::series. There are 30 of them.
  int color = -1;
  bool is_muted = false;  // thin and grey, behind the others
};

// A scalar field on a grid, drawn as contour lines under the series. The levels
// are quantiles of z, so that the lines spread evenly over the picture for any
// scale of z.
struct ContourField {
  std::vector<double> x;  // ascending
  std::vector<double> y;  // ascending
  Eigen::MatrixXd z;      // y.size() x x.size(): z(i, j) is at (x[j], y[i])
};

// Missing ends follow from the data.
struct AxisRange {
  std::optional<double> low;
  std::optional<double> high;
};

// A matrix in colours, with a colour bar: the cell z(i, j) is the unit square
// around x = j, y = i. Values that are not finite, and values <= 0 on a
// logarithmic scale, are blank.
struct HeatMap {
  Eigen::MatrixXd z;
  std::vector<std::string> x_labels;  // of the columns; empty: their numbers
  std::vector<std::string> y_labels;  // of the rows
  bool log_z = false;
  std::string z_label;  // of the colour bar
  AxisRange z_range;    // panels with the same range share their colours
};

// Of several panels with the same series only the last one has a legend.
struct Plot {
  std::string title;
  std::string x_label;
  std::string y_label;
  bool log_x = false;
  bool log_y = false;
  // Labelled places on the x axis; empty: round numbers.
  std::vector<std::pair<double, std::string>> x_ticks;
  AxisRange x_range;
  AxisRange y_range;
  bool equal_aspect = false;        // one unit is as long on both axes
  std::optional<HeatMap> heat_map;  // its panel has linear axes
  std::optional<ContourField> contours;
  std::vector<Series> series;
};

// Keeps at most eight curves legible: the curves with the lowest last values in
// the first panel keep colour and name; the others are muted in all panels and
// share one entry of the legend. Curves with the same title belong together.
void MuteAllButTheLowest(std::vector<Plot>* panels);

// Writes path_png, which must end in ".png", and the script beside it. The panels
// form rows of `num_columns`; 0: up to three stand side by side, more form rows
// of at most four. The place of a panel with nothing in it stays empty. gnuplot
// is ended after `max_seconds`, and by an Interrupt (interrupt.h).
bool WritePlots(const std::string& path_png,
                const std::vector<Plot>& panels,
                std::string* error,
                double max_seconds = 60.0,
                int num_columns = 0);

}  // namespace invgrad

#endif  // REPORT_PLOT_H_
