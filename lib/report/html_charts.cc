#include "report/html_charts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "fmt/core.h"
#include "invgrad/core/specification.h"
#include "invgrad/internal/logging.h"
#include "invgrad/io/format.h"
#include "nlohmann/json.hpp"

namespace invgrad {
namespace {

// Writes null for what is not finite.
using Json = nlohmann::ordered_json;

// Those at `kept`, four digits.
Json NumbersJson(const std::vector<double>& values,
                 const std::vector<size_t>& kept) {
  Json json = Json::array();
  for (const size_t i : kept) {
    double rounded = std::nan("");
    ParseFinite(fmt::format("{:.4g}", values[i]), &rounded);
    json.push_back(rounded);
  }
  return json;
}

// The points of a curve that are drawn: the first, the last, and of the others
// those that are at least 1/max_points of the axis farther on.
std::vector<size_t> KeptPoints(const std::vector<double>& x,
                               bool log_x,
                               size_t max_points) {
  std::vector<size_t> kept;
  const auto place = [log_x](double value) {
    return log_x ? std::log(value) : value;
  };
  const AxisRange range = RangeOf(x, log_x);
  const double spacing = x.size() <= max_points
                             ? 0.0
                             : (place(*range.high) - place(*range.low)) /
                                   static_cast<double>(max_points);
  for (size_t i = 0; i < x.size(); ++i) {
    if (log_x && !(x[i] > 0.0)) continue;
    const bool is_next =
        kept.empty() ||
        std::abs(place(x[i]) - place(x[kept.back()])) >= spacing;
    if (is_next || i + 1 == x.size()) kept.push_back(i);
  }
  return kept;
}

Json SeriesJson(const Series& series,
                bool log_x,
                size_t max_points,
                const HtmlReport& report) {
  CHECK_EQ(series.x.size(), series.y.size()) << series.title;
  const bool is_method = series.color >= 0 &&
                         series.color < static_cast<int>(report.methods.size());
  const std::string& name =
      is_method ? report.methods[series.color].name : series.title;
  const std::string& label =
      is_method ? report.methods[series.color].label : series.title;
  const std::vector<size_t> kept = KeptPoints(series.x, log_x, max_points);
  Json json = {{"method", is_method ? series.color : -1},
               {"name", name},
               {"label", label},
               {"lines", series.style != Series::Style::kPoints},
               {"points", series.style != Series::Style::kLines},
               {"x", NumbersJson(series.x, kept)},
               {"y", NumbersJson(series.y, kept)}};
  if (!series.y_low.empty()) {
    json["low"] = NumbersJson(series.y_low, kept);
    json["high"] = NumbersJson(series.y_high, kept);
  }
  return json;
}

Json ViewJson(const Plot& view,
              bool has_steps,
              size_t max_points,
              const HtmlReport& report) {
  Json series = Json::array();
  for (const Series& one : view.series) {
    series.push_back(SeriesJson(one, view.log_x, max_points, report));
  }
  return {{"title", view.title},
          {"x", view.x_label},
          {"y", view.y_label},
          {"log_x", view.log_x},
          {"log_y", view.log_y},
          {"has_steps", has_steps},
          {"y_max", view.y_range.high.value_or(std::nan(""))},
          {"x_ticks", view.x_ticks},
          {"y_ticks", view.y_ticks},
          {"series", series}};
}

// The place of a value between the ends of the range, in [0, 1]; NaN: none.
double PlaceInRange(double value, const AxisRange& range, bool is_log) {
  const auto f = [is_log](double v) { return is_log ? std::log(v) : v; };
  if (!std::isfinite(value) || (is_log && value <= 0.0)) return std::nan("");
  const double low = f(*range.low), high = f(*range.high);
  if (!(high > low)) return 0.5;
  return std::clamp((f(value) - low) / (high - low), 0.0, 1.0);
}

// A cell in the colours of plot_script.h (viridis), with a text to read on it.
std::string MapCell(double value, double place, bool is_best) {
  if (std::isnan(place)) return "<td>-</td>";
  constexpr std::array<int, 9> kViridis = {0x440154,
                                           0x472d7b,
                                           0x3b528b,
                                           0x2c728e,
                                           0x21918c,
                                           0x28ae80,
                                           0x5ec962,
                                           0xaddc30,
                                           0xfde725};
  const double at = place * (kViridis.size() - 1);
  const auto i = std::min(static_cast<size_t>(at), kViridis.size() - 2);
  int color = 0;
  for (const int shift : {16, 8, 0}) {
    const int a = kViridis[i] >> shift & 255,
              b = kViridis[i + 1] >> shift & 255;
    color |= static_cast<int>(
                 std::lround(a + (at - static_cast<double>(i)) * (b - a)))
             << shift;
  }
  return fmt::format("<td{} style=\"background:#{:06x};color:{}\">{}</td>",
                     is_best ? " class=best" : "",
                     color,
                     place < 0.6 ? "#fff" : "#000",
                     FormatNumber(value, 3));
}

std::string TickLabel(const Ticks& ticks, double at) {
  for (const auto& [place, label] : ticks) {
    if (place == at) return EscapeHtml(label);
  }
  return FormatNumber(at);
}

std::string MapHtml(const Plot& plot, const Eigen::MatrixXd& lowest) {
  const HeatMap& map = *plot.heat_map;
  std::string html =
      fmt::format("<table><caption>{}</caption>\n", EscapeHtml(plot.title));
  for (Eigen::Index i = map.z.rows() - 1; i >= 0; --i) {
    html += "<tr><th>" +
            TickLabel(plot.y_ticks,
                      map.y_first + static_cast<double>(i) * map.y_step) +
            "</th>";
    for (Eigen::Index j = 0; j < map.z.cols(); ++j) {
      html += MapCell(map.z(i, j),
                      PlaceInRange(map.z(i, j), map.z_range, map.log_z),
                      map.z(i, j) == lowest(i, j));
    }
    html += "</tr>\n";
  }
  html += fmt::format("<tr><th>{} \\ {}</th>",
                      EscapeHtml(plot.y_label),
                      EscapeHtml(plot.x_label));
  for (Eigen::Index j = 0; j < map.z.cols(); ++j) {
    html += "<th>" +
            TickLabel(plot.x_ticks,
                      map.x_first + static_cast<double>(j) * map.x_step) +
            "</th>";
  }
  return html + "</tr></table>\n";
}

}  // namespace

std::string ChartsJson(const HtmlReport& report) {
  // Of numbers in all, and of points in a curve.
  constexpr size_t kMaxNumbers = 50'000, kMaxPoints = 200, kMinPoints = 12;
  size_t numbers_per_point = 1;
  for (const HtmlReport::Chart& chart : report.charts) {
    for (const Plot& view : chart.views) {
      for (const Series& series : view.series) {
        numbers_per_point += series.y_low.empty() ? 2 : 4;
      }
    }
  }
  const size_t max_points =
      std::clamp(kMaxNumbers / numbers_per_point, kMinPoints, kMaxPoints);
  Json charts = Json::array();
  for (const HtmlReport::Chart& chart : report.charts) {
    if (chart.views.empty()) continue;
    Json& views = charts.emplace_back(Json::array());
    for (const Plot& view : chart.views) {
      views.push_back(ViewJson(view, chart.has_steps, max_points, report));
    }
  }
  std::string text;
  for (const char c :
       charts.dump(-1, ' ', false, Json::error_handler_t::replace)) {
    text += c == '<' ? "\\u003c" : std::string(1, c);
  }
  return text;
}

std::string MapsHtml(const HtmlReport::Maps& maps) {
  if (maps.panels.empty()) return "";
  Eigen::MatrixXd lowest;
  for (const Plot& plot : maps.panels) {
    CHECK(plot.heat_map.has_value()) << plot.title;
    const Eigen::MatrixXd& z = plot.heat_map->z;
    if (lowest.size() == 0) lowest.setConstant(z.rows(), z.cols(), INFINITY);
    CHECK_EQ(z.rows(), lowest.rows()) << plot.title;
    CHECK_EQ(z.cols(), lowest.cols()) << plot.title;
    lowest = lowest.binaryExpr(
        z, [](double a, double b) { return std::fmin(a, b); });
  }
  std::string html = fmt::format(
      "<h2>{}</h2>\n<p class=caption>{}</p>\n<div class=\"maps "
      "scroll\">\n",
      EscapeHtml(maps.title),
      EscapeHtml(maps.caption));
  if (maps.panels.size() == 1) lowest.setConstant(-INFINITY);  // marks none
  for (const Plot& plot : maps.panels) html += MapHtml(plot, lowest);
  return html + "</div>\n";
}

}  // namespace invgrad
