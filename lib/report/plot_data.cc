#include "report/plot_data.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <vector>

#include "fmt/format.h"

namespace invgrad {
int AppendSeries(const std::string& name,
                 const Series& series,
                 const Axis& x_axis,
                 const Axis& y_axis,
                 std::string* script) {
  *script += name + " << EOD\n";
  int num_points = 0;
  bool is_gap = true;  // no gap before the first point, and none doubled
  for (size_t i = 0; i < series.x.size(); ++i) {
    const bool is_drawn = CanDraw(series.x[i], x_axis.is_log) &&
                          CanDraw(series.y[i], y_axis.is_log);
    if (is_drawn) {
      *script += fmt::format("{:.10g} {:.10g}", series.x[i], series.y[i]);
      for (const auto* ends : {&series.y_low, &series.y_high}) {
        if (ends->empty()) continue;
        // Clips a band at the lower end of a logarithmic axis.
        const double end =
            y_axis.is_log ? std::max((*ends)[i], y_axis.low) : (*ends)[i];
        *script += fmt::format(" {:.10g}",
                               CanDraw(end, y_axis.is_log) ? end : series.y[i]);
      }
    }
    if (is_drawn || !is_gap) *script += '\n';
    is_gap = !is_drawn;
    num_points += is_drawn ? 1 : 0;
  }
  *script += "EOD\n";
  return num_points;
}

bool AppendContours(const std::string& name,
                    const ContourField& field,
                    std::string* script) {
  std::vector<double> z;
  std::copy_if(field.z.data(),
               field.z.data() + field.z.size(),
               std::back_inserter(z),
               [](double value) { return std::isfinite(value); });
  std::sort(z.begin(), z.end());
  std::set<double> levels;
  constexpr size_t kNumLevels = 14;
  for (size_t k = 1; k <= kNumLevels && z.size() > 1; ++k) {
    // Halfway to the next value: no line touches a point of the grid.
    const size_t i = (z.size() - 2) * k / (kNumLevels + 1);
    levels.insert(0.5 * (z[i] + z[i + 1]));
  }
  if (levels.empty() || field.x.size() < 2 || field.y.size() < 2) return false;
  *script += name + "_grid << EOD\n";
  for (size_t i = 0; i < field.y.size(); ++i) {
    for (size_t j = 0; j < field.x.size(); ++j) {
      *script += fmt::format(
          "{:.10g} {:.10g} {:.10g}\n", field.x[j], field.y[i], field.z(i, j));
    }
    *script += '\n';
  }
  *script += fmt::format(
      "EOD\nset cntrparam linear levels discrete {:.10g}\n"
      "set contour base\nunset surface\nset table {}\n"
      "splot {}_grid using 1:2:3\nunset table\nunset contour\nset surface\n",
      fmt::join(levels, ","),
      name,
      name);
  return true;
}

void AppendCells(const std::string& name,
                 const HeatMap& map,
                 std::string* script) {
  *script += name + " << EOD\n";
  for (Eigen::Index i = 0; i < map.z.rows(); ++i) {
    for (Eigen::Index j = 0; j < map.z.cols(); ++j) {
      if (!CanDraw(map.z(i, j), map.log_z)) continue;
      *script += fmt::format("{} {} {:.10g}\n", j, i, map.z(i, j));
    }
  }
  *script += "EOD\n";
}

}  // namespace invgrad
