#include "report/plot.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numeric>
#include <string_view>
#include <system_error>
#include <utility>

#include "glog/logging.h"
#include "invgrad/io/atomic_file.h"

namespace invgrad {
namespace {

// Sizes in pixels. One panel alone makes a picture of 1200 x 800.
constexpr int kHeight = 800;
constexpr int kWidth = 1200;
constexpr int kHeightOfRow = 700;   // one row of panels
constexpr int kWidthOfPanel = 640;  // of the area inside the axes
constexpr int kHeightOfRows = 540;  // each of several
constexpr int kWidthInRows = 480;
constexpr int kMinWidthOfPanel = 400;
constexpr int kMaxColumns = 4;
constexpr int kMinWidthAlone = 800;
constexpr int kLeft = 115;
constexpr int kRight = 35;
constexpr int kTop = 55;
constexpr int kBottom = 75;
constexpr int kLegendSample = 75;
constexpr int kLegendCharacter = 9;
constexpr int kLegendRow = 23;
constexpr int kColorBarGap = 14;
constexpr int kColorBar = 18;
constexpr int kColorBarText = 90;

constexpr int kMaxPoints = 6000;
constexpr int kMaxLegendInside = 6;

// Told apart on white by most colour-blind readers too, as neighbours differ in
// lightness; after all of them the dashes change.
constexpr const char* kColors[] = {"#1f77b4",
                                   "#e67e00",
                                   "#2a9d3a",
                                   "#d62728",
                                   "#7b4fb5",
                                   "#17b3c4",
                                   "#e05fb0",
                                   "#8c564b",
                                   "#a3a010",
                                   "#4d4d4d"};
constexpr const char* kDashes[] = {"solid", "(9,4)", "(2,3)"};
constexpr int kNumColors = std::size(kColors);
constexpr int kNumDashes = std::size(kDashes);
constexpr int kPointTypes[] = {7, 5, 9, 11, 13};  // filled
// Viridis: equal steps look equally far apart, to colour-blind readers and in
// grey too.
constexpr char kPalette[] =
    "set palette defined (0 '#440154', 1 '#472d7b', 2 '#3b528b', "
    "3 '#2c728e', 4 '#21918c', 5 '#28ae80', 6 '#5ec962', 7 '#addc30', "
    "8 '#fde725')\n";

// A string that gnuplot takes as it stands. What means something to gnuplot in
// double quotes is written as an octal number; single quotes would not do, as
// gnuplot 5.4 misreads a string that begins with a quote.
std::string Quote(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (code < 0x20 || code == 0x7f) {
      quoted += ' ';
    } else if (std::string_view("\"'`\\@$").find(c) != std::string_view::npos) {
      quoted += '\\';
      for (const int shift : {6, 3, 0}) {
        quoted += static_cast<char>('0' + ((code >> shift) & 7));
      }
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

// No locale, unlike printf.
std::string Number(double value) {
  char buffer[32];
  const auto result = std::to_chars(
      buffer, buffer + sizeof(buffer), value, std::chars_format::general, 10);
  return std::string(buffer, result.ptr);
}

// gnuplot takes what exceeds 8.99e307 for undefined; there is room for margins.
constexpr double kLargest = 1e306;
constexpr double kSmallest = 1e-306;  // on a logarithmic axis

// One axis: which values can be drawn, and where.
struct Axis {
  bool is_log = false;
  double low = 0.0;
  double high = 1.0;

  bool CanDraw(double value) const {
    return std::abs(value) <= kLargest && (!is_log || value >= kSmallest);
  }
  double ToDisplay(double value) const {
    return is_log ? std::log10(value) : value;
  }
  double FromDisplay(double value) const {
    return is_log ? std::pow(10.0, value) : value;
  }
  double Length() const { return ToDisplay(high) - ToDisplay(low); }
};

Axis FitAxis(bool is_log,
             const AxisRange& range,
             double margin,  // in parts of the length, on each side
             const std::vector<const std::vector<double>*>& data) {
  Axis axis;
  axis.is_log = is_log;
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const std::vector<double>* values : data) {
    for (const double value : *values) {
      if (axis.CanDraw(value)) {
        low = std::min(low, axis.ToDisplay(value));
        high = std::max(high, axis.ToDisplay(value));
      }
    }
  }
  if (low > high) {  // nothing to draw
    low = is_log ? -1.0 : 0.0;
    high = is_log ? 0.0 : 1.0;
  }
  double pad = margin * (high - low);
  // What has no extent gets half a decade, a tenth of its value, or one.
  if (high - low <= 1e-12 * std::max(std::abs(low), std::abs(high))) {
    constexpr double kTiny = 1e-100;
    pad = is_log ? 0.5 : std::abs(high) > kTiny ? 0.1 * std::abs(high) : 1.0;
  }
  const double lowest = is_log ? kSmallest : -kLargest;
  axis.low = std::clamp(axis.FromDisplay(low - pad), lowest, kLargest);
  axis.high = std::clamp(axis.FromDisplay(high + pad), lowest, kLargest);
  if (range.low && axis.CanDraw(*range.low)) {
    axis.low = *range.low;
  }
  if (range.high && axis.CanDraw(*range.high)) {
    axis.high = *range.high;
  }
  return axis;
}

// The ticks that gnuplot would set on a logarithmic axis are whole powers of
// ten: too few when the axis has less than two of them.
std::string TicksCommand(const std::string& name, const Axis& axis) {
  if (!axis.is_log) {
    return "set format " + name + " '%h'\nset " + name + "tics auto\nset m" +
           name + "tics default\n";
  }
  const double low = std::min(axis.low, axis.high);
  const double high = std::max(axis.low, axis.high);
  if (std::log10(high / low) >= 2.0) {
    return "set format " + name + " '10^{%T}'\nset " + name +
           "tics auto\nset m" + name + "tics default\n";
  }
  // Multiples of a round step, or 1, 2 and 5 times powers of ten.
  std::vector<double> ticks;
  if (high / low < 5.0) {
    const double rough = (high - low) / 5.0;
    const double power = std::pow(10.0, std::floor(std::log10(rough)));
    double step = power;
    for (const double factor : {2.0, 5.0, 10.0}) {
      step = step < rough ? factor * power : step;
    }
    for (double i = std::ceil(low / step); i * step <= high; ++i) {
      ticks.push_back(i * step);
    }
  } else {
    const int first = static_cast<int>(std::floor(std::log10(low)));
    for (int exponent = first; exponent <= first + 3; ++exponent) {
      for (const double factor : {1.0, 2.0, 5.0}) {
        ticks.push_back(factor * std::pow(10.0, exponent));
      }
    }
  }
  std::string list;
  for (const double tick : ticks) {
    if (tick >= low && tick <= high) {
      list += (list.empty() ? "" : ", ") + Number(tick);
    }
  }
  return "set format " + name + " '%h'\nset " + name + "tics (" + list +
         ")\nset m" + name + "tics default\n";
}

bool IsAscending(const std::vector<double>& x) {
  double last = -std::numeric_limits<double>::infinity();
  for (const double value : x) {
    if (value < last) {
      return false;
    }
    last = std::isnan(value) ? last : value;
  }
  return true;
}

// The positions to draw: all of a short series; of a long one, from each column
// of pixels (of a path that turns back: from each run of points) the first, the
// last and the extreme ones, and one gap if there are gaps.
std::vector<size_t> PointsToDraw(const Series& series,
                                 const Axis& x_axis,
                                 const Axis& y_axis) {
  const size_t size = series.x.size();
  std::vector<size_t> chosen;
  if (size <= kMaxPoints) {
    for (size_t i = 0; i < size; ++i) {
      chosen.push_back(i);
    }
    return chosen;
  }
  const auto is_drawn = [&](size_t i) {
    return x_axis.CanDraw(series.x[i]) && y_axis.CanDraw(series.y[i]);
  };
  const bool is_curve = IsAscending(series.x);
  const double begin = x_axis.ToDisplay(x_axis.low);
  // The first, the last, a gap and the extremes; of a curve the extremes in x
  // are its first and last.
  const int num_buckets = kMaxPoints / (is_curve ? 5 : 7);
  const auto bucket_of = [&](size_t i) -> long {
    if (!is_curve) {
      return static_cast<long>(i * num_buckets / size);
    }
    const double part =
        (x_axis.ToDisplay(series.x[i]) - begin) / x_axis.Length();
    return std::lround(std::clamp(part, -0.01, 1.01) * num_buckets);
  };

  std::vector<size_t> bucket;
  size_t gap = size;
  const auto flush = [&]() {
    if (!bucket.empty()) {
      const auto by = [&bucket](const std::vector<double>& values) {
        return std::minmax_element(
            bucket.begin(), bucket.end(), [&values](size_t a, size_t b) {
              return values[a] < values[b];
            });
      };
      const auto [x_min, x_max] = by(series.x);
      const auto [y_min, y_max] = by(series.y);
      for (const size_t i :
           {bucket.front(), bucket.back(), *x_min, *x_max, *y_min, *y_max}) {
        chosen.push_back(i);
      }
    }
    if (gap < size) {
      chosen.push_back(gap);
    }
    bucket.clear();
    gap = size;
  };
  long current = std::numeric_limits<long>::min();
  for (size_t i = 0; i < size; ++i) {
    if (!is_drawn(i)) {
      gap = i;
      continue;
    }
    const long next = bucket_of(i);
    if (next != current) {
      flush();
      current = next;
    }
    bucket.push_back(i);
  }
  flush();
  std::sort(chosen.begin(), chosen.end());
  chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
  return chosen;
}

// x y [low high], an empty line for a gap. False if there is nothing to draw.
bool AppendData(const std::string& name,
                const Series& series,
                const Axis& x_axis,
                const Axis& y_axis,
                std::string* script) {
  *script += name + " << EOD\n";
  bool is_gap = true;  // no gap before the first point, and none doubled
  bool has_points = false;
  for (const size_t i : PointsToDraw(series, x_axis, y_axis)) {
    if (!x_axis.CanDraw(series.x[i]) || !y_axis.CanDraw(series.y[i])) {
      *script += is_gap ? "" : "\n";
      is_gap = true;
      continue;
    }
    *script += Number(series.x[i]) + ' ' + Number(series.y[i]);
    if (!series.y_low.empty()) {
      for (const double end : {series.y_low[i], series.y_high[i]}) {
        // A band that reaches below a logarithmic axis ends at its edge.
        const double drawn = end <= 0.0 && y_axis.is_log ? y_axis.low : end;
        *script += ' ' + Number(y_axis.CanDraw(drawn) ? drawn : series.y[i]);
      }
    }
    *script += '\n';
    is_gap = false;
    has_points = true;
  }
  *script += "EOD\n";
  return has_points;
}

std::vector<double> Levels(const ContourField& field) {
  if (!field.levels.empty()) {
    return field.levels;
  }
  std::vector<double> sorted;
  for (const double value : field.z.reshaped()) {
    if (std::isfinite(value)) {
      sorted.push_back(value);
    }
  }
  std::sort(sorted.begin(), sorted.end());
  std::vector<double> levels;
  constexpr size_t kNumLevels = 14;
  for (size_t k = 1; k <= kNumLevels && sorted.size() > 1; ++k) {
    // Halfway to the next value: no line touches a point of the grid.
    const size_t i = (sorted.size() - 2) * k / (kNumLevels + 1);
    const double level = 0.5 * (sorted[i] + sorted[i + 1]);
    if (levels.empty() || level > levels.back()) {
      levels.push_back(level);
    }
  }
  return levels;
}

// Leaves the contour lines in the data block `name`. False if there are none.
bool AppendContours(const std::string& name,
                    const ContourField& field,
                    std::string* script) {
  const std::vector<double> levels = Levels(field);
  if (levels.empty() || field.x.size() < 2 || field.y.size() < 2) {
    return false;
  }
  *script += name + "_grid << EOD\n";
  for (size_t i = 0; i < field.y.size(); ++i) {
    for (size_t j = 0; j < field.x.size(); ++j) {
      const double z = field.z(i, j);
      *script += Number(field.x[j]) + ' ' + Number(field.y[i]) + ' ' +
                 (std::isfinite(z) ? Number(z) : "NaN") + '\n';
    }
    *script += '\n';
  }
  *script += "EOD\nset cntrparam linear levels discrete ";
  for (size_t k = 0; k < levels.size(); ++k) {
    *script += (k > 0 ? "," : "") + Number(levels[k]);
  }
  *script += "\nset contour base\nunset surface\nset table " + name +
             "\nsplot " + name + "_grid using 1:2:3\nunset table\n" +
             "unset contour\nset surface\n";
  return true;
}

std::vector<double> CellCenters(const std::vector<double>& values,
                                bool equal_cells) {
  std::vector<double> centers = values;
  if (equal_cells) std::iota(centers.begin(), centers.end(), 0.0);
  return centers;
}

// One more than centers. The outer edges are as far from their centers as the
// next ones.
std::vector<double> CellEdges(const std::vector<double>& centers, bool is_log) {
  std::vector<double> edges;
  if (centers.empty()) return edges;
  Axis axis;
  axis.is_log = is_log;
  std::vector<double> at;
  for (const double center : centers) {
    CHECK(axis.CanDraw(center)) << center << " is the center of a cell";
    at.push_back(axis.ToDisplay(center));
  }
  const size_t last = at.size() - 1;
  edges.push_back(at[0] - (last > 0 ? 0.5 * (at[1] - at[0]) : 0.5));
  for (size_t i = 0; i < last; ++i) {
    CHECK_LT(at[i], at[i + 1]) << "a heat map's x and y must ascend";
    edges.push_back(0.5 * (at[i] + at[i + 1]));
  }
  edges.push_back(at[last] + (at[last] - edges.back()));
  for (double& edge : edges) edge = axis.FromDisplay(edge);
  return edges;
}

// Labels these places; of many, not all.
std::string NamedTicksCommand(
    const std::string& axis,
    const std::vector<std::pair<double, std::string>>& ticks) {
  constexpr size_t kMaxLabels = 16;
  const size_t stride = (ticks.size() + kMaxLabels - 1) / kMaxLabels;
  std::string list;
  for (size_t i = 0; i < ticks.size(); i += stride) {
    list += (i > 0 ? ", " : "") + Quote(ticks[i].second) + ' ' +
            Number(ticks[i].first);
  }
  return "set format " + axis + " '%h'\nset " + axis + "tics (" + list +
         ")\nset m" + axis + "tics default\n";
}

// Labels equal cells with their values.
std::string CellTicksCommand(const std::string& axis,
                             const std::vector<double>& values) {
  std::vector<std::pair<double, std::string>> ticks;
  ticks.reserve(values.size());
  for (size_t i = 0; i < values.size(); ++i) {
    ticks.emplace_back(static_cast<double>(i), Number(values[i]));
  }
  return NamedTicksCommand(axis, ticks);
}

// The cells that have a colour, x y z and their edges. False if there are none.
bool AppendHeatMap(const std::string& name,
                   const Plot& plot,
                   const Axis& z_axis,
                   std::string* script) {
  const HeatMap& map = *plot.heat_map;
  const std::vector<double> xs = CellCenters(map.x, map.equal_cells);
  const std::vector<double> ys = CellCenters(map.y, map.equal_cells);
  const std::vector<double> x_edges = CellEdges(xs, plot.log_x);
  const std::vector<double> y_edges = CellEdges(ys, plot.log_y);
  *script += name + " << EOD\n";
  bool has_cells = false;
  for (size_t i = 0; i < map.y.size(); ++i) {
    for (size_t j = 0; j < map.x.size(); ++j) {
      if (!z_axis.CanDraw(map.z(i, j))) continue;
      for (const double value : {xs[j],
                                 ys[i],
                                 x_edges[j],
                                 x_edges[j + 1],
                                 y_edges[i],
                                 y_edges[i + 1]}) {
        *script += Number(value) + ' ';
      }
      *script += Number(map.z(i, j)) + '\n';
      has_cells = true;
    }
  }
  *script += "EOD\n";
  return has_cells;
}

int NumCharacters(std::string_view text) {  // of UTF-8
  return std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xc0) != 0x80;
  });
}

