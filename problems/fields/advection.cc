#include "problems/fields/advection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "glog/logging.h"

namespace invgrad {

using Eigen::VectorXd;

namespace {

// The two points of an axis around a position, and the position between them.
struct Interval {
  int low;
  int high;
  double share;
};

Interval Locate(double position, int n, Lattice::Outside outside) {
  if (!std::isfinite(position)) {
    return {0, 0, std::numeric_limits<double>::quiet_NaN()};
  }
  if (outside == Lattice::Outside::kPeriodic) {
    if (position < 0.0 || position >= n) {
      position -= n * std::floor(position / n);
      // Rounding of a large one.
      if (!(position >= 0.0 && position <= n)) position = 0.0;
    }
  } else {
    // Farther outside the field is constant.
    position = std::clamp(position, -2.0, n + 1.0);
  }
  int low = static_cast<int>(position);
  if (position < low) --low;
  const double share = position - low;
  if (low >= 0 && low + 1 < n) return {low, low + 1, share};
  const auto index = [&](int i) {
    if (i >= 0 && i < n) return i;
    if (outside == Lattice::Outside::kPeriodic) return i - n;
    if (outside == Lattice::Outside::kZero) return Lookup::kNone;
    return std::clamp(i, 0, n - 1);
  };
  return {index(low), index(low + 1), share};
}

double At(const VectorXd& f, int point) {
  return point == Lookup::kNone ? 0.0 : f[point];
}

}  // namespace

Lookup::Lookup(const Lattice& lattice, const VectorXd& d, double sign)
    : sign_(sign), corners_(lattice.size()), x_(lattice.size()), y_(x_) {
  const int size = lattice.size();
  CHECK_EQ(d.size(), 2 * size);
  int point = 0;
  for (int i = 0; i < lattice.rows; ++i) {
    for (int j = 0; j < lattice.cols; ++j, ++point) {
      const Interval col =
          Locate(j + sign * d[point], lattice.cols, lattice.outside);
      const Interval row =
          Locate(i + sign * d[size + point], lattice.rows, lattice.outside);
      const auto index = [&](int row_index, int col_index) {
        if (row_index == kNone || col_index == kNone) return kNone;
        return row_index * lattice.cols + col_index;
      };
      corners_[point] = {index(row.low, col.low),
                         index(row.low, col.high),
                         index(row.high, col.low),
                         index(row.high, col.high)};
      x_[point] = col.share;
      y_[point] = row.share;
    }
  }
}

std::array<double, 4> Lookup::Weights(int point) const {
  const double x = x_[point];
  const double y = y_[point];
  return {(1.0 - y) * (1.0 - x), (1.0 - y) * x, y * (1.0 - x), y * x};
}

VectorXd Lookup::Interpolate(const VectorXd& f) {
  const int size = static_cast<int>(corners_.size());
  VectorXd out(size);
  x_slope_.resize(size);
  y_slope_.resize(size);
  for (int p = 0; p < size; ++p) {
    const std::array<int, 4>& c = corners_[p];
    const double f00 = At(f, c[0]), f01 = At(f, c[1]);
    const double f10 = At(f, c[2]), f11 = At(f, c[3]);
    const std::array<double, 4> w = Weights(p);
    out[p] = w[0] * f00 + w[1] * f01 + w[2] * f10 + w[3] * f11;
    x_slope_[p] = (1.0 - y_[p]) * (f01 - f00) + y_[p] * (f11 - f10);
    y_slope_[p] = (1.0 - x_[p]) * (f10 - f00) + x_[p] * (f11 - f01);
  }
  return out;
}

VectorXd Lookup::Tangent(const VectorXd& df, const VectorXd& dd) const {
  const int size = static_cast<int>(corners_.size());
  VectorXd out(size);
  for (int p = 0; p < size; ++p) {
    const std::array<double, 4> w = Weights(p);
    out[p] = sign_ * (x_slope_[p] * dd[p] + y_slope_[p] * dd[size + p]);
    for (int k = 0; k < 4; ++k) out[p] += w[k] * At(df, corners_[p][k]);
  }
  return out;
}

void Lookup::Adjoint(const VectorXd& out_bar,
                     VectorXd* f_bar,
                     VectorXd* d_bar) const {
  const int size = static_cast<int>(corners_.size());
  for (int p = 0; p < size; ++p) {
    const std::array<double, 4> w = Weights(p);
    for (int k = 0; k < 4; ++k) {
      const int corner = corners_[p][k];
      if (corner != kNone) (*f_bar)[corner] += w[k] * out_bar[p];
    }
    (*d_bar)[p] += sign_ * x_slope_[p] * out_bar[p];
    (*d_bar)[size + p] += sign_ * y_slope_[p] * out_bar[p];
  }
}

AdvectedField::AdvectedField(const Lattice& lattice,
                             Scheme scheme,
                             const VectorXd& f,
                             const VectorXd& d)
    : backward_(lattice, d, -1.0), value_(backward_.Interpolate(f)) {
  if (scheme == Scheme::kSemiLagrangian) return;
  Lookup& forward = forward_.emplace_back(lattice, d, 1.0);
  value_ += 0.5 * (f - forward.Interpolate(value_));
  clamped_to_.assign(lattice.size(), kFree);
  for (int p = 0; p < lattice.size(); ++p) {
    const std::array<int, 4>& corners = backward_.corners(p);
    int lowest = corners[0], highest = corners[0];
    double low = At(f, corners[0]), high = low;
    for (int k = 1; k < 4; ++k) {
      const double value = At(f, corners[k]);
      if (value < low) {
        low = value;
        lowest = corners[k];
      }
      if (value > high) {
        high = value;
        highest = corners[k];
      }
    }
    if (value_[p] < low) {
      value_[p] = low;
      clamped_to_[p] = lowest;
    } else if (value_[p] > high) {
      value_[p] = high;
      clamped_to_[p] = highest;
    }
  }
}

VectorXd AdvectedField::Tangent(const VectorXd& df, const VectorXd& dd) const {
  VectorXd out = backward_.Tangent(df, dd);
  if (forward_.empty()) return out;
  out += 0.5 * (df - forward_[0].Tangent(out, dd));
  for (int p = 0; p < out.size(); ++p) {
    if (clamped_to_[p] != kFree) out[p] = At(df, clamped_to_[p]);
  }
  return out;
}

void AdvectedField::Adjoint(VectorXd value_bar,
                            VectorXd* f_bar,
                            VectorXd* d_bar) const {
  if (!forward_.empty()) {
    for (int p = 0; p < value_bar.size(); ++p) {
      const int corner = clamped_to_[p];
      if (corner == kFree) continue;
      if (corner != Lookup::kNone) (*f_bar)[corner] += value_bar[p];
      value_bar[p] = 0.0;
    }
    *f_bar += 0.5 * value_bar;
    const VectorXd inverse_bar = -0.5 * value_bar;
    forward_[0].Adjoint(inverse_bar, &value_bar, d_bar);
  }
  backward_.Adjoint(value_bar, f_bar, d_bar);
}

}  // namespace invgrad
