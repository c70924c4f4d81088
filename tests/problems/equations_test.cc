// Points, and problems that are differential equations.
#include <cmath>
#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "problems/equations/burgers.h"
#include "problems/equations/korteweg_de_vries.h"
#include "problems/equations/periodic_evolution.h"
#include "problems/equations/points.h"
#include "problems/problems.h"

namespace invgrad {
namespace equations_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

TEST(GaussRule, IntegratesPolynomialsExactly) {
  for (const int count : {1, 2, 5, 64}) {
    const QuadraturePoints rule = GaussRule(count);
    EXPECT_GT(rule.weights.minCoeff(), 0.0);
    for (const int degree : {0, 1, 2 * count - 1}) {
      const double integral =
          rule.points.row(0).array().pow(degree).matrix().dot(rule.weights);
      EXPECT_NEAR(integral, 1.0 / (degree + 1), 1e-14) << count;
    }
  }
}

const Box kBox = {Vector2d(0.0, -1.0), Vector2d(2.0, 1.0)};

TEST(Points, LieInTheBoxAndIntegrate) {
  // The mean of t x^2 is 1/3.
  for (const QuadraturePoints& points :
       {GaussPoints(kBox, {2, 3}), SequencePoints(kBox, 4096, 0)}) {
    EXPECT_NEAR(points.weights.sum(), 1.0, 1e-13);
    const auto t = points.points.row(0).array();
    const auto x = points.points.row(1).array();
    EXPECT_TRUE((t > 0.0).all() && (t < 2.0).all());
    EXPECT_TRUE((x > -1.0).all() && (x < 1.0).all());
    const double mean = (t * x.square()).matrix().dot(points.weights);
    // Of random points the error would be 7e-3.
    EXPECT_NEAR(mean, 1.0 / 3.0, points.weights.size() > 6 ? 1e-3 : 1e-14);
  }
}

TEST(SequencePoints, ContinuesTheSequence) {
  const MatrixXd all = SequencePoints(kBox, 10, 0).points;
  EXPECT_EQ(SequencePoints(kBox, 4, 6).points, MatrixXd(all.rightCols(4)));
}

TEST(GridPoints, HasTheCorners) {
  const MatrixXd grid = GridPoints(kBox, {2, 3});
  MatrixXd expected(2, 6);
  expected << 0, 0, 0, 2, 2, 2, -1, 0, 1, -1, 0, 1;
  EXPECT_EQ(grid, expected);
}

class BurgersTest : public testing::TestWithParam<double> {};

// Differences of the closed form satisfy the equation and its conditions.
TEST_P(BurgersTest, SolutionSatisfiesTheEquation) {
  const double nu = GetParam();
  const auto u = [nu](double t, double x) {
    return BurgersPinn::Solution(nu, t, x);
  };
  for (const double x : {0.1, 0.35, 0.8}) {
    EXPECT_NEAR(u(1e-12, x), -std::sin(M_PI * x), 1e-10);
    // Odd.
    EXPECT_NEAR(u(0.7, -x), -u(0.7, x), 1e-13);
    for (const double t : {0.1, 0.4, 1.0}) {
      EXPECT_NEAR(u(t, 0.0), 0.0, 1e-13);
      EXPECT_NEAR(u(t, 1.0), 0.0, 1e-13);
      constexpr double h = 1e-3;
      const double u_t = (8 * (u(t + h, x) - u(t - h, x)) -
                          (u(t + 2 * h, x) - u(t - 2 * h, x))) /
                         (12 * h);
      const double u_x = (8 * (u(t, x + h) - u(t, x - h)) -
                          (u(t, x + 2 * h) - u(t, x - 2 * h))) /
                         (12 * h);
      const double u_xx = (16 * (u(t, x + h) + u(t, x - h)) -
                           (u(t, x + 2 * h) + u(t, x - 2 * h)) - 30 * u(t, x)) /
                          (12 * h * h);
      // h^4 / 30 times fifth derivatives of some 1e6, as of a front.
      EXPECT_NEAR(u_t + u(t, x) * u_x - nu * u_xx, 0.0, 1e-7)
          << nu << " at " << t << ", " << x;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Viscosities,
                         BurgersTest,
                         testing::Values(0.1, 0.01, 0.01 / M_PI));

// Basdevant et al. Spectral and finite difference solutions of the Burgers
// equation. Computers & Fluids 14 (1986), table 1: the largest slope of the
// front is 152.00516 at pi t = 1.6037.
TEST(Burgers, TheFrontIsThatOfTheLiterature) {
  constexpr double h = 1e-6;
  const double t = 1.6037 / M_PI;
  const double slope = -BurgersPinn::Solution(0.01 / M_PI, t, h) / h;
  EXPECT_NEAR(slope, 152.00516, 1e-3);
}

TEST(GaussTimesPeriodic, IntegratesWaves) {
  const QuadraturePoints points =
      GaussTimesPeriodic({Vector2d(0.0, -1.0), Vector2d(1.0, 1.0)}, 3, 8);
  const auto t = points.points.row(0).array();
  const auto x = points.points.row(1).array();
  EXPECT_NEAR(points.weights.sum(), 1.0, 1e-14);
  EXPECT_NEAR(
      (t * (3.0 * M_PI * x).cos().square()).matrix().dot(points.weights),
      0.25,
      1e-14);
}

MatrixXd SomePoints() {
  MatrixXd points(2, 6);
  points << 1.0, 0.0, 0.3, 0.3, 0.7, 0.05,  //
      0.2, -0.4, 0.9, -1.0, 0.5, 0.0;
  return points;
}

// The exact wave of u_t = nu u_xx, and Burgers' closed form.
TEST(PeriodicEvolution, IsTheClosedForm) {
  PeriodicEvolution heat;
  heat.linear = [](double k) { return -0.1 * k * k; };
  heat.nonlinear = [](double) { return 0.0; };
  heat.num_cells = 16;
  heat.time_step = 0.2;
  const auto sine = [](double x) { return -std::sin(M_PI * x); };
  const MatrixXd points = SomePoints();
  const VectorXd u = heat.Solve(sine, points);
  for (int s = 0; s < points.cols(); ++s) {
    EXPECT_NEAR(
        u[s],
        std::exp(-0.1 * M_PI * M_PI * points(0, s)) * sine(points(1, s)),
        1e-14);
  }
  PeriodicEvolution burgers = heat;
  burgers.linear = [](double k) { return -0.02 * k * k; };
  burgers.nonlinear = [](double v) { return -0.5 * v * v; };
  burgers.has_derivative = true;
  burgers.num_cells = 512;
  burgers.time_step = 1e-3;
  const VectorXd v = burgers.Solve(sine, points);
  for (int s = 0; s < points.cols(); ++s) {
    EXPECT_NEAR(
        v[s], BurgersPinn::Solution(0.02, points(0, s), points(1, s)), 1e-10);
  }
}

// Where the linear part turns fast modes quickly, as of Korteweg-de Vries at
// these steps, the order is three.
TEST(PeriodicEvolution, ConvergesWithOrderFour) {
  PeriodicEvolution burgers;
  burgers.linear = [](double k) { return -0.1 * k * k; };
  burgers.nonlinear = [](double u) { return -0.5 * u * u; };
  burgers.has_derivative = true;
  burgers.num_cells = 64;
  const double exact = BurgersPinn::Solution(0.1, 0.4, 0.3);
  const auto error = [&](double h) {
    burgers.time_step = h;
    return burgers.Solve([](double x) { return -std::sin(M_PI * x); },
                         Vector2d(0.4, 0.3))[0] -
           exact;
  };
  EXPECT_NEAR(std::log2(error(0.04) / error(0.02)), 4.0, 0.3);
}

// Half the step and twice the cells change nothing in the ninth digit.
TEST(KortewegDeVries, ReferenceIsFarBelowThePublishedErrors) {
  PeriodicEvolution evolution = KortewegDeVriesPinn::Evolution(4.84e-4);
  const auto cosine = [](double x) { return std::cos(M_PI * x); };
  const VectorXd u = evolution.Solve(cosine, SomePoints());
  evolution.num_cells *= 2;
  evolution.time_step *= 0.5;
  EXPECT_LT((evolution.Solve(cosine, SomePoints()) - u).cwiseAbs().maxCoeff(),
            2e-9);
}

TEST(Burgers, NamesPointsOutsideTheBox) {
  PhysicsProblem problem;
  std::string error;
  MatrixXd data(2, 3);
  data << 0.1, 0.2, 1.0, 0.3, -0.4, 1.0;
  EXPECT_FALSE(CreateProblem("burgers_pinn", &data, &problem, &error));
  EXPECT_NE(error.find("data: row 1, column 1 is -0.4; the equation holds in "
                       "[0, 1]"),
            std::string::npos)
      << error;
  data << 0.1, 0.2, 1.0, 0.3, 0.4, 0.0;
  EXPECT_FALSE(CreateProblem("burgers_pinn", &data, &problem, &error));
  EXPECT_NE(error.find("row 1, column 2 is 0; a weight is positive"),
            std::string::npos)
      << error;
}

}  // namespace equations_test
}  // namespace invgrad
