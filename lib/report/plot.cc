#include "report/plot.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "fmt/core.h"
#include "fmt/ranges.h"
#include "glog/logging.h"
#include "invgrad/io/atomic_file.h"
#include "report/gnuplot.h"
#include "report/plot_script.h"

namespace invgrad {
namespace {

// gnuplot treats values above 8.99e307 as undefined; this limit leaves space
// for margins.
bool CanDraw(double value, bool is_log) {
  return std::abs(value) <= 1e306 && (!is_log || value >= 1e-306);
}

std::string Number(double value, bool is_log) {
  return CanDraw(value, is_log) ? fmt::format("{:.10g}", value) : "NaN";
}

std::string TicksText(const Ticks& ticks) {
  if (ticks.empty()) return "auto";
  // Shows only some of many labels.
  constexpr size_t kMaxLabels = 16;
  const size_t stride = (ticks.size() + kMaxLabels - 1) / kMaxLabels;
  std::string text;
  for (size_t i = 0; i < ticks.size(); i += stride) {
    text += fmt::format("{}{} {:.10g}",
                        text.empty() ? "(" : ", ",
                        QuoteForGnuplot(ticks[i].second),
                        ticks[i].first);
  }
  return text + ") noenhanced";
}

// An axis of a panel: x, y or cb.
struct Axis {
  const char* name;
  std::string label;
  bool is_log;
  AxisRange range;
  Ticks ticks;
  bool is_tight = false;  // ends with the data, not at the next tick
  std::string octaves;    // ticks at powers of two, of a short logarithmic axis

  // `values`: what is drawn along it.
  Axis(const char* axis_name,
       const std::string& text,
       bool may_be_log,
       AxisRange given,
       const std::vector<double>& values,
       const Ticks& labels = {})
      : name(axis_name), label(text), ticks(labels) {
    // gnuplot refuses an empty range that is given, and widens one of its own.
    if (given.low && given.high && !(*given.low < *given.high)) given = {};
    range = given;
    const bool has_values =
        std::any_of(values.begin(), values.end(), [&](double value) {
          return CanDraw(value, may_be_log);
        });
    if (!has_values) {  // which gnuplot would refuse
      range.low = range.low.value_or(0.0);
      range.high = range.high.value_or(*range.low + 1.0);
    }
    const AxisRange all = RangeOf(values, may_be_log);
    const double low = given.low.value_or(*all.low);
    const double ratio = given.high.value_or(*all.high) / low;
    is_log = may_be_log && low > 0.0 && ratio >= 5.0;
    if (is_log && ratio < 100.0 && ticks.empty()) {
      octaves =
          fmt::format("{:.10g}, 2", std::exp2(std::floor(std::log2(low))));
    }
  }

  std::string Commands() const {
    const auto end = [](const std::optional<double>& value) {
      return value.has_value() ? fmt::format("{:.10g}", *value) : "*";
    };
    return fmt::format(
        "set {0}label {1} noenhanced\n{2} logscale {0}\n"
        "set {0}range [{3}:{4}]{7}\nset format {0} '{5}'\nset {0}tics {6}\n",
        name,
        QuoteForGnuplot(label),
        is_log ? "set" : "unset",
        end(range.low),
        end(range.high),
        is_log && ticks.empty() && octaves.empty() ? "10^{%T}" : "%h",
        octaves.empty() ? TicksText(ticks) : octaves,
        is_tight ? " noextend" : "");
  }
};

std::string CsvCell(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? '\'' : c == '\n' ? ' ' : c;
  return quoted + "\"";
}

// The styles of lines in the script.
constexpr int kLines = 1;
constexpr int kPoints = 2;
constexpr int kLinesAndPoints = 3;

// Data and script of a picture, panel by panel.
struct Drawing {
  std::string csv = "panel,line,title,x,y,low,high,z\n";
  std::string panels;
  int num_panels = 0;
  // Of all lines.
  int num_lines = 0;
  std::string titles, colors, styles;
  // Of the panel with most titles.
  std::string key_lines, key_points;
  size_t num_keys = 0;
  size_t key_width = 0;
  bool has_map = false;