int NumLegendEntries(const Plot& plot) {
  return std::count_if(
      plot.series.begin(), plot.series.end(), [](const Series& series) {
        return !series.title.empty();
      });
}

int LegendWidth(const Plot& plot) {
  int num_characters = 0;
  for (const Series& series : plot.series) {
    num_characters = std::max(num_characters, NumCharacters(series.title));
  }
  return kLegendSample + kLegendCharacter * num_characters;
}

// What a panel shows, and how large it is.
struct Layout {
  Axis x_axis;
  Axis y_axis;
  int width = 0;  // of the area inside the axes
  int height = 0;
  Axis z_axis;              // of a heat map
  int color_bar_width = 0;  // with its text and the gap to the axes, else 0
  Plot::Legend legend = Plot::Legend::kNone;
  int legend_width = 0;  // of a legend right of the axes, else 0

  int TotalWidth() const {
    return kLeft + width + color_bar_width + kRight + legend_width;
  }
};

// How many panels stand where, and how large they are.
struct Arrangement {
  int num_columns = 1;
  int height = kHeight;  // of a row
  int width = kWidth - kLeft - kRight;
};

Arrangement Arrange(int num_panels) {
  Arrangement arrangement;
  if (num_panels == 1) return arrangement;
  constexpr int kMaxInOneRow = 3;
  if (num_panels <= kMaxInOneRow) {
    arrangement.num_columns = num_panels;
    arrangement.height = kHeightOfRow;
    arrangement.width = kWidthOfPanel;
    return arrangement;
  }
  while (arrangement.num_columns < kMaxColumns &&
         arrangement.num_columns * arrangement.num_columns < num_panels) {
    ++arrangement.num_columns;
  }
  arrangement.height = kHeightOfRows;
  arrangement.width = kWidthInRows;
  return arrangement;
}

