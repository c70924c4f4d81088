#include "invgrad/spectral/routes/tridiagonal_coefficients.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "gtest/gtest.h"
#include "tests/support/spectral_reference.h"

namespace invgrad {
namespace tridiagonal_coefficients_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

MatrixXd Dense(const VectorXd& a, const VectorXd& e) {
  MatrixXd T = a.asDiagonal();
  for (Eigen::Index i = 0; i < e.size(); ++i) T(i + 1, i) = T(i, i + 1) = e[i];
  return T;
}

// Of eigenvalues in any order.
void ExpectCoefficients(const VectorXd& a,
                        const VectorXd& e,
                        const VectorXd& h) {
  VectorXd lambda = a;
  VectorXd c = h;
  ASSERT_TRUE(TridiagonalCoefficients(e, &lambda, &c));
  const MatrixXd T = Dense(a, e);
  VectorXd sorted = lambda;
  std::sort(sorted.begin(), sorted.end());
  const SymmetricEigen reference(T);
  const double size = static_cast<double>(a.size());
  const double norm = T.norm();
  const double tolerance = 20.0 * size * kEpsilon;
  EXPECT_LE((sorted - reference.values).lpNorm<Eigen::Infinity>(),
            tolerance * norm);
  // c determines h^T p(T) h for all polynomials p, and is determined by them up
  // to signs: c^T lambda^k c = h^T T^k h.
  VectorXd power_c = c;
  VectorXd power_h = h;
  for (int k = 0; k < 6; ++k) {
    EXPECT_NEAR(c.dot(power_c),
                h.dot(power_h),
                (k + 1) * tolerance * h.squaredNorm() * std::pow(norm, k));
    power_c = lambda.cwiseProduct(power_c);
    power_h = T * power_h;
  }
}

TEST(TridiagonalCoefficients, OfRandomMatrices) {
  RandomMatrices random(5);
  for (const int m : {2, 3, 10, 65, 200}) {
    SCOPED_TRACE(m);
    ExpectCoefficients(
        random.Vector(m), random.Vector(m - 1), random.Vector(m));
  }
}

TEST(TridiagonalCoefficients, AgreeWithEigenvectors) {
  RandomMatrices random(6);
  const int m = 40;
  const VectorXd a = VectorXd::LinSpaced(m, 1.0, 40.0);  // no close eigenvalues
  const VectorXd e = 0.1 * random.Vector(m - 1);
  const VectorXd h = random.Vector(m);
  VectorXd lambda = a;
  VectorXd c = h;
  ASSERT_TRUE(TridiagonalCoefficients(e, &lambda, &c));
  const SymmetricEigen reference(Dense(a, e));
  const VectorXd expected = reference.U.transpose() * h;
  for (int i = 0; i < m; ++i) {
    Eigen::Index nearest = 0;
    (reference.values.array() - lambda[i]).abs().minCoeff(&nearest);
    EXPECT_NEAR(std::abs(c[i]), std::abs(expected[nearest]), 1e-12);
  }
}

TEST(TridiagonalCoefficients, OfMatricesThatAreSplitOrGraded) {
  RandomMatrices random(7);
  VectorXd lambda = VectorXd::Constant(1, 3.0);
  VectorXd c = VectorXd::Constant(1, -2.0);
  EXPECT_TRUE(TridiagonalCoefficients(VectorXd(), &lambda, &c));
  EXPECT_EQ(lambda[0], 3.0);
  EXPECT_EQ(c[0], -2.0);
  ExpectCoefficients(VectorXd::Zero(9), VectorXd::Zero(8), random.Vector(9));
  VectorXd e = random.Vector(29);
  e[7] = e[8] = e[28] = 0.0;
  ExpectCoefficients(random.Vector(30), e, random.Vector(30));
  const VectorXd s = LogUniform(80, 1e-20);
  ExpectCoefficients(s, 0.3 * s.tail(79), random.Vector(80));
  ExpectCoefficients(
      s.reverse(), 0.3 * s.head(79).reverse(), random.Vector(80));
}

TEST(TridiagonalCoefficients, NaNDoesNotConverge) {
  VectorXd lambda = VectorXd::Ones(5);
  lambda[2] = std::nan("");
  VectorXd c = VectorXd::Ones(5);
  EXPECT_FALSE(TridiagonalCoefficients(VectorXd::Ones(4), &lambda, &c));
}

}  // namespace tridiagonal_coefficients_test
}  // namespace invgrad
