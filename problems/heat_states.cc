#include "problems/heat_states.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "invgrad/io/numpy_random.h"

namespace invgrad {

namespace {

constexpr int kMaxRectangles = 10;

// The share of each of n cells that lies in [low, high].
Eigen::VectorXd Shares(int n, double low, double high) {
  const double dx = kHeatBoxSide / n;
  Eigen::VectorXd shares(n);
  for (int i = 0; i < n; ++i) {
    const double overlap = std::min(high, (i + 1) * dx) - std::max(low, i * dx);
    shares[i] = std::max(overlap, 0.0) / dx;
  }
  return shares;
}

// The shares along one axis of the rectangle with the numbers U of p and h.
Eigen::VectorXd RandomShares(int n, double u_position, double u_half_size) {
  const double half_size = 10.0 * u_half_size;
  const double position =
      kHeatBoxSide / 2.0 + 0.8 * kHeatBoxSide * (u_position - 0.5);
  const double centre =
      std::clamp(position, half_size, kHeatBoxSide - half_size);
  return Shares(n, centre - half_size, centre + half_size);
}

}  // namespace

Eigen::MatrixXd RandomHeatStates(int num_states, int rows, int cols, int seed) {
  using RowMajorMatrix =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  NumpyRandom random(static_cast<std::uint32_t>(seed));
  const bool is_interval = rows == 1;
  const int num_axes = is_interval ? 1 : 2;
  Eigen::MatrixXd states(num_states, rows * cols);
  for (int n = 0; n < num_states; ++n) {
    const int num_rectangles = static_cast<int>(4.0 + 7.0 * random.Rand());
    RowMajorMatrix state = RowMajorMatrix::Zero(rows, cols);
    for (int i = 0; i < kMaxRectangles; ++i) {
      const Eigen::MatrixXd u = random.Rand(2, num_axes);
      const double strength = random.Rand();
      if (i >= num_rectangles) continue;
      const Eigen::VectorXd along_rows =
          is_interval ? Eigen::VectorXd::Ones(1)
                      : RandomShares(rows, u(0, 0), u(1, 0));
      const Eigen::VectorXd along_cols =
          RandomShares(cols, u(0, num_axes - 1), u(1, num_axes - 1));
      state += strength * along_rows * along_cols.transpose();
    }
    states.row(n) = state.reshaped<Eigen::RowMajor>().transpose();
  }
  return states;
}

}  // namespace invgrad