// Of the axes, with one unit on both.
double AspectRatio(const Layout& layout) {
  return std::abs(layout.x_axis.Length()) / std::abs(layout.y_axis.Length());
}

// The corner where the legend hides nothing, if there is one.
Plot::Legend FreePlace(const Plot& plot, const Layout& layout) {
  if (NumLegendEntries(plot) > kMaxLegendInside) {
    return Plot::Legend::kOutside;
  }
  double axes_width = layout.width;
  double axes_height = layout.height;
  if (plot.equal_aspect) {
    // gnuplot draws them smaller than the panel.
    const double aspect = AspectRatio(layout);
    axes_width = std::min(axes_width, layout.height * aspect);
    axes_height = std::min(axes_height, layout.width / aspect);
  }
  constexpr int kMargins = 2 * kLegendCharacter;
  const double width = (LegendWidth(plot) + kMargins) / axes_width;
  const double height = kLegendRow * (NumLegendEntries(plot) + 1) / axes_height;
  const auto part = [](const Axis& axis, double value) {
    return (axis.ToDisplay(value) - axis.ToDisplay(axis.low)) / axis.Length();
  };
  bool is_free[2][2] = {{true, true}, {true, true}};  // [right][top]
  for (const Series& series : plot.series) {
    constexpr double kGap = std::numeric_limits<double>::quiet_NaN();
    double last_x = kGap;
    double last_y = kGap;
    for (size_t i = 0; i < series.x.size(); ++i) {
      const bool is_drawn = layout.x_axis.CanDraw(series.x[i]) &&
                            layout.y_axis.CanDraw(series.y[i]);
      const double x = is_drawn ? part(layout.x_axis, series.x[i]) : kGap;
      const double y = is_drawn ? part(layout.y_axis, series.y[i]) : kGap;
      // The point and some of the line to it; with a gap nothing compares less.
      constexpr int kNumBetween = 8;
      for (int k = 0; k < kNumBetween; ++k) {
        const double back = static_cast<double>(k) / kNumBetween;
        const double at_x = k == 0 ? x : x + back * (last_x - x);
        const double at_y = k == 0 ? y : y + back * (last_y - y);
        if (at_x < 0.0 || at_x > 1.0 || at_y < 0.0 || at_y > 1.0) {
          continue;
        }
        for (const bool right : {false, true}) {
          for (const bool top : {false, true}) {
            if ((right ? 1.0 - at_x : at_x) < width &&
                (top ? 1.0 - at_y : at_y) < height) {
              is_free[right][top] = false;
            }
          }
        }
      }
      last_x = x;
      last_y = y;
    }
  }
  if (is_free[1][1]) {
    return Plot::Legend::kTopRight;
  }
  if (is_free[0][0]) {
    return Plot::Legend::kBottomLeft;
  }
  if (is_free[0][1]) {
    return Plot::Legend::kTopLeft;
  }
  return is_free[1][0] ? Plot::Legend::kBottomRight : Plot::Legend::kOutside;
}

