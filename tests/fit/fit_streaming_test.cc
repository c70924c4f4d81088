#include <cmath>
#include <limits>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/fit.h"
#include "tests/fit/decay.h"
#include "tests/support/least_squares.h"

namespace invgrad {
namespace fit_streaming_test {

using Eigen::Vector3d;

FitResult<3> FitDecay(const DecayData& data, const FitOptions& options) {
  FitResult<3> fit;
  fit.x << 1.0, 1.0, 0.0;
  FitStreaming(options, data.num_rows(), DecayRow{&data}, &fit);
  return fit;
}

DecayData Decay(int num_rows) {
  NumpyRandom random(5);
  return DecayData(num_rows, &random);
}

TEST(FitStreaming, AsCeresAndAsFitMany) {
  FitOptions options;
  options.function_tolerance = 1e-12;
  for (const int m : {20, 300, 5000}) {
    SCOPED_TRACE(m);
    const std::vector<DecayData> data = {Decay(m)};
    const FitResult<3> fit = FitDecay(data[0], options);
    EXPECT_TRUE(fit.IsConverged()) << FitStatusText(fit.status);
    EXPECT_EQ(fit.rank, 3);
    EXPECT_EQ(fit.num_rows, m);
    EXPECT_NEAR(fit.residual_variance, 2.0 * fit.cost / (m - 3), 1e-16);
    ExpectAsCeres(data[0],
                  {1.0, 1.0, 0.0},
                  options,
                  fit.x,
                  fit.covariance,
                  fit.cost,
                  fit.num_iterations);
    std::vector<FitResult<3>> many(1);
    many[0].x << 1.0, 1.0, 0.0;
    FitMany(options, DecayRows{&data}, {m}, &many);
    EXPECT_LE((many[0].x - fit.x).norm(), 1e-10);
    EXPECT_LE((many[0].covariance - fit.covariance).norm(),
              1e-9 * fit.covariance.norm());
  }
}

TEST(FitStreaming, SameBitsForEveryNumberOfThreads) {
  for (const int m : {50, 3001}) {
    const DecayData data = Decay(m);
    const FitResult<3> one = FitDecay(data, FitOptions());
    for (const int num_threads : {2, 3, 100}) {
      FitOptions options;
      options.num_threads = num_threads;
      const FitResult<3> other = FitDecay(data, options);
      EXPECT_EQ(other.x, one.x);
      EXPECT_EQ(other.cost, one.cost);
      EXPECT_EQ(other.covariance, one.covariance);
      EXPECT_EQ(other.num_iterations, one.num_iterations);
    }
  }
}

// A polynomial with ten coefficients at t in [-1, 1]: y_i = (-1)^i.
constexpr int kCoefficients = 10;
constexpr int kRows = 20000;

double Time(int i) { return -1.0 + 2.0 * i / (kRows - 1); }

struct Polynomial {
  template <typename T>
  bool operator()(int i, const T* x, T* residual) const {
    T sum(i % 2 == 0 ? -1.0 : 1.0);
    double power = 1.0;
    for (int j = 0; j < kCoefficients; ++j) {
      sum += x[j] * power;
      power *= Time(i);
    }
    *residual = sum;
    return true;
  }
};

// Against a QR decomposition of all rows. The condition number is 2e3.
TEST(FitStreaming, PolynomialAsByDenseQr) {
  FitOptions options;
  options.num_threads = 2;
  options.function_tolerance = 0.0;
  FitResult<kCoefficients> fit;
  FitStreaming(options, kRows, Polynomial(), &fit);
  EXPECT_TRUE(fit.IsConverged()) << FitStatusText(fit.status);
  EXPECT_EQ(fit.rank, kCoefficients);
  EXPECT_EQ(fit.num_rows, kRows);
  Eigen::MatrixXd J(kRows, kCoefficients);
  Eigen::VectorXd y(kRows);
  for (int i = 0; i < kRows; ++i) {
    double power = 1.0;
    for (int j = 0; j < kCoefficients; ++j) {
      J(i, j) = power;
      power *= Time(i);
    }
    y[i] = i % 2 == 0 ? 1.0 : -1.0;
  }
  const Eigen::VectorXd x = LeastSquares(J, y);
  // The cost changes by |J (fit.x - x)|^2 / 2, which its rounding errors hide.
  EXPECT_LE((J * (fit.x - x)).norm(), 1e-7 * y.norm());
  const double cost = 0.5 * (J * x - y).squaredNorm();
  EXPECT_NEAR(fit.cost, cost, 1e-10 * cost);
  EXPECT_NEAR(
      fit.residual_variance, 2.0 * cost / (kRows - kCoefficients), 1e-9);
  // kappa^2 m epsilon, where kappa^2 is that of J^T J, which the test forms.
  EXPECT_LE((fit.covariance * (J.transpose() * J) -
             Eigen::MatrixXd::Identity(kCoefficients, kCoefficients))
                .norm(),
            1e-7);
}

// x_0 and x_1 occur as their sum only, x_2 nowhere.
struct Sum {
  template <typename T>
  bool operator()(int i, const T* x, T* residual) const {
    *residual = x[0] + x[1] - 1.0 * (i % 2);
    return true;
  }
};

TEST(FitStreaming, UndeterminedParameters) {
  FitResult<3> fit;
  fit.x << 0.0, 0.0, 7.0;
  FitOptions options;
  options.function_tolerance = 0.0;
  FitStreaming(options, 1000, Sum(), &fit);
  EXPECT_TRUE(fit.IsConverged());
  EXPECT_EQ(fit.rank, 1);
  // The shortest step, and none where there is no information.
  EXPECT_NEAR(fit.x[0], 0.25, 1e-6);
  EXPECT_NEAR(fit.x[1], 0.25, 1e-6);
  EXPECT_EQ(fit.x[2], 7.0);
  EXPECT_NEAR(fit.undetermined[0], 0.5, 1e-12);
  EXPECT_NEAR(fit.undetermined[2], 1.0, 1e-12);
  // J^T J = m (1 1; 1 1), whose pseudo-inverse is (1 1; 1 1) / (4 m).
  EXPECT_NEAR(fit.covariance(0, 1), 1.0 / 4000.0, 1e-15);
  EXPECT_NEAR(fit.residual_variance, 250.0 / 999.0, 1e-6);
  EXPECT_EQ(fit.StandardError(2), std::numeric_limits<double>::infinity());
}

struct FailsAt {
  int row;
  bool returns_false;

