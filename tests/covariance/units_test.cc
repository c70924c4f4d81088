// What the covariance and the fits call determined does not depend on the units
// of the parameters.
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "gtest/gtest.h"
#include "invgrad/covariance.h"
#include "invgrad/fit.h"
#include "invgrad/random.h"

namespace invgrad {
namespace units_test {

using Eigen::Vector4d;
using Eigen::VectorXd;

constexpr int kNumRows = 10;
constexpr double kY[kNumRows] = {109, 62, 39, 13, 10, 4, 2, 0, 1, 2};

// y = a exp(b - c t) + d: a and b are one parameter. The parameters are counted
// in `units`, y in 1 / y_scale.
struct Decay {
  template <typename T>
  bool operator()(int /*k*/, int i, const T* x, T* residual) const {
    using std::exp;
    const double t = 399.75 + 589.5 * i;
    *residual = units[0] * x[0] * exp(units[1] * x[1] - units[2] * x[2] * t) +
                units[3] * x[3] - y_scale * kY[i];
    return true;
  }
  Vector4d units;
  double y_scale;
};

struct DecayRow {
  template <typename T>
  bool operator()(const T* x, T* residual) const {
    return decay->operator()(0, row, x, residual);
  }
  const Decay* decay;
  int row;
};

struct Result {
  int rank = 0;
  VectorXd shares;
  VectorXd deviations;
  std::string text;
};

Result ByCovariance(const Decay& decay, Vector4d x, int max_dense_size) {
  ceres::Problem problem;
  for (int i = 0; i < kNumRows; ++i) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<DecayRow, 1, 4>(
                                 new DecayRow{&decay, i}),
                             nullptr,
                             x.data());
  }
  Covariance::Options options;
  options.use_residual_variance = true;
  options.rank.max_dense_size = max_dense_size;
  Covariance covariance;
  std::string error;
  EXPECT_TRUE(ComputeCovariance(
      options, problem, MarginalPairs(problem), &covariance, &error))
      << error;
  const Covariance::Block& block = covariance.block(x.data());
  return {covariance.rank(),
          block.undetermined_shares,
          block.standard_deviations,
          covariance.ToText()};
}

Result ByFitMany(const Decay& decay, const Vector4d& x) {
  std::vector<FitResult<4>> fits(1);
  fits[0].x = x;
  FitOptions options;
  options.max_num_iterations = 0;
  FitMany(options, decay, {kNumRows}, &fits);
  Result result;
  result.rank = fits[0].rank;
  result.shares = fits[0].undetermined;
  result.deviations.resize(4);
  for (int i = 0; i < 4; ++i) result.deviations[i] = fits[0].StandardError(i);
  return result;
}

// At the minimum for y_scale = 1.
Vector4d At(double y_scale) {
  return {75.0 * y_scale, 0.758, 1e-3, 0.3 * y_scale};
}

TEST(Units, AFreeParameterIsNotKnownInAnyUnitOfTheData) {
  for (const double y_scale : {1e-8, 1e-4, 1.0, 1e4, 1e6, 1e8}) {
    SCOPED_TRACE(y_scale);
    const Decay decay{Vector4d::Ones(), y_scale};
    const Vector4d x = At(y_scale);
    const Result fit = ByFitMany(decay, x);
    for (const Result& result :
         {ByCovariance(decay, x, 300), ByCovariance(decay, x, 0), fit}) {
      EXPECT_EQ(result.rank, 3);
      // a and b have one column each of the same direction.
      EXPECT_NEAR(result.shares[0], 0.5, 1e-9);
      EXPECT_NEAR(result.shares[1], 0.5, 1e-9);
      EXPECT_LE(result.shares.tail<2>().maxCoeff(), 1e-12);
    }
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    EXPECT_EQ(fit.deviations[0], kInfinity);
    EXPECT_EQ(fit.deviations[1], kInfinity);
    EXPECT_LT(fit.deviations[2], kInfinity);
    const std::string text = ByCovariance(decay, x, 300).text;
    EXPECT_NE(text.find("`block 0`[0]"), std::string::npos);
    for (const char* name : {"`block 0`[0]", "`block 0`[1]"}) {
      const auto begin = text.find(name);
      const std::string line =
          text.substr(begin, text.find('\n', begin) - begin);
      EXPECT_NE(line.find("(no error bar: 50 % not determined)"),
                std::string::npos)
          << line;
    }
  }
}

TEST(Units, OfTheParametersChangeNoAnswer) {
  const Vector4d x = At(1.0);
  const Decay decay{Vector4d::Ones(), 1.0};
  NumpyRandom random(7);
  for (const int max_dense_size : {300, 0}) {
    const Result expected = ByCovariance(decay, x, max_dense_size);
    for (int trial = 0; trial < 200; ++trial) {
      Vector4d units;
      for (double& unit : units) {
        unit = std::pow(10.0, random.Uniform(-8.0, 8.0));
      }
      SCOPED_TRACE(testing::Message() << units.transpose());
      const Decay in_units{units, 1.0};
      const Vector4d x_in_units = x.cwiseQuotient(units);
      for (const Result& result :
           {ByCovariance(in_units, x_in_units, max_dense_size),
            ByFitMany(in_units, x_in_units)}) {
        EXPECT_EQ(result.rank, expected.rank);
        EXPECT_LE((result.shares - expected.shares).cwiseAbs().maxCoeff(),
                  1e-9);
        for (const int i : {2, 3}) {
          EXPECT_NEAR(result.deviations[i] * units[i] / expected.deviations[i],
                      1.0,
                      1e-6);
        }
      }
    }
  }
}

}  // namespace units_test
}  // namespace invgrad