Layout MakeLayout(const Plot& plot, const Arrangement& arrangement) {
  const bool is_alone = arrangement.num_columns == 1;
  std::vector<const std::vector<double>*> xs;
  std::vector<const std::vector<double>*> ys;
  bool are_curves = true;
  for (const Series& series : plot.series) {
    CHECK_EQ(series.x.size(), series.y.size()) << series.title;
    CHECK_EQ(series.y_low.size(), series.y_high.size()) << series.title;
    CHECK(series.y_low.empty() || series.y_low.size() == series.x.size())
        << series.title;
    xs.push_back(&series.x);
    ys.insert(ys.end(), {&series.y, &series.y_low, &series.y_high});
    are_curves = are_curves && series.style != Series::Style::kPoints &&
                 IsAscending(series.x);
  }
  // A field says which part of the plane is of interest.
  const bool has_field = plot.contours.has_value() || plot.heat_map.has_value();
  if (plot.contours) {
    CHECK_EQ(plot.contours->z.rows(), plot.contours->y.size());
    CHECK_EQ(plot.contours->z.cols(), plot.contours->x.size());
    xs = {&plot.contours->x};
    ys = {&plot.contours->y};
  }
  Layout layout;
  std::vector<double> x_edges;
  std::vector<double> y_edges;
  if (plot.heat_map) {
    const HeatMap& map = *plot.heat_map;
    CHECK_EQ(map.z.rows(), map.y.size());
    CHECK_EQ(map.z.cols(), map.x.size());
    x_edges = CellEdges(CellCenters(map.x, map.equal_cells), plot.log_x);
    y_edges = CellEdges(CellCenters(map.y, map.equal_cells), plot.log_y);
    xs = {&x_edges};
    ys = {&y_edges};
    const std::vector<double> z(map.z.reshaped().begin(),
                                map.z.reshaped().end());
    layout.z_axis = FitAxis(map.log_z, map.z_range, 0.0, {&z});
    layout.color_bar_width = kColorBarGap + kColorBar + kColorBarText;
  }
  // Curves reach from edge to edge; a path keeps away from the edges.
  constexpr double kMargin = 0.04;
  layout.x_axis = FitAxis(
      plot.log_x, plot.x_range, has_field || are_curves ? 0.0 : kMargin, xs);
  layout.y_axis =
      FitAxis(plot.log_y, plot.y_range, has_field ? 0.0 : kMargin, ys);

  layout.height = arrangement.height - kTop - kBottom;
  layout.width = arrangement.width;
  if (is_alone) layout.width -= layout.color_bar_width;
  if (plot.equal_aspect) {
    const double wanted = layout.height * AspectRatio(layout);
    layout.width = static_cast<int>(
        std::clamp<double>(wanted, kMinWidthOfPanel, layout.width));
  }
  if (NumLegendEntries(plot) > 0) {
    layout.legend = plot.legend == Plot::Legend::kAuto ? FreePlace(plot, layout)
                                                       : plot.legend;
  }
  if (layout.legend == Plot::Legend::kOutside) {
    layout.legend_width = LegendWidth(plot);
    if (is_alone && !plot.equal_aspect) {
      layout.width =
          std::max(layout.width - layout.legend_width, kMinWidthAlone);
    }
  }
  return layout;
}

