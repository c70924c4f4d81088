// Matrices for tests: uniform on [-1, 1], always the same for one seed.
#ifndef TESTS_RANDOM_MATRIX_H_
#define TESTS_RANDOM_MATRIX_H_

#include <random>

#include "Eigen/Core"

namespace invgrad {

inline Eigen::MatrixXd RandomMatrix(int rows, int cols, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  return Eigen::MatrixXd::NullaryExpr(
      rows, cols, [&](Eigen::Index) { return uniform(generator); });
}

}  // namespace invgrad

#endif  // TESTS_RANDOM_MATRIX_H_
