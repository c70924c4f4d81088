#include "bin/fresh_samples/agreement.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "Eigen/Core"
#include "glog/logging.h"

namespace invgrad {
namespace {

// Centred.
Eigen::VectorXd Ranks(const std::vector<double>& values) {
  Eigen::VectorXd ranks(values.size());
  for (size_t i = 0; i < values.size(); ++i) {
    int num_below = 0, num_equal = 0;
    for (const double value : values) {
      num_below += value < values[i] ? 1 : 0;
      num_equal += value == values[i] ? 1 : 0;
    }
    ranks[i] = num_below + 0.5 * num_equal;
  }
  return ranks.array() - 0.5 * static_cast<double>(values.size());
}

}  // namespace

Agreement::Agreement(const std::vector<double>& predicted,
                     const std::vector<double>& measured) {
  CHECK_EQ(predicted.size(), measured.size());
  std::vector<double> x, y, ratios;
  for (size_t i = 0; i < predicted.size(); ++i) {
    if (!std::isfinite(predicted[i]) || !std::isfinite(measured[i])) continue;
    x.push_back(predicted[i]);
    y.push_back(measured[i]);
    if (x.back() > 0.0) ratios.push_back(y.back() / x.back());
  }
  num_pairs = static_cast<int>(x.size());
  const Eigen::VectorXd x_ranks = Ranks(x);
  const Eigen::VectorXd y_ranks = Ranks(y);
  rank_correlation = x_ranks.dot(y_ranks) / (x_ranks.norm() * y_ranks.norm());
  median_ratio = std::numeric_limits<double>::quiet_NaN();
  if (ratios.empty()) return;
  const auto middle = ratios.begin() + ratios.size() / 2;
  std::nth_element(ratios.begin(), middle, ratios.end());
  median_ratio = *middle;
}

}  // namespace invgrad
