// Proposals that lead to where the gradient vanishes: to a minimum, to a worse
// minimum than that of the solve without proposals, and into a flat region.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/proposal.h"
#include "invgrad/update_callback.h"

namespace invgrad {
namespace stationary_candidate_test {

// Proposes `candidate` from every state.
template <std::size_t kSize>
ProposalFunction Constantly(const double* x,
                            const std::array<double, kSize>& candidate) {
  return [=](const ProblemState&, ProblemState* to) {
    std::copy(candidate.begin(), candidate.end(), (*to)(x));
    return true;
  };
}

UpdateCallback::Options WithoutComparison() {
  UpdateCallback::Options options;
  options.compare_with_plain = false;
  options.max_relative_work = 1e9;
  return options;
}

ceres::Solver::Summary Solve(int max_num_iterations,
                             UpdateCallback* callback,
                             ceres::Problem* problem) {
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = max_num_iterations;
  callback->AddTo(&options);
  ceres::Solver::Summary summary;
  ceres::Solve(options, problem, &summary);
  return summary;
}

// Its cost at the origin is 2.5, and the gradient (1, -2).
struct Bilinear {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0] + 1.0;
    r[1] = x[1] - 2.0;
    r[2] = x[0] * x[1];
    return true;
  }
};

TEST(StationaryCandidate, TheOriginCanBeProposed) {
  double x[2] = {-3.0, 5.0};
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Bilinear, 3, 2>(new Bilinear),
      nullptr,
      x);
  UpdateCallback callback(
      Constantly<2>(x, {0.0, 0.0}), &problem, WithoutComparison());
  Solve(1, &callback, &problem);
  EXPECT_EQ(callback.summary().num_withheld, 0);
  EXPECT_EQ(callback.summary().num_accepted, 1);
  EXPECT_EQ(x[0], 0.0);
  EXPECT_EQ(x[1], 0.0);
}

// The rows of J sum to zero, and at x_0 - x_1 = 1.5 the gradient is zero.
struct Differences {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0] - x[1] - 1.0;
    r[1] = x[0] - x[1] - 2.0;
    return true;
  }
};

TEST(StationaryCandidate, AMinimumWithResidualsCanBeProposed) {
  double x[2] = {0.0, 8.0};
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Differences, 2, 2>(new Differences),
      nullptr,
      x);
  UpdateCallback callback(
      Constantly<2>(x, {9.5, 8.0}), &problem, WithoutComparison());
  const ceres::Solver::Summary summary = Solve(50, &callback, &problem);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(callback.summary().num_withheld, 0);
  EXPECT_EQ(callback.summary().num_accepted, 1);
  EXPECT_NEAR(summary.final_cost, 0.25, 1e-15);
  EXPECT_EQ(x[1], 8.0);
}

// Minima of cost 0 at 1, and of cost 1/2 at -1, where the gradient is exactly
// zero, so that Ceres would end a run there.
struct ExactWells {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0] * x[0] - 1.0;
    r[1] = 0.25 * (x[0] + 1.0) * (x[0] + 1.0) - 1.0;
    return true;
  }
};

TEST(StationaryCandidate, AWorseMinimumThanThePlainOneIsNotProposed) {
  for (const bool compares : {false, true}) {
    double x = 2.0;
    ceres::Problem problem;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<ExactWells, 2, 1>(new ExactWells),
        nullptr,
        &x);
    UpdateCallback::Options options = WithoutComparison();
    options.compare_with_plain = compares;
    UpdateCallback callback(Constantly<1>(&x, {-1.0}), &problem, options);
    const ceres::Solver::Summary summary = Solve(50, &callback, &problem);
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
    EXPECT_NEAR(x, compares ? 1.0 : -1.0, 1e-6);
    EXPECT_EQ(callback.summary().num_withheld > 0, compares);
  }
}

// r is 1 and flat far away, and least at -1 / sqrt(2).
struct Bump {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    using std::exp;
    r[0] = 1.0 + x[0] * exp(-x[0] * x[0]);
    return true;
  }
};

TEST(StationaryCandidate, AFlatRegionIsNotProposed) {
  double x = 0.5;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Bump, 1, 1>(new Bump), nullptr, &x);
  UpdateCallback callback(
      Constantly<1>(&x, {100.0}), &problem, WithoutComparison());
  Solve(100, &callback, &problem);
  EXPECT_EQ(callback.summary().num_proposed, 0);
  EXPECT_GE(callback.summary().num_withheld, 3);
  EXPECT_NEAR(x, -std::sqrt(0.5), 1e-3);
}

}  // namespace stationary_candidate_test
}  // namespace invgrad
