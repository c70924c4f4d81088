// The text of a Covariance, after the report of lmfit.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "fmt/core.h"
#include "fmt/ranges.h"
#include "invgrad/covariance.h"
#include "invgrad/internal/small_covariance.h"
#include "invgrad/io/format.h"

namespace invgrad {
namespace {

using Eigen::Index;

struct Line {
  std::string name;
  std::string value;
  std::string deviation;
};

std::string Percent(double share) {
  return FormatNumber(100.0 * share, 3) + " %";
}

bool Contains(const std::vector<int>& directions, int tangent) {
  return std::count(directions.begin(), directions.end(), tangent) > 0;
}

Line ParameterLine(const Covariance::Block& block, int tangent) {
  Line line;
  line.name = block.block.ParameterName(tangent);
  const int component = block.block.components[tangent];
  const double value = component < 0 ? 0.0 : block.values[component];
  line.value = component < 0 ? "-" : FormatNumber(value, 8);
  if (Contains(block.at_bound, tangent)) {
    line.deviation = "at its bound";
    return line;
  }
  const double deviation = block.standard_deviations[tangent];
  const double share = block.undetermined_shares[tangent];
  if (!std::isfinite(deviation)) {
    line.deviation = "not determined";
    if (Contains(block.rounding, tangent)) {
      line.deviation += " (derivatives are 0 or rounding errors)";
    }
    return line;
  }
  line.deviation = "+/- " + FormatNumber(deviation, 5);
  if (share > kLeastUndeterminedShare) {
    line.deviation +=
        fmt::format(" (no error bar: {} not determined)", Percent(share));
    return line;
  }
  std::vector<std::string> remarks;
  if (value != 0.0) remarks.push_back(Percent(deviation / std::abs(value)));
  constexpr double kNotable = 0.01;  // of the variance
  const double variance = deviation * deviation;
  const double weak = block.weak_variances[tangent] / variance;
  if (weak >= kNotable) {
    remarks.push_back(Percent(weak) + " of the variance from weak directions");
  }
  const double omitted = block.omitted_variances[tangent] / variance;
  if (omitted >= kNotable) {
    remarks.push_back(Percent(omitted) +
                      " more variance with the directions below the threshold");
  }
  if (!remarks.empty()) {
    line.deviation += fmt::format(" ({})", fmt::join(remarks, "; "));
  }
  return line;
}

struct Correlation {
  std::string names;
  double value;
};

// Of parameters in the pair of blocks; of one block, above the diagonal.
void AddCorrelations(const Covariance& covariance,
                     const Covariance::Block& a,
                     const Covariance::Block& b,
                     double min_correlation,
                     std::vector<Correlation>* correlations) {
  const Eigen::MatrixXd C =
      covariance.Correlations(a.block.values, b.block.values);
  for (Index i = 0; i < C.rows(); ++i) {
    for (Index j = &a == &b ? i + 1 : 0; j < C.cols(); ++j) {
      if (!(std::abs(C(i, j)) >= min_correlation)) continue;
      correlations->push_back(
          {fmt::format("{}, {}",
                       a.block.ParameterName(static_cast<int>(i)),
                       b.block.ParameterName(static_cast<int>(j))),
           C(i, j)});
    }
  }
}

std::string More(std::size_t size, int max_items) {
  const std::size_t shown = static_cast<std::size_t>(std::max(0, max_items));
  return size > shown ? fmt::format("  and {} more\n", size - shown) : "";
}

}  // namespace

std::string Covariance::ToText(double min_correlation, int max_items) const {
  std::size_t num_at_bounds = 0;
  for (const Block& block : blocks_) num_at_bounds += block.at_bound.size();
  std::string text = fmt::format(
      "{} residuals, {} parameters{}, {} determined; variance of a residual "
      "{}\n",
      num_residuals_,
      num_parameters_,
      num_at_bounds > 0 ? fmt::format(" (and {} at bounds)", num_at_bounds)
                        : "",
      rank_,
      uses_residual_variance_
          ? FormatNumber(residual_variance(), 5) + " (2 L / (m - rank))"
          : "1");
  std::vector<Line> lines;
  for (const Block& block : blocks_) {
    for (Index i = 0; i < block.standard_deviations.size(); ++i) {
      lines.push_back(ParameterLine(block, static_cast<int>(i)));
    }
  }
  std::size_t name_width = 0;
  std::size_t value_width = 0;
  for (const Line& line : lines) {
    name_width = std::max(name_width, line.name.size());
    value_width = std::max(value_width, line.value.size());
  }
  for (std::size_t k = 0; k < lines.size() && static_cast<int>(k) < max_items;
       ++k) {
    text += fmt::format("  {:<{}}  {:>{}}  {}\n",
                        lines[k].name,
                        name_width,
                        lines[k].value,
                        value_width,
                        lines[k].deviation);
  }
  text += More(lines.size(), max_items);

  std::vector<Correlation> correlations;
  for (const auto& [pair, C] : computed_) {
    const Block& a = blocks_[pair.first];
    const Block& b = blocks_[pair.second];
    if (a.standard_deviations.size() == C.rows() &&
        b.standard_deviations.size() == C.cols()) {
      AddCorrelations(*this, a, b, min_correlation, &correlations);
    }
  }
  if (correlations.empty()) return text;
  std::stable_sort(correlations.begin(),
                   correlations.end(),
                   [](const Correlation& a, const Correlation& b) {
                     return std::abs(a.value) > std::abs(b.value);
                   });
  text += fmt::format("correlations of at least {}:\n",
                      FormatNumber(min_correlation, 3));
  for (std::size_t k = 0;
       k < correlations.size() && static_cast<int>(k) < max_items;
       ++k) {
    text += fmt::format(
        "  {}: {:.4f}\n", correlations[k].names, correlations[k].value);
  }
  return text + More(correlations.size(), max_items);
}

}  // namespace invgrad