std::string LegendCommand(const Layout& layout) {
  const std::string style = " Left reverse noenhanced samplen 2.5 spacing 1.15";
  const std::string inside = style + " opaque width 1\n";
  switch (layout.legend) {
    case Plot::Legend::kAuto:
    case Plot::Legend::kTopRight:
      return "set key inside top right" + inside;
    case Plot::Legend::kTopLeft:
      return "set key inside top left" + inside;
    case Plot::Legend::kBottomRight:
      return "set key inside bottom right" + inside;
    case Plot::Legend::kBottomLeft:
      return "set key inside bottom left" + inside;
    case Plot::Legend::kOutside:
      // Behind the colour bar, if there is one.
      return "set key at graph " +
             Number(1.01 + static_cast<double>(layout.color_bar_width) /
                               layout.width) +
             ", graph 1.0 left top noopaque" + style + '\n';
    case Plot::Legend::kNone:
      break;
  }
  return "unset key\n";
}

std::string Color(int look) {
  return std::string(" lc rgb '") + kColors[look % kNumColors] + "'";
}

std::string BandElement(const std::string& data, int look) {
  return data +
         " using 1:3:4 with filledcurves fs transparent solid 0.18 noborder" +
         Color(look) + " notitle";
}

std::string SeriesElement(const std::string& data,
                          const Series& series,
                          int look) {
  const std::string line =
      std::string(" lw 1.6 dt ") + kDashes[look / kNumColors % kNumDashes];
  const std::string point =
      " pt " + std::to_string(kPointTypes[look % std::size(kPointTypes)]) +
      " ps 0.9";
  std::string element = data;
  switch (series.style) {
    case Series::Style::kLines:
      element += " with lines" + line;
      break;
    case Series::Style::kPoints:
      element += " with points" + point;
      break;
    case Series::Style::kLinesAndPoints:
      element += " with linespoints" + line + point;
      break;
  }
  return element + Color(look) +
         (series.title.empty() ? std::string(" notitle")
                               : " title " + Quote(series.title));
}

