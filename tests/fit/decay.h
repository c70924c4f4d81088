// What the tests of fits share: y = a exp(-b t) + c with noise.
#ifndef INVGRAD_TESTS_FIT_DECAY_H_
#define INVGRAD_TESTS_FIT_DECAY_H_

#include <cmath>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/covariance.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/internal/fit_options.h"
#include "invgrad/random.h"

namespace invgrad {

struct DecayData {
  std::vector<double> t;
  std::vector<double> y;

  DecayData() = default;
  DecayData(int num_rows, NumpyRandom* random) {
    const Eigen::VectorXd uniform = random->Rand(3, 1);
    const Eigen::VectorXd noise = random->Normal(num_rows);
    for (int i = 0; i < num_rows; ++i) {
      t.push_back(3.0 * i / num_rows);
      y.push_back((1.0 + 4.0 * uniform[0]) *
                      std::exp(-(0.5 + 2.0 * uniform[1]) * t[i]) +
                  uniform[2] + 0.02 * noise[i]);
    }
  }
  int num_rows() const { return static_cast<int>(t.size()); }
};

// The row of one data set, for FitStreaming; with a data set, for FitMany.
struct DecayRow {
  const DecayData* data;

  template <typename T>
  bool operator()(int i, const T* x, T* residual) const {
    using std::exp;
    *residual = x[0] * exp(-x[1] * data->t[i]) + x[2] - data->y[i];
    return true;
  }
};

struct DecayRows {
  const std::vector<DecayData>* data;

  template <typename T>
  bool operator()(int k, int i, const T* x, T* residual) const {
    return DecayRow{&(*data)[k]}(i, x, residual);
  }
};

// One row as a cost function.
struct DecayCost {
  const DecayData* data;
  int row;

  template <typename T>
  bool operator()(const T* x, T* residual) const {
    return DecayRow{data}(row, x, residual);
  }
};

// The same fit by ceres::Solve and ceres::Covariance.
inline void ExpectAsCeres(const DecayData& data,
                          const Eigen::Vector3d& start,
                          const FitOptions& options,
                          const Eigen::Vector3d& x,
                          const Eigen::Matrix3d& covariance,
                          double cost,
                          int num_iterations) {
  Eigen::Vector3d expected = start;
  ceres::Problem problem;
  for (int i = 0; i < data.num_rows(); ++i) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<DecayCost, 1, 3>(
                                 new DecayCost{&data, i}),
                             nullptr,
                             expected.data());
  }
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_QR;
  solver.logging_type = ceres::SILENT;
  solver.max_num_iterations = options.max_num_iterations;
  solver.function_tolerance = options.function_tolerance;
  solver.gradient_tolerance = options.gradient_tolerance;
  solver.parameter_tolerance = options.parameter_tolerance;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  ASSERT_EQ(summary.termination_type, ceres::CONVERGENCE);
  // Rounding errors of 1e-16 grow with the condition and the iterations.
  EXPECT_LE((x - expected).norm(), 1e-8 * expected.norm());
  EXPECT_NEAR(cost, summary.final_cost, 1e-10 * cost);
  // Ceres does not list the step that converges.
  EXPECT_NEAR(num_iterations, static_cast<int>(summary.iterations.size()), 1);
  ceres::Covariance::Options covariance_options;
  covariance_options.algorithm_type = ceres::DENSE_SVD;
  ceres::Covariance of_ceres(covariance_options);
  const std::vector<std::pair<const double*, const double*>> block = {
      {expected.data(), expected.data()}};
  ASSERT_TRUE(of_ceres.Compute(block, &problem));
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> C;
  of_ceres.GetCovarianceBlock(expected.data(), expected.data(), C.data());
  EXPECT_LE((covariance - C).norm(), 1e-6 * C.norm());
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_FIT_DECAY_H_
