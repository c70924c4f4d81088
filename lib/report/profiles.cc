#include "report/profiles.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

// The share of `values` up to each of them, from `first` to `last`.
Series Shares(std::vector<double> values,
              int color,
              double first,
              double last) {
  std::sort(values.begin(), values.end());
  Series series;
  series.color = color;
  series.x = {first};
  series.y = {0.0};
  for (size_t i = 0; i < values.size() && values[i] < kNever; ++i) {
    if (values[i] > series.x.back()) {
      series.x.push_back(values[i]);
      series.y.push_back(0.0);
    }
    series.y.back() =
        static_cast<double>(i + 1) / static_cast<double>(values.size());
  }
  series.x.push_back(last);
  series.y.push_back(series.y.back());
  return series;
}

std::vector<Series> AllShares(const Eigen::MatrixXd& x, double first) {
  double last = first;
  for (const double value : x.reshaped()) {
    if (value < kNever) last = std::max(last, value);
  }
  std::vector<Series> all;
  for (Eigen::Index s = 0; s < x.cols(); ++s) {
    const Eigen::VectorXd column = x.col(s);
    all.push_back(Shares({column.begin(), column.end()},
                         static_cast<int>(s),
                         first,
                         std::max(1.05 * last, 2.0 * first)));
  }
  return all;
}

}  // namespace

Eigen::MatrixXd WorkToSolve(const std::vector<std::vector<SolveTrace>>& traces,
                            double tolerance) {
  std::vector<Eigen::VectorXd> rows;
  for (const std::vector<SolveTrace>& solvers : traces) {
    CHECK_EQ(solvers.size(), traces[0].size());
    double start = -kNever, least = kNever;
    for (const SolveTrace& trace : solvers) {
      CHECK_EQ(trace.work.size(), trace.cost.size());
      if (!trace.cost.empty()) start = std::fmax(start, trace.cost[0]);
      for (const double cost : trace.cost) least = std::fmin(least, cost);
    }
    if (!(least < start)) continue;
    const double goal = least + tolerance * (start - least);
    Eigen::VectorXd row = Eigen::VectorXd::Constant(solvers.size(), kNever);
    for (size_t s = 0; s < solvers.size(); ++s) {
      const auto& [work, cost] = solvers[s];
      const auto found = std::find_if(
          cost.begin(), cost.end(), [&](double f) { return f <= goal; });
      if (found != cost.end()) row[s] = work[found - cost.begin()];
    }
    rows.push_back(row);
  }
  const auto num_solvers =
      static_cast<Eigen::Index>(traces.empty() ? 0 : traces[0].size());
  Eigen::MatrixXd all(rows.size(), num_solvers);
  for (size_t p = 0; p < rows.size(); ++p) all.row(p) = rows[p].transpose();
  return all;
}

std::vector<Series> PerformanceProfile(const Eigen::MatrixXd& work) {
  Eigen::MatrixXd ratios = work;
  for (Eigen::Index p = 0; p < work.rows(); ++p) {
    // A time below the clock's resolution is zero.
    const double best = std::max(work.row(p).minCoeff(), 1e-9);
    ratios.row(p) = (work.row(p) / best).cwiseMax(1.0);
  }
  return AllShares(ratios, 1.0);
}

std::vector<Series> DataProfile(const Eigen::MatrixXd& work) {
  double first = kNever;
  for (const double value : work.reshaped()) {
    if (value > 0.0) first = std::min(first, value);
  }
  return AllShares(work, first < kNever ? first : 1.0);
}

}  // namespace invgrad
