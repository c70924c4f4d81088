#include "report/run_curves.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

double ValueAt(const Series& run, double x) {
  const auto next = std::upper_bound(run.x.begin(), run.x.end(), x);
  if (next == run.x.begin()) return std::nan("");
  const auto k = static_cast<size_t>(next - run.x.begin());
  const double y0 = run.y[k - 1];
  if (next == run.x.end() || run.x[k - 1] == x) return y0;
  const double y1 = run.y[k];
  const double share = (x - run.x[k - 1]) / (run.x[k] - run.x[k - 1]);
  return y0 > 0.0 && y1 > 0.0 ? y0 * std::pow(y1 / y0, share)
                              : y0 + share * (y1 - y0);
}

}  // namespace

Series MedianCurve(const std::vector<Series>& runs) {
  CHECK(!runs.empty());
  if (runs.size() == 1) return runs[0];
  std::vector<double> xs;
  double begin = -std::numeric_limits<double>::infinity();
  for (const Series& run : runs) {
    CHECK_EQ(run.x.size(), run.y.size()) << run.title;
    xs.insert(xs.end(), run.x.begin(), run.x.end());
    if (!run.x.empty()) begin = std::max(begin, run.x.front());
  }
  std::sort(xs.begin(), xs.end());
  xs.erase(std::unique(xs.begin(), xs.end()), xs.end());
  Series curve;
  curve.title = runs[0].title;
  curve.style = runs[0].style;
  curve.color = runs[0].color;
  for (const double x : xs) {
    if (!(x >= begin)) continue;
    std::vector<double> values;
    for (const Series& run : runs) {
      const double y = run.x.empty() ? std::nan("") : ValueAt(run, x);
      values.push_back(std::isfinite(y) ? y : INFINITY);
    }
    std::sort(values.begin(), values.end());
    const double median = values[(values.size() - 1) / 2];
    while (values.size() > 1 && std::isinf(values.back())) values.pop_back();
    curve.x.push_back(x);
    curve.y.push_back(median);
    curve.y_low.push_back(values.front());
    curve.y_high.push_back(values.back());
  }
  return curve;
}

}  // namespace invgrad
