// What a fit says of its end: of a start without a value, of an end that is no
// minimum, and of parameters that coincide.
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/fit.h"

namespace invgrad {
namespace fit_end_test {

using Eigen::Vector2d;

// r = log(1 - x_1 t) + x_0, with a value for x_1 t < 1 only.
struct LogOfRest {
  template <typename T>
  bool operator()(int /*k*/, int i, const T* x, T* residual) const {
    using std::log;
    *residual = log(1.0 - x[1] * (0.1 * i)) + x[0];
    return true;
  }
};

TEST(FitEnd, AnInvalidStartIsNamedByRowAndParameter) {
  std::vector<FitResult<2>> fits(2);
  fits[0].x << 1.0, 4.0;
  fits[1].x << 1.0, 0.5;
  FitMany(FitOptions(), LogOfRest(), {6, 6}, &fits);
  EXPECT_EQ(fits[0].status, FitStatus::kInvalidStart);
  EXPECT_EQ(fits[0].invalid_row, 3);  // 1 - 4 * 0.3 < 0
  EXPECT_EQ(fits[0].invalid_parameter, 1);
  EXPECT_EQ(fits[0].valid_value, 2.0);
  EXPECT_EQ(fits[0].StatusText(),
            "failed: residuals or Jacobian are not finite at the start: row 3, "
            "parameter 1 = 4 (valid at 2)");
  EXPECT_EQ(fits[1].invalid_row, -1);
  EXPECT_EQ(fits[1].StatusText(), FitStatusText(fits[1].status));
}

// y = a exp(b t)
struct Exponential {
  const std::vector<double>* t;
  const std::vector<double>* y;
  Eigen::Vector2d units = Eigen::Vector2d::Ones();

