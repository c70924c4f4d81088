#include <cmath>
#include <numeric>
#include <sstream>
#include <utility>

#include "invgrad/internal/logging.h"
#include "invgrad/random.h"

namespace invgrad {

double NumpyRandom::Rand() {
  // Two statements: the order of evaluation within one is not specified.
  const double high = generator_() >> 5;
  const double low = generator_() >> 6;
  return (high * 67108864.0 + low) / 9007199254740992.0;
}

Eigen::MatrixXd NumpyRandom::Rand(int rows, int cols) {
  Eigen::MatrixXd values(rows, cols);
  for (double& value : values.reshaped<Eigen::RowMajor>()) value = Rand();
  return values;
}

double NumpyRandom::Uniform(double low, double high) {
  return low + (high - low) * Rand();
}

Eigen::Vector2d NumpyRandom::NormalPair() {
  double x = 0.0, y = 0.0, square = 0.0;
  do {
    x = 2.0 * Rand() - 1.0;
    y = 2.0 * Rand() - 1.0;
    square = x * x + y * y;
  } while (square >= 1.0 || square == 0.0);
  const double scale = std::sqrt(-2.0 * std::log(square) / square);
  return {scale * y, scale * x};
}

Eigen::VectorXd NumpyRandom::Normal(int size) {
  Eigen::VectorXd numbers(size + size % 2);
  for (int i = 0; i < size; i += 2) numbers.segment<2>(i) = NormalPair();
  numbers.conservativeResize(size);
  return numbers;
}

std::vector<int> NumpyRandom::Permutation(int n) {
  CHECK_GE(n, 0);
  std::vector<int> order(n);
  std::iota(order.begin(), order.end(), 0);
  // Fisher-Yates from the back; the index in [0, i] is drawn by masking and
  // rejection (random_interval), so the number of draws depends on their
  // values.
  for (int i = n - 1; i > 0; --i) {
    std::uint32_t mask = i;
    for (int shift = 1; shift < 32; shift *= 2) {
      mask |= mask >> shift;
    }
    std::uint32_t j = 0;
    do {
      j = generator_() & mask;
    } while (j > static_cast<std::uint32_t>(i));
    std::swap(order[i], order[j]);
  }
  return order;
}

Eigen::VectorXd NumpyRandom::State() const {
  std::stringstream text;
  text << generator_;
  Eigen::VectorXd state(std::mt19937::state_size + 1);
  for (double& word : state) text >> word;
  return state;
}

bool NumpyRandom::SetState(const Eigen::VectorXd& state) {
  constexpr auto kSize = static_cast<Eigen::Index>(std::mt19937::state_size);
  constexpr double kMaxWord = std::mt19937::max();
  // The last integer is a position among the others.
  if (state.size() != kSize + 1 ||
      !(state.array() >= 0.0 && state.array() <= kMaxWord &&
        state.array() == state.array().floor())
           .all() ||
      state[kSize] > kSize) {
    return false;
  }
  std::stringstream text;
  for (const double word : state)
    text << static_cast<std::uint32_t>(word) << ' ';
  text >> generator_;
  return true;
}

}  // namespace invgrad
