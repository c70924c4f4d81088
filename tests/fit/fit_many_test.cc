#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/fit.h"
#include "tests/fit/decay.h"

namespace invgrad {
namespace fit_many_test {

using Eigen::Vector2d;
using Eigen::Vector3d;

std::vector<DecayData> ManyDecays(int count) {
  NumpyRandom random(1);
  std::vector<DecayData> data;
  for (int k = 0; k < count; ++k) data.emplace_back(20 + k % 30, &random);
  return data;
}

std::vector<FitResult<3>> FitDecays(const std::vector<DecayData>& data,
                                    const FitOptions& options,
                                    const Vector3d& start = {1.0, 1.0, 0.0}) {
  std::vector<int> num_rows;
  for (const DecayData& set : data) num_rows.push_back(set.num_rows());
  std::vector<FitResult<3>> fits(data.size());
  for (FitResult<3>& fit : fits) fit.x = start;
  FitMany(options, DecayRows{&data}, num_rows, &fits);
  return fits;
}

void ExpectSameBits(const FitResult<3>& a, const FitResult<3>& b) {
  EXPECT_EQ(a.status, b.status);
  EXPECT_EQ(a.num_iterations, b.num_iterations);
  EXPECT_EQ(a.x, b.x);
  EXPECT_EQ(a.cost, b.cost);
  EXPECT_EQ(a.rank, b.rank);
  EXPECT_EQ(a.covariance, b.covariance);
}

TEST(FitMany, AsCeres) {
  const std::vector<DecayData> data = ManyDecays(60);
  for (const double tolerance : {1e-6, 1e-12}) {
    FitOptions options;
    options.function_tolerance = tolerance;
    const std::vector<FitResult<3>> fits = FitDecays(data, options);
    for (size_t k = 0; k < fits.size(); ++k) {
      SCOPED_TRACE(k);
      EXPECT_TRUE(fits[k].IsConverged()) << FitStatusText(fits[k].status);
      EXPECT_EQ(fits[k].rank, 3);
      EXPECT_EQ(fits[k].num_rows, data[k].num_rows());
      EXPECT_LT(fits[k].cost, fits[k].initial_cost);
      ExpectAsCeres(data[k],
                    {1.0, 1.0, 0.0},
                    options,
                    fits[k].x,
                    fits[k].covariance,
                    fits[k].cost,
                    fits[k].num_iterations);
    }
  }
}

TEST(FitMany, SameBitsForEveryNumberOfThreads) {
  const std::vector<DecayData> data = ManyDecays(100);
  FitOptions options;
  const std::vector<FitResult<3>> one = FitDecays(data, options);
  for (const int num_threads : {2, 3, 100}) {
    options.num_threads = num_threads;
    const std::vector<FitResult<3>> several = FitDecays(data, options);
    for (size_t k = 0; k < data.size(); ++k) {
      SCOPED_TRACE(k);
      ExpectSameBits(several[k], one[k]);
    }
  }
}

// y = x_0 + x_1 t: the covariance is (X^T X)^-1 sigma^2.
struct Line {
  const std::vector<double>* t;
  const std::vector<double>* y;
  double unit = 1.0;  // of x_1

