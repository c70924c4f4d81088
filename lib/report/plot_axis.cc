#include "report/plot_axis.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "fmt/core.h"
#include "report/gnuplot.h"

namespace invgrad {
namespace {

// gnuplot treats values above 8.99e307 as undefined; this limit leaves space
// for margins.
constexpr double kLargest = 1e306;
constexpr double kSmallest = 1e-306;  // on a logarithmic axis

std::string TicksText(const PlotTicks& ticks) {
  // Shows only some of many labels.
  constexpr size_t kMaxLabels = 16;
  const size_t stride = (ticks.size() + kMaxLabels - 1) / kMaxLabels;
  std::string text;
  for (size_t i = 0; i < ticks.size(); i += stride) {
    text += fmt::format("{}{} {:.10g}",
                        i > 0 ? ", " : "",
                        QuoteForGnuplot(ticks[i].second),
                        ticks[i].first);
  }
  return "(" + text + ")";
}

}  // namespace

bool CanDraw(double value, bool is_log) {
  return std::abs(value) <= kLargest && (!is_log || value >= kSmallest);
}

Axis FitAxis(bool is_log,
             const AxisRange& range,
             double margin,
             const std::vector<const std::vector<double>*>& data) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const std::vector<double>* values : data) {
    for (const double value : *values) {
      if (!CanDraw(value, is_log)) continue;
      low = std::min(low, is_log ? std::log10(value) : value);
      high = std::max(high, is_log ? std::log10(value) : value);
    }
  }
  if (low > high) low = high = 0.5;  // nothing to draw
  double pad = margin * (high - low);
  if (high - low <= 1e-12 * std::max(std::abs(low), std::abs(high))) {
    pad = is_log || std::abs(high) < 1e-100 ? 0.5 : 0.1 * std::abs(high);
  }
  const auto end = [is_log](double display) {
    return std::clamp(is_log ? std::pow(10.0, display) : display,
                      is_log ? kSmallest : -kLargest,
                      kLargest);
  };
  Axis axis{is_log, end(low - pad), end(high + pad)};
  if (range.low && CanDraw(*range.low, is_log)) axis.low = *range.low;
  if (range.high && CanDraw(*range.high, is_log)) axis.high = *range.high;
  constexpr double kMinRatio = 5.0;
  if (axis.high < kMinRatio * axis.low) axis.is_log = false;
  return axis;
}

std::string AxisCommands(const std::string& name,
                         const Axis& axis,
                         PlotTicks ticks) {
  // gnuplot labels only powers of ten, too few for less than two decades.
  const bool is_short = axis.high < 100.0 * axis.low;
  if (ticks.empty() && axis.is_log && is_short) {
    const double first = std::pow(10.0, std::floor(std::log10(axis.low)));
    for (const double factor : {1, 2, 5, 10, 20, 50, 100, 200, 500}) {
      const double tick = factor * first;
      if (tick < axis.low || tick > axis.high) continue;
      ticks.emplace_back(tick, fmt::format("{:.10g}", tick));
    }
  }
  return fmt::format(
      "{} logscale {}\nset {}range [{:.10g}:{:.10g}]\nset format {} '{}'\n"
      "set {}tics {}\n",
      axis.is_log ? "set" : "unset",
      name,
      name,
      axis.low,
      axis.high,
      name,
      axis.is_log && !is_short ? "10^{%T}" : "%h",
      name,
      ticks.empty() ? "auto" : TicksText(ticks));
}

}  // namespace invgrad
