#include "invgrad/spectral/routes/householder.h"

#include <cmath>
#include <limits>

#include "Eigen/Core"
#include "gtest/gtest.h"

namespace invgrad {
namespace householder_test {

using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// sin(1), sin(2), ...
VectorXd Wave(int n) { return VectorXd::LinSpaced(n, 1, n).array().sin(); }

TEST(MakeReflector, ClearsAllButTheFirst) {
  for (const double sign : {1.0, -1.0}) {
    for (int n = 1; n <= 13; ++n) {
      const VectorXd x = sign * Wave(n);
      VectorXd u = x;
      double tau;
      const double beta = MakeReflector(n, u.data(), &tau);
      EXPECT_EQ(u[0], 1.0);
      // A few roundings in each of the n terms of the norm.
      const double tolerance = 4.0 * n * kEpsilon;
      EXPECT_NEAR(std::abs(beta), x.norm(), tolerance * x.norm());
      // Orthogonal: tau = 2 / |u|^2, or H = I.
      EXPECT_NEAR(tau * u.squaredNorm(), tau == 0.0 ? 0.0 : 2.0, tolerance);
      VectorXd y = x;
      ApplyReflector(n, u.data(), tau, y.data());
      EXPECT_LE((y - beta * VectorXd::Unit(n, 0)).norm(), tolerance * x.norm());
    }
  }
}

TEST(MakeReflector, IsTheIdentityIfNothingIsToBeCleared) {
  VectorXd x = 3.0 * VectorXd::Unit(5, 0);
  // Its square is subnormal, with few digits.
  x[2] = 1e-160;
  double tau = 7.0;
  EXPECT_EQ(MakeReflector(5, x.data(), &tau), 3.0);
  EXPECT_EQ(tau, 0.0);
  EXPECT_EQ(x, VectorXd::Unit(5, 0));
}

TEST(MakeReflector, KeepsNan) {
  VectorXd x = Wave(6);
  x[4] = std::numeric_limits<double>::quiet_NaN();
  double tau;
  EXPECT_TRUE(std::isnan(MakeReflector(6, x.data(), &tau)));
}

}  // namespace householder_test
}  // namespace invgrad
