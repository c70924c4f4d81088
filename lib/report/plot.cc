#include "report/plot.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <limits>
#include <numeric>
#include <set>

#include "fmt/ranges.h"
#include "glog/logging.h"
#include "invgrad/io/atomic_file.h"
#include "report/gnuplot.h"

namespace invgrad {
namespace {

constexpr size_t kMaxLegible = 8;

// Successive colours differ in lightness, so that most colour-blind readers can
// distinguish them on white; after the last colour the dash pattern changes.
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
constexpr int kPointTypes[] = {7, 5, 9, 11, 13};  // filled

// Viridis: perceptually uniform, also in grey.
constexpr char kPalette[] =
    "set palette defined (0 '#440154', 1 '#472d7b', 2 '#3b528b', "
    "3 '#2c728e', 4 '#21918c', 5 '#28ae80', 6 '#5ec962', 7 '#addc30', "
    "8 '#fde725')\n";

std::string SeriesStyle(const Series& series, int look, int num_points) {
  const bool has_points =
      series.style != Series::Style::kLines || num_points == 1;
  const bool has_lines = series.style != Series::Style::kPoints;
  std::string style = fmt::format(" with {}",
                                  !has_points ? "lines"
                                  : has_lines ? "linespoints"
                                              : "points");
  if (has_lines) {
    style +=
        fmt::format(" lw {} dt {}",
                    series.is_muted ? 0.7 : 1.6,
                    kDashes[look / std::size(kColors) % std::size(kDashes)]);
  }
  if (has_points) {
    style += fmt::format(" pt {} ps 0.9",
                         kPointTypes[look % std::size(kPointTypes)]);
  }
  return style + fmt::format(" lc rgb '{}'",
                             series.is_muted
                                 ? "#c4c4c4"
                                 : kColors[look % std::size(kColors)]);
}

std::vector<std::string> Legend(const Plot& plot) {
  std::vector<std::string> titles;
  for (const Series& series : plot.series) {
    if (!series.title.empty()) titles.push_back(series.title);
  }
  return titles;
}

// In pixels.
int LegendWidth(const Plot& plot) {
  int width = 0;
  for (const std::string& title : Legend(plot)) {
    width = std::max(width, 75 + 9 * static_cast<int>(title.size()));
  }
  return width;
}

void CheckSizes(const Plot& plot) {
  for (const Series& series : plot.series) {
    CHECK_EQ(series.x.size(), series.y.size()) << series.title;
    CHECK_EQ(series.y_low.size(), series.y_high.size()) << series.title;
    CHECK(series.y_low.empty() || series.y_low.size() == series.x.size())
        << series.title;
  }
  if (plot.contours) {
    CHECK_EQ(plot.contours->z.rows(), plot.contours->y.size());
    CHECK_EQ(plot.contours->z.cols(), plot.contours->x.size());
  }
  if (plot.heat_map) CHECK(!plot.log_x && !plot.log_y) << plot.title;
}

Ticks NumberedTicks(const std::vector<std::string>& labels) {
  Ticks ticks;
  for (const std::string& label : labels) {
    ticks.emplace_back(static_cast<double>(ticks.size()), label);
  }
  return ticks;
}

// The ranges of x and y: without margin for curves, with a margin for paths,
// the grid for a field.
std::pair<Axis, Axis> FitAxes(const Plot& plot) {
  std::vector<double> xs, ys;
  constexpr double kMargin = 0.04;
  double x_margin = 0.0, y_margin = 0.0;
  if (plot.heat_map) {
    xs = {-0.5, static_cast<double>(plot.heat_map->z.cols()) - 0.5};
    ys = {-0.5, static_cast<double>(plot.heat_map->z.rows()) - 0.5};
  } else if (plot.contours) {
    xs = plot.contours->x;
    ys = plot.contours->y;
  } else {
    y_margin = kMargin;
    for (const Series& series : plot.series) {
      xs.insert(xs.end(), series.x.begin(), series.x.end());
      for (const auto* values : {&series.y, &series.y_low, &series.y_high}) {
        ys.insert(ys.end(), values->begin(), values->end());
      }
      if (series.style == Series::Style::kPoints ||
          !std::is_sorted(series.x.begin(), series.x.end())) {
        x_margin = kMargin;
      }
    }
  }
  return {FitAxis(plot.log_x, plot.x_range, x_margin, xs),
          FitAxis(plot.log_y, plot.y_range, y_margin, ys)};
}

bool IsEmpty(const Plot& plot) {
  return plot.title.empty() && plot.series.empty() && !plot.heat_map &&
         !plot.contours;
}

// Appends data blocks and tables to *data, settings and `plot` to *commands:
// multiplot allows no tables. `legend_left`: in widths of the axes.
void AppendPanel(const Plot& plot,
                 const std::string& prefix,
                 std::optional<double> legend_left,
                 std::string* data,
                 std::string* commands) {
  CheckSizes(plot);
  if (IsEmpty(plot)) {
    *commands += "set multiplot next\n";
    return;
  }
  const auto [x_axis, y_axis] = FitAxes(plot);
  *commands += fmt::format(
      "\nset title {} noenhanced font ',15'\n"
      "set xlabel {} noenhanced\nset ylabel {} noenhanced\nset size {}\n",
      QuoteForGnuplot(plot.title),
      QuoteForGnuplot(plot.x_label),
      QuoteForGnuplot(plot.y_label),
      plot.equal_aspect ? "ratio -1" : "noratio");
  std::vector<std::string> elements;
  if (plot.heat_map) {
    const HeatMap& map = *plot.heat_map;
    const std::vector<double> z(map.z.data(), map.z.data() + map.z.size());
    *commands += kPalette +
                 AxisCommands("cb", FitAxis(map.log_z, map.z_range, 0.0, z)) +
                 fmt::format("set cblabel {} noenhanced\n",
                             QuoteForGnuplot(map.z_label)) +
                 AxisCommands("x", x_axis, NumberedTicks(map.x_labels)) +
                 AxisCommands("y", y_axis, NumberedTicks(map.y_labels));
    if (AppendCells(prefix + "_cells", map, data)) {
      // The border closes the gaps between neighbours of one colour.
      elements.push_back(
          prefix +
          "_cells using 1:2:($1-.5):($1+.5):($2-.5):($2+.5):3 with boxxyerror "
          "lc palette fs solid 1.0 border notitle");
    }
  } else {
    *commands +=
        AxisCommands("x", x_axis, plot.x_ticks) + AxisCommands("y", y_axis);
  }
  if (plot.contours &&
      AppendContours(prefix + "_contours", *plot.contours, data)) {
    elements.push_back(
        prefix +
        "_contours using 1:2 with lines lw 1 lc rgb '#b4bcc8' notitle");
  }
  std::vector<std::string> bands, muted, lines;
  for (size_t i = 0; i < plot.series.size(); ++i) {
    const Series& series = plot.series[i];
    const std::string name = fmt::format("{}_series{}", prefix, i);
    const int num_points = AppendSeries(name, series, x_axis, y_axis, data);
    const int look = series.color < 0 ? static_cast<int>(i) : series.color;
    if (num_points > 0 && !series.y_low.empty()) {
      bands.push_back(fmt::format(
          "{} using 1:3:4 with filledcurves fs transparent solid 0.18 noborder "
          "lc rgb '{}' notitle",
          name,
          kColors[look % std::size(kColors)]));
    }
    // A series without points is still in the legend.
    (series.is_muted && num_points > 0 ? muted : lines)
        .push_back((num_points > 0 ? name + " using 1:2" : "NaN") +
                   SeriesStyle(series, look, num_points) +
                   (series.title.empty()
                        ? " notitle"
                        : " title " + QuoteForGnuplot(series.title)));
  }
  for (const auto* group : {&muted, &bands, &lines}) {
    elements.insert(elements.end(), group->begin(), group->end());
  }
  if (elements.empty()) elements.emplace_back("NaN notitle");  // the axes alone
  *commands += legend_left.has_value()
                   ? fmt::format(
                         "set key at graph {:.10g}, graph 1 left top Left "
                         "reverse noenhanced samplen 2.5 spacing 1.15\n",
                         *legend_left)
                   : "unset key\n";
  *commands += fmt::format("plot {}\n", fmt::join(elements, ", \\\n     "));
}

// In pixels. Each panel has room for what stands beside it; the last legend is
// beside the last column.
std::string MakeScript(const std::string& name_png,
                       const std::string& name_gp,
                       const std::vector<Plot>& plots,
                       int num_columns) {
  const auto num_panels = static_cast<int>(plots.size());
  if (num_columns == 0) {
    num_columns =
        num_panels <= 3
            ? num_panels
            : std::min(4, static_cast<int>(std::ceil(std::sqrt(num_panels))));
  }
  const int num_rows = (num_panels + num_columns - 1) / num_columns;
  constexpr int kLeft = 115, kRight = 35, kTop = 55, kBottom = 75;
  int panel_width = num_rows > 1 ? 480 : num_panels > 1 ? 640 : 1050;
  const int panel_height = (num_rows > 1     ? 540
                            : num_panels > 1 ? 700
                                             : 800) -
                           kTop - kBottom;
  int color_bar = 0, legend = 0;
  std::vector<bool> has_legend;
  for (int i = 0; i < num_panels; ++i) {
    if (plots[i].heat_map) color_bar = 122;  // with its gap and numbers
    has_legend.push_back(i + 1 == num_panels ||
                         Legend(plots[i + 1]) != Legend(plots[i]));
    if (i + 1 < num_panels && has_legend[i]) {
      legend = std::max(legend, LegendWidth(plots[i]));
    }
  }
  const int last_legend = std::max(LegendWidth(plots.back()) - legend, 0);
  if (num_panels == 1) {
    panel_width = std::max(panel_width - last_legend - color_bar, 700);
  }
  const int gap = kLeft + kRight + color_bar + legend;
  const int width = num_columns * (panel_width + gap) + last_legend;
  const int height = num_rows * (panel_height + kTop + kBottom);
  std::string data;
  std::string commands;
  for (int i = 0; i < num_panels; ++i) {
    std::optional<double> legend_left;
    if (has_legend[i] && LegendWidth(plots[i]) > 0) {
      legend_left = 1.01 + static_cast<double>(color_bar) / panel_width;
    }
    AppendPanel(
        plots[i], fmt::format("$panel{}", i), legend_left, &data, &commands);
  }
  // The output is set after the tables, which gnuplot would otherwise write to
  // it.
  const double w = width, h = height;
  return fmt::format(
      "# To restyle the picture, edit and run: gnuplot {}\n"
      "set encoding utf8\n"
      "set terminal pngcairo size {},{} enhanced font 'DejaVu Sans,12' "
      "background '#ffffff'\n"
      "set border lw 1 lc rgb '#404040'\n"
      "set grid xtics ytics lt 1 lw 1 lc rgb '#e2e2e2'\n"
      "set tics nomirror\n"
      "{}set output {}\n"
      "set multiplot layout {},{} margins {:.10g},{:.10g},{:.10g},{:.10g} "
      "spacing {:.10g},{:.10g}\n{}\nunset multiplot\nunset output\n",
      QuoteForGnuplot(name_gp),
      width,
      height,
      data,
      QuoteForGnuplot(name_png),
      num_rows,
      num_columns,
      kLeft / w,
      1.0 - (gap - kLeft + last_legend) / w,
      kBottom / h,
      1.0 - kTop / h,
      gap / w,
      (kTop + kBottom) / h,
      commands);
}

}  // namespace

void MuteAllButTheLowest(std::vector<Plot>* panels) {
  CHECK(!panels->empty());
  std::vector<std::pair<double, std::string>> ranked;
  for (const Series& series : panels->front().series) {
    double last = std::numeric_limits<double>::infinity();
    for (const double y : series.y) last = std::isfinite(y) ? y : last;
    ranked.emplace_back(last, series.title);
  }
  if (ranked.size() <= kMaxLegible) return;
  std::stable_sort(
      ranked.begin(), ranked.end(), [](const auto& a, const auto& b) {
        return a.first < b.first;
      });
  std::set<std::string> kept;
  for (size_t i = 0; i < kMaxLegible; ++i) kept.insert(ranked[i].second);
  for (Plot& panel : *panels) {
    int color = 0;
    for (Series& series : panel.series) {
      series.is_muted = kept.count(series.title) == 0;
      if (series.is_muted) {
        series.title.clear();
      } else {
        series.color = color++;
      }
    }
    Series others;
    others.title = fmt::format("{} others", ranked.size() - kMaxLegible);
    others.is_muted = true;
    panel.series.push_back(others);
  }
}

bool WritePlots(const std::string& path_png,
                const std::vector<Plot>& panels,
                std::string* error,
                double max_seconds,
                int num_columns) {
  CHECK(!panels.empty());
  CHECK_GE(num_columns, 0);
  CHECK(error != nullptr);
  const std::filesystem::path path(path_png);
  CHECK_EQ(path.extension(), ".png") << path_png;
  const std::string folder =
      path.has_parent_path() ? path.parent_path().string() : ".";
  const std::string name_gp = path.stem().string() + ".gp";
  const std::string path_gp = folder + "/" + name_gp;
  const std::string name_png = path.filename().string();
  if (!WriteFile(
          path_gp, MakeScript(name_png, name_gp, panels, num_columns), error)) {
    return false;
  }
  std::error_code ignored;
  std::filesystem::remove(path, ignored);  // so that an old picture is not
                                           // mistaken for a new one
  std::string problem = RunGnuplot(folder, name_gp, max_seconds);
  if (problem.empty() && !std::filesystem::exists(path, ignored)) {
    problem = "gnuplot wrote nothing (is the folder writable?)";
  }
  if (problem.empty()) return true;
  *error = fmt::format(
      "no picture {}: {}; its script is {}", path_png, problem, path_gp);
  return false;
}

}  // namespace invgrad
