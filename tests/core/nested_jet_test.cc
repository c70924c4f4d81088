#include "invgrad/internal/nested_jet.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "Eigen/Core"
#include "ceres/rotation.h"
#include "gtest/gtest.h"

namespace invgrad {
namespace nested_jet_test {

// A few roundings of numbers of the size of the result.
constexpr double kEpsilon = 1e-14;

using Jet1 = NestedJet<1>;
using Jet2 = NestedJet<2>;

// Value, first and second derivative of a function of one variable.
struct Expected {
  double f, df, d2f;
};

void ExpectDerivatives(const std::function<Jet1(const Jet1&)>& f,
                       double x,
                       const Expected& expected) {
  const Jet1 y = f(MakeHessianJet<1>(x, 0));
  const auto tolerance = [](double value) {
    return kEpsilon * std::max(1.0, std::abs(value));
  };
  EXPECT_NEAR(y.a.a, expected.f, tolerance(expected.f));
  EXPECT_NEAR(y.v[0].a, expected.df, tolerance(expected.df));
  EXPECT_NEAR(y.a.v[0], expected.df, tolerance(expected.df));
  EXPECT_NEAR(y.v[0].v[0], expected.d2f, tolerance(expected.d2f));
}

TEST(NestedJet, PlainNumbersMeetJets) {
  const double x = 0.7;
  const Expected doubled = {1.4, 2.0, 0.0};
  ExpectDerivatives([](auto x) { return Jet1(2.0) * x; }, x, doubled);
  ExpectDerivatives([](auto x) { return Jet1(2) * x; }, x, doubled);
  ExpectDerivatives([](auto x) { return 2.0 * x; }, x, doubled);
  ExpectDerivatives([](auto x) { return x * 2.0; }, x, doubled);
  ExpectDerivatives([](auto x) { return 2 * x; }, x, doubled);
  ExpectDerivatives([](auto x) { return x * 2; }, x, doubled);
  ExpectDerivatives([](auto x) { return 2.0f * x; }, x, doubled);
  ExpectDerivatives([](auto x) { return x / 0.5; }, x, doubled);
  ExpectDerivatives([](auto x) { return x * x / 3.0; },
                    x,
                    {x * x / 3.0, 2.0 * x / 3.0, 2.0 / 3.0});
  ExpectDerivatives([](auto x) { return 1 - x + 3 - x * x - 2.0; },
                    x,
                    {2.0 - x - x * x, -1.0 - 2.0 * x, -2.0});
  ExpectDerivatives([](auto x) { return 1.0 / x; },
                    x,
                    {1.0 / x, -1.0 / (x * x), 2.0 / (x * x * x)});
  ExpectDerivatives([](auto x) { return -(+x); }, x, {-x, -1.0, 0.0});
}

TEST(NestedJet, CompoundAssignment) {
  const auto f = [](const Jet1& x) {
    Jet1 y = x;
    y *= x;
    y *= 3.0;
    y += 1.0;
    y -= x;
    y /= 2.0;
    y += 1;
    y -= 0.5;
    y *= 2;
    return y;
  };
  // 3 x^2 - x + 2
  const double x = -0.3;
  ExpectDerivatives(f, x, {3.0 * x * x - x + 2.0, 6.0 * x - 1.0, 6.0});
}

TEST(NestedJet, ElementaryFunctions) {
  const double x = 0.6;
  const double s = std::sin(x);
  const double c = std::cos(x);
  ExpectDerivatives([](auto x) { return sin(x); }, x, {s, c, -s});
  ExpectDerivatives([](auto x) { return cos(x); }, x, {c, -s, -c});
  const double t = std::tan(x);
  ExpectDerivatives([](auto x) { return tan(x); },
                    x,
                    {t, 1.0 + t * t, 2.0 * t * (1.0 + t * t)});
  const double e = std::exp(x);
  ExpectDerivatives([](auto x) { return exp(x); }, x, {e, e, e});
  ExpectDerivatives([](auto x) { return expm1(x); }, x, {std::expm1(x), e, e});
  ExpectDerivatives(
      [](auto x) { return log(x); }, x, {std::log(x), 1 / x, -1 / (x * x)});
  ExpectDerivatives([](auto x) { return log1p(x); },
                    x,
                    {std::log1p(x), 1 / (1 + x), -1 / ((1 + x) * (1 + x))});
  const double r = std::sqrt(x);
  ExpectDerivatives(
      [](auto x) { return sqrt(x); }, x, {r, 0.5 / r, -0.25 / (r * x)});
  const double th = std::tanh(x);
  ExpectDerivatives([](auto x) { return tanh(x); },
                    x,
                    {th, 1.0 - th * th, -2.0 * th * (1.0 - th * th)});
  const double gauss = 2.0 / std::sqrt(M_PI) * std::exp(-x * x);
  ExpectDerivatives(
      [](auto x) { return erf(x); }, x, {std::erf(x), gauss, -2.0 * x * gauss});
  ExpectDerivatives([](auto x) { return atan(x); },
                    x,
                    {std::atan(x),
                     1.0 / (1.0 + x * x),
                     -2.0 * x / ((1.0 + x * x) * (1.0 + x * x))});
  const double q = std::sqrt(1.0 - x * x);
  ExpectDerivatives([](auto x) { return asin(x); },
                    x,
                    {std::asin(x), 1 / q, x / (q * q * q)});
  ExpectDerivatives([](auto x) { return acos(x); },
                    x,
                    {std::acos(x), -1 / q, -x / (q * q * q)});
  ExpectDerivatives([](auto x) { return sinh(x); },
                    x,
                    {std::sinh(x), std::cosh(x), std::sinh(x)});
  ExpectDerivatives([](auto x) { return cosh(x); },
                    x,
                    {std::cosh(x), std::sinh(x), std::cosh(x)});
}

TEST(NestedJet, Powers) {
  const double x = 1.7;
  ExpectDerivatives(
      [](auto x) { return pow(x, 2.5); },
      x,
      {std::pow(x, 2.5), 2.5 * std::pow(x, 1.5), 3.75 * std::pow(x, 0.5)});
  ExpectDerivatives(
      [](auto x) { return pow(x, 3); }, x, {x * x * x, 3 * x * x, 6 * x});
  const double p = std::pow(2.0, x);
  const double log2 = std::log(2.0);
  ExpectDerivatives(
      [](auto x) { return pow(2.0, x); }, x, {p, log2 * p, log2 * log2 * p});
  const double xx = std::pow(x, x);
  const double l = 1.0 + std::log(x);
  ExpectDerivatives([](auto x) { return pow(x, x); },
                    x,
                    {xx, xx * l, xx * (l * l + 1.0 / x)});
  // At zero and below, where logarithms would be NaN.
  ExpectDerivatives([](auto x) { return pow(x, 2.0); }, 0.0, {0.0, 0.0, 2.0});
  ExpectDerivatives([](auto x) { return pow(x, 2); }, 0.0, {0.0, 0.0, 2.0});
  ExpectDerivatives([](auto x) { return pow(x, 3.0); }, -2.0, {-8, 12, -12});
}

TEST(NestedJet, Comparisons) {
  const Jet1 x = MakeHessianJet<1>(1.5, 0);
  const Jet1 y(2.0);
  EXPECT_TRUE(x < y);
  EXPECT_TRUE(x <= y);
  EXPECT_FALSE(x > y);
  EXPECT_FALSE(x >= y);
  EXPECT_FALSE(x == y);
  EXPECT_TRUE(x != y);
  EXPECT_TRUE(x < 2.0);
  EXPECT_TRUE(1.0 < x);
  EXPECT_TRUE(x > 1);
  EXPECT_TRUE(2 >= x);
  EXPECT_TRUE(x == 1.5);
  EXPECT_TRUE(x.a < y.a);
  EXPECT_TRUE(x.a < 2.0);
  EXPECT_TRUE(x.a < 2);
}

TEST(NestedJet, BranchesAndExtrema) {
  const auto relu = [](const Jet1& x) { return x > 0.0 ? x * x : Jet1(0.0); };
  ExpectDerivatives(relu, 2.0, {4.0, 4.0, 2.0});
  ExpectDerivatives(relu, -2.0, {0.0, 0.0, 0.0});
  const auto max = [](const Jet1& x) { return std::max(x * x, Jet1(1.0)); };
  ExpectDerivatives(max, 2.0, {4.0, 4.0, 2.0});
  ExpectDerivatives(max, 0.5, {1.0, 0.0, 0.0});
  ExpectDerivatives([](auto x) { return abs(x * x * x); }, -2.0, {8, -12, 12});
  ExpectDerivatives(
      [](auto x) { return fmax(x * x, Jet1(1.0)); }, 2.0, {4.0, 4.0, 2.0});
  ExpectDerivatives(
      [](auto x) { return fmin(x * x, Jet1(1.0)); }, 2.0, {1.0, 0.0, 0.0});
}

TEST(NestedJet, Finiteness) {
  const Jet1 x = MakeHessianJet<1>(0.0, 0);
  EXPECT_TRUE(isfinite(x));
  EXPECT_FALSE(isfinite(1.0 / x));
  EXPECT_TRUE(isnan(x / x));
  EXPECT_TRUE(std::isinf(std::numeric_limits<InnerJet<2>>::infinity().a));
}

// f = atan2(x, y) sqrt(x y): the mixed derivative too.
TEST(NestedJet, TwoVariables) {
  const double a = 0.8;
  const double b = 1.9;
  const Jet2 x = MakeHessianJet<2>(a, 0);
  const Jet2 y = MakeHessianJet<2>(b, 1);
  const Jet2 angle = atan2(x, y);
  const double r2 = a * a + b * b;
  EXPECT_NEAR(angle.v[0].a, b / r2, kEpsilon);
  EXPECT_NEAR(angle.v[1].a, -a / r2, kEpsilon);
  EXPECT_NEAR(angle.v[0].v[0], -2 * a * b / (r2 * r2), kEpsilon);
  EXPECT_NEAR(angle.v[1].v[1], 2 * a * b / (r2 * r2), kEpsilon);
  EXPECT_NEAR(angle.v[0].v[1], (a * a - b * b) / (r2 * r2), kEpsilon);
  EXPECT_NEAR(angle.v[1].v[0], (a * a - b * b) / (r2 * r2), kEpsilon);

  const Jet2 root = sqrt(x * y);
  EXPECT_NEAR(root.v[0].v[1], 0.25 / std::sqrt(a * b), kEpsilon);
  const Jet2 length = hypot(x, y);
  EXPECT_NEAR(length.v[0].v[1], -a * b / std::pow(r2, 1.5), kEpsilon);
}

// Functors written with Eigen: d2/dx2 of 1/2 x^T A x + 3 b.x is A.
TEST(NestedJet, EigenExpressions) {
  using Vector = Eigen::Matrix<Jet2, 2, 1>;
  const Vector x(MakeHessianJet<2>(0.3, 0), MakeHessianJet<2>(-1.2, 1));
  Eigen::Matrix2d A;
  A << 4.0, 1.0, 1.0, 3.0;
  const Eigen::Vector2d b(1.0, -2.0);
  const Jet2 f = 0.5 * x.dot(A.cast<Jet2>() * x) + 3.0 * b.cast<Jet2>().dot(x);
  const Eigen::Vector2d gradient = A * Eigen::Vector2d(0.3, -1.2) + 3.0 * b;
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(f.v[i].a, gradient[i], kEpsilon * 10.0);
    for (int j = 0; j < 2; ++j) {
      EXPECT_NEAR(f.v[i].v[j], A(i, j), kEpsilon * 10.0);
    }
  }
  // |2 x|^2 / |x|^2 = 4, whatever x.
  const Vector twice = 2.0 * x;
  const Jet2 four = twice.squaredNorm() / x.squaredNorm();
  EXPECT_NEAR(four.a.a, 4.0, kEpsilon);
  EXPECT_NEAR(four.v[0].v[1], 0.0, 10.0 * kEpsilon);
  const Jet2 norm = (x / 2.0).norm();
  EXPECT_NEAR(norm.a.a, 0.5 * std::hypot(0.3, 1.2), kEpsilon);
}

// A functor that Ceres users have: rotating keeps the length, so the Hessian
// of |R(w) p|^2 in the angle-axis vector w is zero.
TEST(NestedJet, RotationFunctor) {
  using Jet3 = NestedJet<3>;
  const Jet3 angle_axis[3] = {MakeHessianJet<3>(0.3, 0),
                              MakeHessianJet<3>(-0.5, 1),
                              MakeHessianJet<3>(0.9, 2)};
  const Jet3 point[3] = {Jet3(1.0), Jet3(2.0), Jet3(-0.5)};
  Jet3 rotated[3];
  ceres::AngleAxisRotatePoint(angle_axis, point, rotated);
  const Jet3 squared_length = ceres::DotProduct(rotated, rotated);
  EXPECT_NEAR(squared_length.a.a, 5.25, kEpsilon * 10.0);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      EXPECT_NEAR(squared_length.v[i].v[j], 0.0, 100.0 * kEpsilon);
    }
  }
  // And it does turn.
  EXPECT_GT(std::abs(rotated[0].v[2].v[2]), 0.1);
}

}  // namespace nested_jet_test
}  // namespace invgrad