  void Add(const Plot& plot, bool is_last) {
    ++num_panels;
    if (plot.title.empty() && plot.series.empty() && !plot.heat_map) {
      panels += "\nset multiplot next\n";
      return;
    }
    std::vector<double> xs, ys;
    for (const Series& series : plot.series) {
      xs.insert(xs.end(), series.x.begin(), series.x.end());
      for (const auto* values : {&series.y, &series.y_low, &series.y_high}) {
        ys.insert(ys.end(), values->begin(), values->end());
      }
    }
    if (plot.heat_map) {
      const HeatMap& map = *plot.heat_map;
      xs = {
          map.x_first - 0.5 * map.x_step,
          map.x_first + (static_cast<double>(map.z.cols()) - 0.5) * map.x_step};
      ys = {
          map.y_first - 0.5 * map.y_step,
          map.y_first + (static_cast<double>(map.z.rows()) - 0.5) * map.y_step};
    }
    Axis x("x", plot.x_label, plot.log_x, plot.x_range, xs, plot.x_ticks);
    Axis y("y", plot.y_label, plot.log_y, plot.y_range, ys, plot.y_ticks);
    x.is_tight = std::all_of(
        plot.series.begin(), plot.series.end(), [](const Series& series) {
          return series.style == Series::Style::kLines;
        });
    if (plot.heat_map) {
      x.range = {plot.x_range.low.value_or(xs[0]),
                 plot.x_range.high.value_or(xs[1])};
      y.range = {plot.y_range.low.value_or(ys[0]),
                 plot.y_range.high.value_or(ys[1])};
    }
    panels += fmt::format("\nset title {} noenhanced font ',15'\nset size {}\n",
                          QuoteForGnuplot(plot.title),
                          plot.equal_aspect ? "ratio -1" : "noratio") +
              x.Commands() + y.Commands();
    if (plot.heat_map) AddMap(*plot.heat_map);
    const int first = num_lines + 1;
    std::string bands, points;
    for (const Series& series : plot.series) {
      const int style =
          AddLine(series, num_lines + 1 - first, x.is_log, y.is_log);
      if (!series.y_low.empty()) bands += fmt::format("{} ", num_lines);
      if (style != kLines) points += fmt::format("{} ", num_lines);
    }
    SetKey(plot, first);
    panels += fmt::format(
        "p = {}; first = {}; last = {}; bands = \"{}\"; points = \"{}\"\n"
        "@start{}@of_lines{}{}\n",
        num_panels,
        first,
        num_lines,
        bands,
        points,
        bands.empty() ? "" : "@of_bands",
        points.empty() ? "" : "@of_points",
        is_last && num_keys > 0 ? "@key" : "");
  }

  void AddMap(const HeatMap& map) {
    has_map = true;
    const std::vector<double> z(map.z.data(), map.z.data() + map.z.size());
    // gnuplot itself finds no range of cells whose centers are at the edges.
    AxisRange range = map.z_range;
    const AxisRange all = RangeOf(z, map.log_z);
    if (*all.low < *all.high) {
      range = {range.low.value_or(*all.low), range.high.value_or(*all.high)};
    }
    const Axis bar("cb", map.z_label, map.log_z, range, z);
    panels += bar.Commands() +
              fmt::format("set palette @{}\nw = {:.10g}; h = {:.10g}\n",
                          map.is_grey ? "greys" : "viridis",
                          0.5 * map.x_step,
                          0.5 * map.y_step);
    for (Eigen::Index i = 0; i < map.z.rows(); ++i) {
      for (Eigen::Index j = 0; j < map.z.cols(); ++j) {
        if (!CanDraw(map.z(i, j), bar.is_log)) continue;
        csv += fmt::format("{},0,,{:.10g},{:.10g},,,{:.10g}\n",
                           num_panels,
                           map.x_first + static_cast<double>(j) * map.x_step,
                           map.y_first + static_cast<double>(i) * map.y_step,
                           map.z(i, j));
      }
    }
  }

  // Returns the style of the line in the script.
  int AddLine(const Series& series, int position, bool log_x, bool log_y) {
    CHECK_EQ(series.x.size(), series.y.size()) << series.title;
    CHECK_EQ(series.y_low.size(), series.y_high.size()) << series.title;
    CHECK(series.y_low.empty() || series.y_low.size() == series.x.size())
        << series.title;
    ++num_lines;
    int num_drawn = 0;  // a line of one point is drawn as a point, too
    for (size_t i = 0; i < series.x.size(); ++i) {
      num_drawn += CanDraw(series.x[i], log_x) && CanDraw(series.y[i], log_y);
    }
    const bool has_points =
        series.style != Series::Style::kLines || num_drawn == 1;
    const int style = series.style == Series::Style::kPoints ? kPoints
                      : has_points                           ? kLinesAndPoints
                                                             : kLines;
    const char* comma = num_lines > 1 ? "," : "";
    titles += comma + QuoteForGnuplot(series.title);
    colors +=
        comma + std::to_string(series.color < 0 ? position : series.color);
    styles += comma + std::to_string(style);
    for (size_t i = 0; i < series.x.size(); ++i) {
      const std::string y = Number(series.y[i], log_y);
      const auto end = [&](const std::vector<double>& ends) {
        if (ends.empty()) return std::string();
        return CanDraw(ends[i], log_y) ? Number(ends[i], log_y) : y;
      };
      csv += fmt::format("{},{},{},{},{},{},{},\n",
                         num_panels,
                         num_lines,
                         CsvCell(series.title),
                         Number(series.x[i], log_x),
                         y,
                         end(series.y_low),
                         end(series.y_high));
    }
    // Two blank lines begin another data set, whose first row gnuplot 6 takes for
    // the names of columns.
    if (!series.x.empty()) csv += "\n";
    return style;
  }

