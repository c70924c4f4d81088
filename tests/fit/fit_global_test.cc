#include "invgrad/fit_global.h"

#include <cmath>
#include <limits>
#include <vector>

#include "Eigen/Dense"
#include "ceres/autodiff_cost_function.h"
#include "ceres/covariance.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/internal/qr.h"
#include "invgrad/random.h"

namespace invgrad {
namespace fit_global_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// exp(-x0 t) and exp(-x1 t)
struct TwoDecays {
  VectorXd t;

  template <typename T>
  bool operator()(const T* x, T* phi) const {
    using std::exp;
    if (x[0] > 1e3) return false;
    for (const int j : {0, 1}) {
      for (const double t_i : t) *phi++ = exp(-x[j] * t_i);
    }
    return true;
  }
};

struct Data {
  TwoDecays decays;
  MatrixXd Y;

  Data(int num_samples, int num_sides, double noise) {
    decays.t = VectorXd::LinSpaced(num_samples, 0.0, 4.0);
    NumpyRandom random(1);
    MatrixXd Phi(num_samples, 2);
    Phi << (-1.5 * decays.t.array()).exp(), (-0.3 * decays.t.array()).exp();
    Y = Phi * random.Rand(2, num_sides) +
        noise * (random.Rand(num_samples, num_sides).array() - 0.5).matrix();
  }
};

FitOptions Exact() {
  FitOptions options;
  options.max_num_iterations = 500;
  options.function_tolerance = 1e-16;
  options.parameter_tolerance = 1e-13;
  return options;
}

GlobalFit<2> Fit(const Data& data,
                 const MatrixXd& Y,
                 const Eigen::Vector2d& start = {2.0, 0.2}) {
  GlobalFit<2> fit;
  fit.nonlinear.x = start;
  FitGlobal(Exact(), data.decays, 2, Y, &fit);
  return fit;
}

// One right-hand side: all its samples, as a function of c and x.
struct Side {
  TwoDecays decays;
  VectorXd y;

  template <typename T>
  bool operator()(const T* c, const T* x, T* r) const {
    std::vector<T> phi(2 * y.size());
    if (!decays(x, phi.data())) return false;
    for (Eigen::Index i = 0; i < y.size(); ++i) {
      r[i] = c[0] * phi[i] + c[1] * phi[y.size() + i] - y[i];
    }
    return true;
  }
};

// Few and many right-hand sides: with and without the triangular factor of Y.
TEST(FitGlobal, IsTheFitOfAllParameters) {
  for (const int num_sides : {1, 3, 40}) {
    const Data data(15, num_sides, 0.1);
    const GlobalFit<2> fit = Fit(data, data.Y);
    EXPECT_TRUE(fit.nonlinear.IsConverged());
    EXPECT_EQ(fit.rank, 2);
    EXPECT_EQ(fit.nonlinear.rank, 2);
    EXPECT_EQ(fit.nonlinear.num_rows, 15 * num_sides);
    ceres::Problem problem;
    Eigen::Vector2d x(2.0, 0.2);
    MatrixXd C = MatrixXd::Zero(2, num_sides);
    for (int k = 0; k < num_sides; ++k) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Side, ceres::DYNAMIC, 2, 2>(
              new Side{data.decays, data.Y.col(k)}, 15),
          nullptr,
          C.col(k).data(),
          x.data());
    }
    ceres::Solver::Options options;
    options.max_num_iterations = 1000;
    options.function_tolerance = 1e-16;
    options.parameter_tolerance = 1e-13;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    EXPECT_NEAR(
        fit.nonlinear.cost, summary.final_cost, 1e-12 * summary.final_cost);
    // The minimum is known to the square root of rounding errors.
    EXPECT_LE((fit.nonlinear.x - x).norm(), 1e-6);
    EXPECT_LE((fit.C - C).norm(), 1e-6 * C.norm());
    // The covariance of x is that of the fit of all parameters.
    ceres::Covariance covariance({});
    const std::vector<const double*> blocks = {x.data()};
    ASSERT_TRUE(covariance.Compute(blocks, &problem));
    Eigen::Matrix2d expected;
    covariance.GetCovarianceBlock(x.data(), x.data(), expected.data());
    EXPECT_LE((fit.nonlinear.covariance - expected).norm(),
              1e-5 * expected.norm());
    EXPECT_NEAR(fit.nonlinear.residual_variance,
                2.0 * summary.final_cost / (15 * num_sides - 2 * num_sides - 2),
                1e-9);
  }
}

// Y is replaced by Y Q: the same x, and C Q.
TEST(FitGlobal, DoesNotDependOnTheOrderOfRightHandSides) {
  const Data data(15, 20, 0.1);
  const GlobalFit<2> fit = Fit(data, data.Y);
  NumpyRandom random(2);
  const MatrixXd Q = Orthonormalized(random.Rand(20, 20));
  const GlobalFit<2> rotated = Fit(data, data.Y * Q);
  EXPECT_LE((rotated.nonlinear.x - fit.nonlinear.x).norm(), 1e-7);
  EXPECT_LE((rotated.C - fit.C * Q).norm(), 1e-6);
  EXPECT_NEAR(rotated.nonlinear.cost, fit.nonlinear.cost, 1e-13);
}

TEST(FitGlobal, OfExactData) {
  const Data data(15, 30, 0.0);
  const GlobalFit<2> fit = Fit(data, data.Y);
  EXPECT_LE((fit.nonlinear.x - Eigen::Vector2d(1.5, 0.3)).norm(), 1e-9);
  EXPECT_LE(fit.nonlinear.cost, 1e-20);
}

// Equal rates: one feature twice, of which C has halves.
TEST(FitGlobal, OfDependentFeatures) {
  const Data data(15, 3, 0.1);
  GlobalFit<2> fit;
  fit.nonlinear.x << 0.5, 0.5;
  FitOptions options;
  options.max_num_iterations = 0;
  FitGlobal(options, data.decays, 2, data.Y, &fit);
  EXPECT_EQ(fit.nonlinear.status, FitStatus::kMaxIterations);
  EXPECT_EQ(fit.rank, 1);
  EXPECT_LE((fit.C.row(0) - fit.C.row(1)).norm(), 1e-13);
}

TEST(FitGlobal, OfMoreFeaturesThanSamples) {
  const Data data(1, 3, 0.1);
  const GlobalFit<2> fit = Fit(data, data.Y);
  EXPECT_TRUE(fit.nonlinear.IsConverged());
  EXPECT_LE(fit.nonlinear.cost, 1e-30);
  EXPECT_EQ(fit.nonlinear.rank, 0);
}

TEST(FitGlobal, OfAStartWithoutValue) {
  const Data data(15, 3, 0.1);
  for (const double x : {2e3, kNaN}) {
    const GlobalFit<2> fit = Fit(data, data.Y, {x, 1.0});
    EXPECT_EQ(fit.nonlinear.status, FitStatus::kInvalidStart);
    EXPECT_EQ(fit.C.cols(), 0);
  }
}

TEST(FitGlobal, OfARightHandSideThatIsNotFinite) {
  const Data data(15, 3, 0.1);
  MatrixXd Y = data.Y;
  Y(4, 1) = kNaN;
  const GlobalFit<2> fit = Fit(data, Y);
  EXPECT_EQ(fit.nonlinear.status, FitStatus::kInvalidStart);
  EXPECT_EQ(fit.nonlinear.invalid_row, 4);
  EXPECT_EQ(fit.nonlinear.invalid_parameter, -1);
}

}  // namespace fit_global_test
}  // namespace invgrad