// What `plot` draws, separated by commas.
class PlotCommand {
 public:
  void Add(const std::string& element) {
    text_ += text_.empty() ? "plot " : ", \\\n     ";
    text_ += element;
  }
  std::string Text() const { return text_ + '\n'; }

 private:
  std::string text_;
};

struct Panel {
  double left = 0.0;  // the axes, in parts of the picture
  double right = 1.0;
  double bottom = 0.0;
  double top = 1.0;
  double pixel = 0.0;  // the width of one
};

std::string ColorBarCommand(const Plot& plot,
                            const Layout& layout,
                            const Panel& panel) {
  if (!plot.heat_map) return "";
  const Axis& z_axis = layout.z_axis;
  return kPalette + std::string(z_axis.is_log ? "set" : "unset") +
         " logscale cb\n" + "set cbrange [" + Number(z_axis.low) + ":" +
         Number(z_axis.high) + "]\n" + TicksCommand("cb", z_axis) +
         "set cblabel " + Quote(plot.heat_map->z_label) + " noenhanced\n" +
         "set colorbox user origin screen " +
         Number(panel.right + kColorBarGap * panel.pixel) + ", screen " +
         Number(panel.bottom) + " size screen " +
         Number(kColorBar * panel.pixel) + ", screen " +
         Number(panel.top - panel.bottom) + "\n";
}