  void SetKey(const Plot& plot, int first) {
    const auto num_titles = static_cast<size_t>(std::count_if(
        plot.series.begin(), plot.series.end(), [](const Series& series) {
          return !series.title.empty();
        }));
    if (num_titles <= num_keys) return;
    num_keys = num_titles;
    key_lines = key_points = "";
    key_width = 0;
    for (size_t i = 0; i < plot.series.size(); ++i) {
      const Series& series = plot.series[i];
      if (series.title.empty()) continue;
      key_width = std::max(key_width, series.title.size());
      (series.style == Series::Style::kPoints ? key_points : key_lines) +=
          std::to_string(first + static_cast<int>(i)) + " ";
    }
  }

  std::string Script(const std::string& name, int num_columns) const {
    std::string script = fmt::format(
        "# To restyle the picture, edit and run: gnuplot {0}\n"
        "png = {1}\ncsv = {2}\npanels = {3}\ncolumns = {4}\nlegend = {5}\n"
        "key_lines = \"{6}\"\nkey_points = \"{7}\"\nmaps = {8}\n",
        QuoteForGnuplot(name + ".gp"),
        QuoteForGnuplot(name + ".png"),
        QuoteForGnuplot(name + ".csv"),
        num_panels,
        num_columns,
        key_width,
        key_lines,
        key_points,
        has_map ? 1 : 0);
    for (const auto& [array, values] : {std::pair("title", titles),
                                        std::pair("color", colors),
                                        std::pair("style", styles)}) {
      script += fmt::format("array {}[{}] = [{}]\n",
                            array,
                            std::max(num_lines, 1),
                            num_lines == 0 ? "0" : values);
    }
    return script + kPlotScript + panels + "\nunset multiplot\nunset output\n";
  }
};

}  // namespace

AxisRange RangeOf(const std::vector<double>& values, bool is_log) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const double value : values) {
    if (!CanDraw(value, is_log)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  if (low > high) low = high = 0.0;  // nothing to draw
  return {low, high};
}

std::vector<std::string> ShortNames(const std::vector<std::string>& labels) {
  // "adam", ":epochs=5", ">newton", each with the number of its phase, and
  // "adam>newton" without the settings.
  std::vector<std::vector<std::pair<int, std::string>>> pieces(labels.size());
  std::vector<std::string> bare(labels.size());
  // Of bare names (phase -1), and with one setting.
  std::map<std::tuple<std::string, int, std::string>, int> counts;
  for (size_t i = 0; i < labels.size(); ++i) {
    const std::string& label = labels[i];
    int phase = 0;
    for (size_t begin = 0, end = 0; begin < label.size(); begin = end) {
      end = std::min(label.find_first_of(":>", begin + 1), label.size());
      if (label[begin] == '>') ++phase;
      pieces[i].emplace_back(phase, label.substr(begin, end - begin));
      if (label[begin] != ':') bare[i] += pieces[i].back().second;
    }
    ++counts[{bare[i], -1, ""}];
    for (const auto& [of_phase, piece] : pieces[i]) {
      if (piece[0] == ':') ++counts[{bare[i], of_phase, piece}];
    }
  }
  std::vector<std::string> names(labels.size());
  for (size_t i = 0; i < labels.size(); ++i) {
    for (const auto& [phase, piece] : pieces[i]) {
      const bool is_shared =
          piece[0] == ':' &&
          counts[{bare[i], phase, piece}] == counts[{bare[i], -1, ""}];
      if (!is_shared) names[i] += piece;
    }
  }
  // "adam:x=1:y=2" and "adam:y=2:x=1"
  std::map<std::string, std::set<std::string>> labels_of;
  for (size_t i = 0; i < labels.size(); ++i) {
    labels_of[names[i]].insert(labels[i]);
  }
  for (size_t i = 0; i < labels.size(); ++i) {
    if (labels_of[names[i]].size() > 1) names[i] = labels[i];
  }
  return names;
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
  const std::string name = path.stem().string();
  const std::string path_gp = folder + "/" + name + ".gp";
  if (num_columns == 0) {
    num_columns = panels.size() <= 3 ? static_cast<int>(panels.size()) : 4;
  }
  Drawing drawing;
  for (const Plot& plot : panels) drawing.Add(plot, &plot == &panels.back());
  if (!WriteFile(folder + "/" + name + ".csv", drawing.csv, error) ||
      !WriteFile(path_gp, drawing.Script(name, num_columns), error)) {
    return false;
  }
  std::error_code ignored;
  std::filesystem::remove(path, ignored);  // so that an old picture is not
                                           // mistaken for a new one
  std::string problem = RunGnuplot(folder, name + ".gp", max_seconds);
  if (problem.empty() && !std::filesystem::exists(path, ignored)) {
    problem = "gnuplot wrote nothing (is the folder writable?)";
  }
  if (problem.empty()) return true;
  *error = fmt::format(
      "no picture {}: {}; its script is {}", path_png, problem, path_gp);
  return false;
}

}  // namespace invgrad