  template <typename T>
  bool operator()(int i, const T* x, T* residual) const {
    *residual = x[0] - 1.0 * (i % 3);
    if (i == row && !returns_false) *residual *= std::nan("");
    return i != row || !returns_false;
  }
};

TEST(FitStreaming, OneRowThatFails) {
  for (const int row : {0, 4999, 9999}) {
    for (const bool returns_false : {false, true}) {
      FitResult<1> fit;
      fit.x[0] = 3.0;
      FitOptions options;
      options.num_threads = 2;
      FitStreaming(options, 10000, FailsAt{row, returns_false}, &fit);
      EXPECT_EQ(fit.status, FitStatus::kInvalidStart);
      EXPECT_EQ(fit.x[0], 3.0);
      EXPECT_TRUE(std::isnan(fit.cost));
    }
  }
  FitResult<1> fit;
  FitOptions options;
  options.function_tolerance = 0.0;
  FitStreaming(options, 9999, FailsAt{-1, true}, &fit);
  EXPECT_NEAR(fit.x[0], 1.0, 1e-7);
}

TEST(FitStreaming, NoRows) {
  FitResult<1> fit;
  fit.x[0] = 3.0;
  FitStreaming(FitOptions(), 0, FailsAt{0, true}, &fit);
  EXPECT_TRUE(fit.IsConverged());
  EXPECT_EQ(fit.x[0], 3.0);
  EXPECT_EQ(fit.rank, 0);
  EXPECT_EQ(fit.cost, 0.0);
}

TEST(FitStreamingDeathTest, CallersBugs) {
  FitResult<1> fit;
  EXPECT_DEATH(FitStreaming(FitOptions(), -1, FailsAt{0, true}, &fit),
               "num_rows");
  FitOptions options;
  options.num_threads = 0;
  EXPECT_DEATH(FitStreaming(options, 1, FailsAt{0, true}, &fit), "num_threads");
}

}  // namespace fit_streaming_test
}  // namespace invgrad