struct PanelScript {
  std::string data;      // data blocks and tables, outside of multiplot
  std::string commands;  // settings and plot
};

PanelScript MakePanel(const Plot& plot,
                      int index,
                      const Layout& layout,
                      const Panel& panel) {
  const Axis& x_axis = layout.x_axis;
  const Axis& y_axis = layout.y_axis;
  PanelScript script;
  PlotCommand command;
  const std::string prefix = "$panel" + std::to_string(index);
  const bool has_cells =
      plot.heat_map &&
      AppendHeatMap(prefix + "_cells", plot, layout.z_axis, &script.data);
  if (has_cells) {
    // Without a border of its colour a cell is parted from the next by a line.
    command.Add(prefix +
                "_cells using 1:2:3:4:5:6:7 with boxxyerror lc palette "
                "fs solid 1.0 border notitle");
  }
  const bool has_contours =
      plot.contours &&
      AppendContours(prefix + "_contours", *plot.contours, &script.data);
  if (has_contours) {
    command.Add(prefix +
                "_contours using 1:2 with lines lw 1 lc rgb '#b4bcc8' notitle");
  }
  std::vector<std::string> elements;
  for (size_t i = 0; i < plot.series.size(); ++i) {
    const Series& series = plot.series[i];
    const std::string name = prefix + "_series" + std::to_string(i);
    const bool has_points =
        AppendData(name, series, x_axis, y_axis, &script.data);
    const int look = series.color < 0 ? static_cast<int>(i) : series.color;
    if (has_points && !series.y_low.empty()) {
      command.Add(BandElement(name, look));
    }
    // A series without a point keeps its place in the legend.
    elements.push_back(
        SeriesElement(has_points ? name + " using 1:2" : "NaN", series, look));
  }
  for (const std::string& element : elements) {  // in front of all bands
    command.Add(element);
  }
  if (elements.empty() && !has_contours && !has_cells) {
    command.Add("NaN notitle");  // the axes alone
  }

  std::string& out = script.commands;
  out += "\nset title " + Quote(plot.title) + " noenhanced font ',15'\n";
  out += "set xlabel " + Quote(plot.x_label) + " noenhanced\n";
  out += "set ylabel " + Quote(plot.y_label) + " noenhanced\n";
  out += plot.log_x ? "set logscale x\n" : "unset logscale x\n";
  out += plot.log_y ? "set logscale y\n" : "unset logscale y\n";
  out +=
      "set xrange [" + Number(x_axis.low) + ":" + Number(x_axis.high) + "]\n";
  out +=
      "set yrange [" + Number(y_axis.low) + ":" + Number(y_axis.high) + "]\n";
  if (plot.heat_map && plot.heat_map->equal_cells) {
    out += CellTicksCommand("x", plot.heat_map->x) +
           CellTicksCommand("y", plot.heat_map->y);
  } else {
    out += plot.x_ticks.empty() ? TicksCommand("x", x_axis)
                                : NamedTicksCommand("x", plot.x_ticks);
    out += TicksCommand("y", y_axis);
  }
  out += ColorBarCommand(plot, layout, panel);
  out += plot.equal_aspect ? "set size ratio -1\n" : "set size noratio\n";
  out += "set lmargin at screen " + Number(panel.left) +
         "\nset rmargin at screen " + Number(panel.right) +
         "\nset bmargin at screen " + Number(panel.bottom) +
         "\nset tmargin at screen " + Number(panel.top) + "\n";
  out += LegendCommand(layout);
  out += command.Text();
  return script;
}

