// Periodic fields and their diffusion, for tests of the heat problems.
#ifndef INVGRAD_TESTS_HEAT_FIELDS_H_
#define INVGRAD_TESTS_HEAT_FIELDS_H_

#include <cmath>
#include <cstdint>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/random.h"
#include "problems/spectral_diffusion.h"

namespace invgrad {

struct Shape {
  int rows;
  int cols;
};

// One dimension and two, even and odd sides, sides of different length.
inline constexpr Shape kShapes[] = {
    {1, 16}, {1, 9}, {8, 8}, {5, 7}, {6, 9}, {9, 4}};

inline Eigen::VectorXd RandomField(int size, int seed) {
  NumpyRandom random(static_cast<std::uint32_t>(seed));
  Eigen::VectorXd x(size);
  for (double& value : x) value = random.Uniform(-1.0, 1.0);
  return x;
}

// cos(k . j + phase) for m waves along each axis.
inline Eigen::VectorXd Wave(const Shape& shape,
                            int m_0,
                            int m_1,
                            double phase) {
  Eigen::VectorXd x(shape.rows * shape.cols);
  for (int i = 0; i < shape.rows; ++i) {
    for (int j = 0; j < shape.cols; ++j) {
      x[shape.cols * i + j] = std::cos(
          2.0 * M_PI *
              (1.0 * m_0 * i / shape.rows + 1.0 * m_1 * j / shape.cols) +
          phase);
    }
  }
  return x;
}

inline double SquaredWaveNumber(const Shape& shape, int m_0, int m_1) {
  return std::pow(2.0 * M_PI * m_0 / shape.rows, 2) +
         std::pow(2.0 * M_PI * m_1 / shape.cols, 2);
}

inline std::shared_ptr<const SpectralDiffusion> MakeDiffusion(
    const Shape& shape, double diffusion) {
  return std::make_shared<SpectralDiffusion>(
      std::make_shared<FourierGrid>(shape.rows, shape.cols), diffusion);
}

inline Eigen::VectorXd Outputs(const Simulator& simulator,
                               const Eigen::VectorXd& x) {
  Eigen::VectorXd y(simulator.num_outputs());
  EXPECT_TRUE(simulator.Evaluate(x.data(), nullptr, y.data(), nullptr));
  return y;
}

inline Eigen::VectorXd Inverted(const InverseSimulator& inverse,
                                const Eigen::VectorXd& y,
                                const Eigen::VectorXd& x0) {
  Eigen::VectorXd x;
  std::string why;
  EXPECT_TRUE(inverse.Invert(y, x0, Eigen::VectorXd(), &x, &why)) << why;
  return x;
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_HEAT_FIELDS_H_
