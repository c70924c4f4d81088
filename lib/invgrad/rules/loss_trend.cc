#include "invgrad/rules/loss_trend.h"

#include <algorithm>
#include <cmath>

#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

constexpr double kForgetting = 1.0 - 1.0 / 50.0;
constexpr double kOutlier = 2.5;  // standard deviations

double Logarithm(double loss) { return std::log(std::max(loss, 1e-300)); }

}  // namespace

void LossTrend::Add(double loss) {
  CHECK(std::isfinite(loss)) << loss;
  const double l = Logarithm(loss);
  Eigen::VectorXd& s = state_;
  // All earlier losses move back by one step: t - 1 in place of t.
  s[kTime2] += s[kWeight] - 2.0 * s[kTime];
  s[kTimeLog] -= s[kLog];
  s[kTime] -= s[kWeight];
  s.tail(kSize - 1) *= kForgetting;
  s[kCount] += 1.0;
  s[kWeight] += 1.0;
  s[kLog] += l;
  s[kLog2] += l * l;
}

LossTrend::Line LossTrend::Fit() const {
  CHECK(known());
  const Eigen::VectorXd mean = state_ / state_[kWeight];
  const double time_variance = mean[kTime2] - mean[kTime] * mean[kTime];
  const double covariance = mean[kTimeLog] - mean[kTime] * mean[kLog];
  Line line{};
  line.slope = covariance / time_variance;
  line.level = mean[kLog] - line.slope * mean[kTime];
  line.variance = std::max(
      0.0, mean[kLog2] - mean[kLog] * mean[kLog] - line.slope * covariance);
  line.slope_variance = line.variance / (time_variance * state_[kWeight]);
  return line;
}

double LossTrend::slope() const { return Fit().slope; }

double LossTrend::slope_error() const {
  return std::sqrt(Fit().slope_variance);
}

bool LossTrend::IsOutlier(double loss) const {
  const Line line = Fit();
  const double above = Logarithm(loss) - (line.level + line.slope);
  return above > std::log(2.0) && above > kOutlier * std::sqrt(line.variance);
}

}  // namespace invgrad