std::string MakeScript(const std::string& name_png,
                       const std::string& name_gp,
                       const std::vector<Plot>& plots) {
  const Arrangement arrangement = Arrange(static_cast<int>(plots.size()));
  const int num_columns = arrangement.num_columns;
  std::vector<Layout> layouts;
  std::vector<int> lefts(num_columns + 1, 0);  // of the columns
  for (const Plot& plot : plots) {
    const int column = static_cast<int>(layouts.size()) % num_columns;
    layouts.push_back(MakeLayout(plot, arrangement));
    // First the width of the widest panel; the sums come below.
    lefts[column + 1] =
        std::max(lefts[column + 1], layouts.back().TotalWidth());
  }
  std::partial_sum(lefts.begin(), lefts.end(), lefts.begin());
  const int width = lefts.back();
  const int num_rows =
      (static_cast<int>(plots.size()) + num_columns - 1) / num_columns;
  const int height = num_rows * arrangement.height;
  std::string data;
  std::string commands;
  for (size_t i = 0; i < plots.size(); ++i) {
    const int left = lefts[i % num_columns] + kLeft;
    const int top = static_cast<int>(i) / num_columns * arrangement.height;
    Panel panel;
    panel.left = static_cast<double>(left) / width;
    panel.right = static_cast<double>(left + layouts[i].width) / width;
    panel.top = 1.0 - static_cast<double>(top + kTop) / height;
    panel.bottom =
        1.0 - static_cast<double>(top + arrangement.height - kBottom) / height;
    panel.pixel = 1.0 / width;
    const PanelScript script = MakePanel(plots[i], i, layouts[i], panel);
    data += script.data;
    commands += script.commands;
  }

  const std::string size =
      " size " + std::to_string(width) + "," + std::to_string(height);
  std::string script = "# To restyle the picture, edit and run: gnuplot " +
                       Quote(name_gp) + "\n";
  // The plain png terminal is for a gnuplot that was built without cairo.
  script +=
      "set encoding utf8\n"
      "if (strstrt(GPVAL_TERMINALS, 'pngcairo') > 0) {\n"
      "  set terminal pngcairo" +
      size +
      " enhanced font 'DejaVu Sans,12' background '#ffffff'\n"
      "} else {\n"
      "  set terminal png truecolor enhanced" +
      size +
      "\n}\n"
      "set border lw 1 lc rgb '#404040'\n"
      "set grid xtics ytics lt 1 lw 1 lc rgb '#e2e2e2'\n"
      "set tics nomirror\n";
  script += data;
  // Set after the tables, which would end up in it.
  script += "set output " + Quote(name_png) + "\n";
  script += plots.size() == 1
                ? commands
                : "set multiplot\n" + commands + "\nunset multiplot\n";
  script += "unset output\n";
  return script;
}

// Runs gnuplot in `folder`, without a shell. Returns what went wrong, or
// nothing.
std::string RunGnuplot(const std::string& folder, const std::string& name_gp) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) {
    return std::generic_category().message(errno);
  }
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  posix_spawn_file_actions_addopen(
      &actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  std::string program = "gnuplot";
  std::string settings = "--default-settings";  // not the user's ~/.gnuplot
  std::string script = "./" + name_gp;
  char* const arguments[] = {
      program.data(), settings.data(), script.data(), nullptr};
  pid_t child = 0;
  const int spawn_error = posix_spawnp(
      &child, program.c_str(), &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  if (spawn_error != 0) {
    close(ends[0]);
    return spawn_error == ENOENT
               ? "gnuplot is not installed (apt install gnuplot-nox)"
               : "cannot run gnuplot: " +
                     std::generic_category().message(spawn_error);
  }

  std::string output;
  char buffer[4096];
  ssize_t count = 0;
  while ((count = read(ends[0], buffer, sizeof(buffer))) > 0 ||
         (count < 0 && errno == EINTR)) {
    output.append(buffer, std::max<ssize_t>(count, 0));
  }
  close(ends[0]);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFSIGNALED(status)) {
    return "gnuplot was ended by signal " + std::to_string(WTERMSIG(status));
  }
  if (WEXITSTATUS(status) != 0) {
    return "gnuplot failed: " + output;
  }
  return "";
}

}  // namespace

bool WritePlot(const std::string& path_png,
               const Plot& plot,
               std::string* error) {
  return WritePlots(path_png, {plot}, error);
}

bool WritePlots(const std::string& path_png,
                const std::vector<Plot>& plots,
                std::string* error) {
  CHECK(!plots.empty());
  CHECK(error != nullptr);
  const std::filesystem::path path(path_png);
  CHECK_EQ(path.extension(), ".png") << path_png;
  const std::string folder =
      path.has_parent_path() ? path.parent_path().string() : ".";
  const std::string name_gp = path.stem().string() + ".gp";
  const std::string path_gp = folder + "/" + name_gp;
  if (!WriteFile(path_gp,
                 MakeScript(path.filename().string(), name_gp, plots),
                 error)) {
    return false;
  }
  // An older picture must not pass for this one.
  std::error_code status;
  std::filesystem::remove(path, status);
  std::string problem = RunGnuplot(folder, name_gp);
  if (problem.empty() && !std::filesystem::exists(path, status)) {
    problem = "gnuplot wrote nothing (is the folder writable?)";
  }
  if (!problem.empty()) {
    *error = "no picture " + path_png + ": " + problem + "; its script is " +
             path_gp;
    return false;
  }
  return true;
}

}  // namespace invgrad
