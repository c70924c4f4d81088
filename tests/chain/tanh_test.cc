#include "invgrad/chain/tanh.h"

#include <cmath>
#include <limits>
#include <random>

#include "Eigen/Core"
#include "gtest/gtest.h"

namespace invgrad {
namespace tanh_test {

TEST(TanhAllTest, HasTheBitsOfTheStandardLibrary) {
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  constexpr int kSize = 100003;  // no multiple of four
  Eigen::VectorXd x(kSize);
  for (double& value : x) {
    value = normal(generator) * std::exp(4.0 * normal(generator));
  }
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const double special[] = {0.0,
                            -0.0,
                            1e-300,
                            -0x1p-55,
                            0x1p-54,
                            1.0,
                            -1.0,
                            0x1p-53,
                            -21.99,
                            22.0,
                            1e300,
                            0.3465,
                            0.3466,
                            kInfinity,
                            -kInfinity};
  for (int i = 0; i < 15; ++i) x[7 * i] = special[i];
  Eigen::VectorXd y = x;
  TanhAll(kSize, y.data());
  for (int i = 0; i < kSize; ++i) {
    EXPECT_EQ(y[i], std::tanh(x[i])) << x[i];
    EXPECT_EQ(std::signbit(y[i]), std::signbit(x[i])) << x[i];
  }
}

TEST(TanhAllTest, KeepsNan) {
  double values[] = {1.0, std::nan(""), 2.0, 3.0, 0.5};
  TanhAll(5, values);
  EXPECT_TRUE(std::isnan(values[1]));
  EXPECT_EQ(values[2], std::tanh(2.0));
  EXPECT_EQ(values[4], std::tanh(0.5));
}

}  // namespace tanh_test
}  // namespace invgrad