  template <typename T>
  bool operator()(int /*k*/, int i, const T* x, T* residual) const {
    using std::exp;
    *residual = units[0] * x[0] * exp(units[1] * x[1] * (*t)[i]) - (*y)[i];
    return true;
  }
};

FitResult<2> FitExponential(const std::vector<double>& t,
                            const std::vector<double>& y,
                            const Vector2d& units = Vector2d::Ones()) {
  std::vector<FitResult<2>> fits(1);
  fits[0].x = units.cwiseInverse();  // from (1, 1)
  FitMany(FitOptions(),
          Exponential{&t, &y, units},
          {static_cast<int>(t.size())},
          &fits);
  return fits[0];
}

// Ceres' tolerances are met at (2998, -16), and at (2e-8, 0.99).
TEST(FitEnd, ToleranceFarFromAMinimumDoesNotEndTheFit) {
  const Vector2d truths[] = {{3000.0, 0.1}, {1.0, -1.0}, {2e5, 0.1}};
  for (const Vector2d& truth : truths) {
    std::vector<double> t;
    std::vector<double> y;
    for (int i = 0; i <= 10; ++i) {
      t.push_back(i);
      y.push_back(truth[0] * std::exp(truth[1] * i));
    }
    const FitResult<2> fit = FitExponential(t, y);
    EXPECT_TRUE(fit.IsConverged()) << fit.StatusText();
    EXPECT_LE((fit.x - truth).cwiseQuotient(truth).norm(), 1e-5)
        << fit.x.transpose();
    EXPECT_EQ(fit.predicted_decrease, 0.0);
  }
}

// In units in which the gradient at the start, 4e-18, is below Ceres' tolerance.
TEST(FitEnd, ResidualsOfASmallUnitAreFitted) {
  constexpr double kUnit = 2e-9;
  std::vector<double> t;
  std::vector<double> y;
  for (int i = 0; i < 10; ++i) {
    t.push_back(i);
    y.push_back(kUnit * std::exp(-0.3 * i));
  }
  std::vector<FitResult<2>> fits(1);
  fits[0].x << -20.2, -0.2;
  FitMany(
      FitOptions(),
      [&](int, int i, const auto* x, auto* residual) {
        using std::exp;
        *residual = exp(x[0] + x[1] * t[i]) - y[i];
        return true;
      },
      {10},
      &fits);
  EXPECT_TRUE(fits[0].IsConverged()) << fits[0].StatusText();
  EXPECT_NEAR(fits[0].x[0], std::log(kUnit), 1e-6);
  EXPECT_NEAR(fits[0].x[1], -0.3, 1e-6);
}

// Where 50 iterations do not suffice, the fit says so.
TEST(FitEnd, AnEndThatIsNoMinimumIsNotConverged) {
  std::vector<double> t;
  std::vector<double> y;
  for (int i = 0; i < 7; ++i) {
    t.push_back(10.0 * i);
    y.push_back(100.0 * std::exp(-0.5 * i));
  }
  const FitResult<2> fit = FitExponential(t, y);
  EXPECT_GT(fit.cost, 7e3);
  EXPECT_FALSE(fit.IsConverged());
  EXPECT_NEAR(fit.predicted_decrease, 0.0043, 0.001);
  EXPECT_NE(
      fit.StatusText().find("; no minimum: the linear model predicts that "
                            "the cost falls by 0.43 %"),
      std::string::npos)
      << fit.StatusText();
  EXPECT_EQ(fit.StatusText().find("not converged"), 0u) << fit.StatusText();
}

// y = a_1 exp(-b_1 t) + a_2 exp(-b_2 t)
struct TwoDecays {
  template <typename T>
  bool operator()(int /*k*/, int i, const T* x, T* residual) const {
    using std::exp;
    const double t = 0.2 * i;
    *residual = x[0] * exp(-x[1] * t) + x[2] * exp(-x[3] * t) -
                (2.0 * std::exp(-0.5 * t) + std::exp(-3.0 * t));
    return true;
  }
};

TEST(FitEnd, EqualRatesAreNamed) {
  std::vector<FitResult<4>> fits(2);
  fits[0].x << 1.0, 1.0, 1.0, 1.0;
  fits[1].x << 1.0, 1.0, 1.0, 2.0;
  FitOptions options;
  FitMany(options, TwoDecays(), {30, 30}, &fits);
  EXPECT_EQ(fits[1].rank, 4);
  EXPECT_EQ(fits[1].equal_parameter, -1);
  EXPECT_LE(fits[1].cost, 1e-10);
  // Rounding errors part equal rates at last.
  fits[0].x.setOnes();
  options.max_num_iterations = 0;
  FitMany(options, TwoDecays(), {30, 0}, &fits);
  EXPECT_EQ(fits[0].rank, 2);
  EXPECT_EQ(fits[0].equal_to, 0);
  EXPECT_EQ(fits[0].equal_parameter, 2);
  EXPECT_NE(fits[0].StatusText().find("coincide at"), std::string::npos)
      << fits[0].StatusText();
}

// x_0 + t (x_1 + t (x_2 + t x_3)), with t in seconds of a day.
struct Cubic {
  template <typename T>
  bool operator()(int i, const T* x, T* residual) const {
    const double t = 864.0 * i;
    *residual = x[0] + t * (x[1] + t * (x[2] + t * x[3])) - 1.0;
    return true;
  }
};

TEST(FitEnd, AZeroDoesNotMakeAParameterUndetermined) {
  FitOptions options;
  options.max_num_iterations = 0;
  for (const double x_1 : {0.0, 1e-5}) {
    FitResult<4> fit;
    fit.x << 0.0, x_1, 0.0, 0.0;
    FitStreaming(options, 100, Cubic(), &fit);
    EXPECT_EQ(fit.rank, 4);
    EXPECT_EQ(fit.undetermined.maxCoeff(), 0.0);
  }
}

// A cost that no step lowers by much, and no derivative away from the start.
struct NoDerivative {
  template <typename T>
  bool operator()(int i, const T* x, T* residual) const {
    *residual = 1e3 * (x[0] - 1.0) + (i % 2 == 0 ? 10.0 : -10.0);
    if (x[0] != start && i == 3) {
      residual->v[0] = std::numeric_limits<double>::quiet_NaN();
    }
    return true;
  }
  double start;
};

// The tolerance for the cost is met, but there is no minimum.
TEST(FitEnd, AJacobianThatIsNotFiniteEndsTheFitAfterATolerance) {
  FitOptions options;
  for (const double radius : {1e-5, 1e-6}) {
    options.initial_trust_region_radius = radius;
    FitResult<1> fit;
    fit.x << 1.01;
    FitStreaming(options, 10, NoDerivative{1.01}, &fit);
    EXPECT_EQ(fit.status, FitStatus::kInvalidJacobian) << fit.StatusText();
    EXPECT_EQ(fit.num_iterations, 1);
    EXPECT_EQ(fit.x[0], 1.01);
  }
}

}  // namespace fit_end_test
}  // namespace invgrad