  template <typename T>
  bool operator()(int /*k*/, int i, const T* x, T* residual) const {
    *residual = x[0] + x[1] * (unit * (*t)[i]) - (*y)[i];
    return true;
  }
};

FitResult<2> FitLine(const std::vector<double>& t,
                     const std::vector<double>& y,
                     double unit = 1.0) {
  std::vector<FitResult<2>> fits(1);
  FitOptions options;
  options.function_tolerance = 0.0;
  FitMany(options,
          Line{&t, &y, unit},
          std::vector<int>(1, static_cast<int>(t.size())),
          &fits);
  return fits[0];
}

TEST(FitMany, LineHasTheCovarianceOfTheTextbook) {
  const std::vector<double> t = {0.0, 1.0, 2.0, 3.0};
  const std::vector<double> y = {1.0, 3.0, 2.0, 5.0};
  const FitResult<2> fit = FitLine(t, y);
  EXPECT_TRUE(fit.IsConverged());
  // Means 1.5 and 2.75, S_tt = 5, S_ty = 5.5, S_yy = 8.75.
  EXPECT_NEAR(fit.x[1], 1.1, 1e-9);
  EXPECT_NEAR(fit.x[0], 1.1, 1e-9);
  EXPECT_NEAR(fit.residual_variance, (8.75 - 5.5 * 1.1) / 2.0, 1e-12);
  EXPECT_NEAR(fit.covariance(1, 1), 1.0 / 5.0, 1e-14);
  EXPECT_NEAR(fit.covariance(0, 1), -1.5 / 5.0, 1e-14);
  EXPECT_NEAR(fit.covariance(0, 0), 0.25 + 2.25 / 5.0, 1e-14);
  EXPECT_NEAR(fit.StandardError(1), std::sqrt(1.35 / 5.0), 1e-12);
  // In other units of t.
  for (const double unit : {1e-6, 1e6}) {
    const FitResult<2> other = FitLine(t, y, unit);
    EXPECT_EQ(other.rank, 2);
    EXPECT_NEAR(other.x[1] * unit, 1.1, 1e-6);
    EXPECT_NEAR(other.covariance(1, 1) * unit * unit, 0.2, 1e-12);
    EXPECT_NEAR(other.covariance(0, 1) * unit, -0.3, 1e-12);
    EXPECT_NEAR(other.StandardError(1) * unit, fit.StandardError(1), 1e-6);
  }
}

TEST(FitMany, OneTimeOnlyLeavesTheSlopeOpen) {
  const FitResult<2> fit =
      FitLine(std::vector<double>(4, 2.0), {1.0, 3.0, 2.0, 4.0});
  EXPECT_TRUE(fit.IsConverged());
  EXPECT_EQ(fit.rank, 1);
  EXPECT_NEAR(fit.x[0] + 2.0 * fit.x[1], 2.5, 1e-7);
  EXPECT_NEAR(fit.undetermined[0], 0.5, 1e-12);
  EXPECT_NEAR(fit.undetermined[1], 0.5, 1e-12);
  EXPECT_EQ(fit.StandardError(0), std::numeric_limits<double>::infinity());
  EXPECT_EQ(fit.StandardError(1), std::numeric_limits<double>::infinity());
  // x_0 + 2 x_1 is known as the mean of four is.
  const Vector2d sum(1.0, 2.0);
  EXPECT_NEAR(sum.dot(fit.covariance * sum), 0.25, 1e-14);
  EXPECT_NEAR(fit.residual_variance, 5.0 / 3.0, 1e-9);
}

TEST(FitMany, FewerRowsThanParameters) {
  std::vector<DecayData> data(4);
  for (int m = 0; m < 4; ++m) {
    for (int i = 0; i < m; ++i) {
      data[m].t.push_back(i);
      data[m].y.push_back(2.0 * std::exp(-0.7 * i) + 0.5);
    }
  }
  const std::vector<FitResult<3>> fits = FitDecays(data, FitOptions());
  for (int m = 0; m < 4; ++m) {
    SCOPED_TRACE(m);
    EXPECT_TRUE(fits[m].IsConverged());
    EXPECT_EQ(fits[m].rank, m);
    EXPECT_EQ(fits[m].num_rows, m);
    EXPECT_NEAR(fits[m].cost, 0.0, 1e-8);
    EXPECT_TRUE(std::isnan(fits[m].residual_variance));
    EXPECT_TRUE(fits[m].covariance.allFinite());
    EXPECT_NEAR(fits[m].undetermined.sum(), 3.0 - m, 1e-12);
  }
  EXPECT_EQ(fits[0].x, Vector3d(1.0, 1.0, 0.0));
}

// Every two columns of one row are parallel.
TEST(FitMany, OneRowMakesNoParametersEqual) {
  DecayData one;
  one.t = {1.0};
  one.y = {2.0};
  const FitResult<3> fit =
      FitDecays({one}, FitOptions(), Vector3d(1.0, 1.0, 1.0))[0];
  EXPECT_EQ(fit.rank, 1);
  EXPECT_EQ(fit.equal_parameter, -1);
}

TEST(FitMany, ExactDataAtTheirSolution) {
  std::vector<DecayData> data = ManyDecays(1);
  const Vector3d truth(2.0, 0.5, 0.25);
  for (int i = 0; i < data[0].num_rows(); ++i) {
    data[0].y[i] = 0.0;
    double value;
    DecayRow{&data[0]}(i, truth.data(), &value);
    data[0].y[i] = value;
  }
  const FitResult<3> there = FitDecays(data, FitOptions(), truth)[0];
  EXPECT_EQ(there.status, FitStatus::kGradientTolerance);
  EXPECT_EQ(there.num_iterations, 0);
  EXPECT_EQ(there.cost, 0.0);
  EXPECT_EQ(there.x, truth);
  EXPECT_EQ(there.rank, 3);
  EXPECT_EQ(there.StandardError(0), 0.0);
  const FitResult<3> from_afar = FitDecays(data, FitOptions())[0];
  EXPECT_TRUE(from_afar.IsConverged());
  EXPECT_LE((from_afar.x - truth).norm(), 1e-6);
}

TEST(FitMany, NotANumberIsTheStatusOfItsDataSetAlone) {
  std::vector<DecayData> data = ManyDecays(40);
  const std::vector<FitResult<3>> clean = FitDecays(data, FitOptions());
  data[7].y[3] = std::nan("");
  data[8].t[0] = -std::numeric_limits<double>::infinity();
  FitOptions options;
  options.num_threads = 2;
  const std::vector<FitResult<3>> fits = FitDecays(data, options);
  for (int k = 0; k < 40; ++k) {
    SCOPED_TRACE(k);
    if (k != 7 && k != 8) {
      ExpectSameBits(fits[k], clean[k]);
      continue;
    }
    EXPECT_EQ(fits[k].status, FitStatus::kInvalidStart);
    EXPECT_FALSE(fits[k].IsConverged());
    EXPECT_EQ(fits[k].x, Vector3d(1.0, 1.0, 0.0));
    EXPECT_TRUE(std::isnan(fits[k].cost));
    EXPECT_TRUE(std::isnan(fits[k].StandardError(0)));
    EXPECT_EQ(fits[k].rank, 0);
  }
  // A start that is not a number.
  const Vector3d nowhere = Vector3d::Constant(std::nan(""));
  EXPECT_EQ(FitDecays(ManyDecays(1), FitOptions(), nowhere)[0].status,
            FitStatus::kInvalidStart);
}

// r = log(x), where x > 0 only: the first step from 10 leads to 10 - 23.
struct Log {
  template <typename T>
  bool operator()(int /*k*/, int /*i*/, const T* x, T* residual) const {
    using std::log;
    if (x[0] <= 0.0) return false;
    *residual = log(x[0]);
    return true;
  }
};

TEST(FitMany, CandidatesWithoutValueAreRejected) {
  std::vector<FitResult<1>> fits(2);
  fits[0].x[0] = 10.0;
  fits[1].x[0] = -1.0;
  FitMany(FitOptions(), Log(), {1, 1}, &fits);
  EXPECT_TRUE(fits[0].IsConverged());
  EXPECT_NEAR(fits[0].x[0], 1.0, 1e-6);
  EXPECT_EQ(fits[1].status, FitStatus::kInvalidStart);
  EXPECT_EQ(fits[1].x[0], -1.0);
}

// r = x, but for x < 0.5 zero with a derivative that is not a number.
struct Ledge {
  template <typename T>
  bool operator()(int /*k*/, int /*i*/, const T* x, T* residual) const {
    using std::sqrt;
    *residual = x[0] < 0.5 ? sqrt(0.0 * x[0]) : T(x[0]);
    return true;
  }
};

TEST(FitMany, InvalidJacobianKeepsTheLastGoodState) {
  std::vector<FitResult<1>> fits(1);
  fits[0].x[0] = 1.0;
  FitMany(FitOptions(), Ledge(), {1}, &fits);
  EXPECT_EQ(fits[0].status, FitStatus::kInvalidJacobian);
  EXPECT_EQ(fits[0].x[0], 1.0);
  EXPECT_EQ(fits[0].cost, 0.5);
  EXPECT_EQ(fits[0].rank, 1);
  EXPECT_EQ(fits[0].covariance(0, 0), 1.0);
}

TEST(FitMany, MaxIterations) {
  FitOptions options;
  options.max_num_iterations = 2;
  const FitResult<3> fit = FitDecays(ManyDecays(1), options)[0];
  EXPECT_EQ(fit.status, FitStatus::kMaxIterations);
  EXPECT_EQ(fit.num_iterations, 2);
  EXPECT_LT(fit.cost, fit.initial_cost);
  options.max_num_iterations = 0;
  const FitResult<3> start = FitDecays(ManyDecays(1), options)[0];
  EXPECT_EQ(start.status, FitStatus::kMaxIterations);
  EXPECT_EQ(start.x, Vector3d(1.0, 1.0, 0.0));
  EXPECT_EQ(start.cost, start.initial_cost);
}

TEST(FitMany, NoDataSets) { EXPECT_TRUE(FitDecays({}, FitOptions()).empty()); }

TEST(FitOptions, Ranges) {
  std::string error;
  EXPECT_TRUE(FitOptions().IsValid(&error)) << error;
  FitOptions options;
  options.rank_threshold = 1e-12;
  EXPECT_TRUE(options.IsValid(&error)) << error;
  options.rank_threshold = 1.0;
  EXPECT_FALSE(options.IsValid(&error));
  EXPECT_EQ(error, "rank_threshold = 1 is not below 1");
  options = FitOptions();
  options.num_threads = 0;
  EXPECT_FALSE(options.IsValid(&error));
  EXPECT_EQ(error, "num_threads = 0 is not at least 1, or not finite");
  options = FitOptions();
  options.function_tolerance = std::nan("");
  EXPECT_FALSE(options.IsValid(&error));
  options = FitOptions();
  options.initial_trust_region_radius = 0.0;
  EXPECT_FALSE(options.IsValid(&error));
  EXPECT_EQ(error,
            "initial_trust_region_radius = 0 is not above 0, or not finite");
}

TEST(FitManyDeathTest, CallersBugs) {
  std::vector<FitResult<1>> fits(2);
  EXPECT_DEATH(FitMany(FitOptions(), Log(), {1}, &fits),
               "one number of rows a data set");
  EXPECT_DEATH(FitMany(FitOptions(), Log(), {1, -5}, &fits), "rows of a");
  FitOptions options;
  options.num_threads = 0;
  EXPECT_DEATH(FitMany(options, Log(), {1, 1}, &fits), "num_threads");
}

}  // namespace fit_many_test
}  // namespace invgrad
