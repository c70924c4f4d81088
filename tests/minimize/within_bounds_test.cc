#include "invgrad/minimize/within_bounds.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/cost_function.h"
#include "ceres/ordered_groups.h"
#include "gtest/gtest.h"
#include "invgrad/minimize.h"
#include "invgrad/random.h"
#include "tests/support/parse_method.h"

namespace invgrad {
namespace within_bounds_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// y = a t + b, b >= 0, data of y = 2 t - 0.5 and some noise: b ends at its bound,
// where a = sum t y / sum t^2.
struct BoundedLine {
  struct Row {
    template <typename T>
    bool operator()(const T* ab, T* r) const {
      r[0] = ab[0] * t + ab[1] - y;
      return true;
    }
    template <typename T>
    bool operator()(const T* a, const T* b, T* r) const {
      r[0] = a[0] * t + b[0] - y;
      return true;
    }
    double t;
    double y;
  };

  explicit BoundedLine(bool is_one_block) {
    double sum_ty = 0.0;
    double sum_tt = 0.0;
    for (int i = 0; i < 40; ++i) {
      const double t = 0.1 * i;
      const double y = 2.0 * t - 0.5 + 0.05 * std::sin(17.0 * i);
      sum_ty += t * y;
      sum_tt += t * t;
      if (is_one_block) {
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<Row, 1, 2>(new Row{t, y}),
            nullptr,
            ab);
      } else {
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<Row, 1, 1, 1>(new Row{t, y}),
            nullptr,
            ab,
            ab + 1);
      }
    }
    slope = sum_ty / sum_tt;
    double* block = is_one_block ? ab : ab + 1;
    problem.SetParameterLowerBound(block, is_one_block ? 1 : 0, 0.0);
    problem.SetParameterUpperBound(block, is_one_block ? 1 : 0, 5.0);
  }

  double ab[2] = {1.0, 0.0};
  double slope;
  ceres::Problem problem;
};

TEST(WithinBounds, EndsAtTheMinimumWithinTheBounds) {
  for (const char* text : {"ceres_lm:linear_solver=dense_qr",
                           "ceres_dogleg",
                           "ceres_lm+geodesic",
                           "ceres_lm+half_inverse"}) {
    for (const bool is_one_block : {true, false}) {
      SCOPED_TRACE(text);
      SCOPED_TRACE(is_one_block);
      BoundedLine line(is_one_block);
      MinimizerOptions options;
      options.max_num_iterations = 1000;
      options.function_tolerance = 1e-14;
      MinimizerSummary summary;
      std::string error;
      ASSERT_TRUE(MinimizeProblem(
          ParseMethod(text), options, nullptr, &line.problem, &summary, &error))
          << error;
      EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
      EXPECT_NEAR(line.ab[0], line.slope, 1e-6);
      EXPECT_EQ(line.ab[1], 0.0);
      double cost = 0.0;
      line.problem.Evaluate({}, &cost, nullptr, nullptr, nullptr);
      EXPECT_NEAR(summary.final_cost, cost, 1e-12);
      for (int k = 0; k <= summary.num_steps(); ++k) {
        EXPECT_EQ(summary.iterations[k].iteration, k);
      }
      EXPECT_EQ(line.problem.GetManifold(line.ab), nullptr);
    }
  }
}

struct Value {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0];
    return true;
  }
};

// Also where the rest of the cost is below its rounding error.
TEST(WithinBounds, AFixedCostDecidesNothing) {
  BoundedLine line(true);
  double constant = 1e6;
  line.problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Value, 1, 1>(new Value),
      nullptr,
      &constant);
  line.problem.SetParameterBlockConstant(&constant);
  MinimizerOptions options;
  options.max_num_iterations = 1000;
  MinimizerSummary summary;
  std::string error;
  ASSERT_TRUE(MinimizeProblem(ParseMethod("ceres_lm:linear_solver=dense_qr"),
                              options,
                              nullptr,
                              &line.problem,
                              &summary,
                              &error))
      << error;
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_NEAR(line.ab[0], line.slope, 1e-4);
  EXPECT_EQ(line.ab[1], 0.0);
}

TEST(WithinBounds, MayHoldAllComponents) {
  BoundedLine line(true);
  const Method method = ParseMethod("ceres_lm:linear_solver=dense_qr");
  MinimizerOptions options;
  MinimizerSummary summary;
  std::string error;
  line.problem.SetParameterUpperBound(line.ab, 0, 1.0);
  line.problem.SetParameterLowerBound(line.ab, 1, 1.5);
  line.ab[1] = 1.5;
  ASSERT_TRUE(MinimizeProblem(
      method, options, nullptr, &line.problem, &summary, &error))
      << error;
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_EQ(line.ab[0], 1.0);
  EXPECT_EQ(line.ab[1], 1.5);
}

// 1/2 |A x - b|^2 with 0 <= x_i <= upper, in one block.
struct BoundedLeastSquares {
  struct Residual final : ceres::CostFunction {
    Residual(const MatrixXd& matrix, const VectorXd& right)
        : A(matrix), b(right) {
      set_num_residuals(static_cast<int>(A.rows()));
      mutable_parameter_block_sizes()->push_back(static_cast<int>(A.cols()));
    }
    bool Evaluate(double const* const* parameters,
                  double* residuals,
                  double** jacobians) const override {
      const Eigen::Map<const VectorXd> x(parameters[0], A.cols());
      Eigen::Map<VectorXd>(residuals, A.rows()) = A * x - b;
      if (jacobians != nullptr && jacobians[0] != nullptr) {
        // A row-major J is a column-major J^T.
        Eigen::Map<MatrixXd>(jacobians[0], A.cols(), A.rows()) = A.transpose();
      }
      return true;
    }
    const MatrixXd& A;
    const VectorXd& b;
  };

  // Columns that share a part, which makes them nearly dependent.
  BoundedLeastSquares(unsigned seed, int num_parameters, double own_part) {
    NumpyRandom random(seed);
    const int num_residuals = 2 * num_parameters;
    const VectorXd shared = random.Normal(num_residuals);
    A.resize(num_residuals, num_parameters);
    for (auto column : A.colwise()) {
      column = shared + own_part * random.Normal(num_residuals);
    }
    b = 3.0 * random.Normal(num_residuals);
  }

  // Descends one component after the other, each to its minimum within its
  // bounds, from x, until none moves.
  double LeastCost(VectorXd x, double upper) const {
    const MatrixXd H = A.transpose() * A;
    VectorXd g = H * x - A.transpose() * b;
    for (int sweep = 0; sweep < 100000; ++sweep) {
      double longest = 0.0;
      for (int j = 0; j < x.size(); ++j) {
        const double moved =
            std::clamp(x[j] - g[j] / H(j, j), 0.0, upper) - x[j];
        g += moved * H.col(j);
        x[j] += moved;
        longest = std::max(longest, std::abs(moved));
      }
      if (longest < 1e-10) break;
    }
    return 0.5 * (A * x - b).squaredNorm();
  }

  MatrixXd A;
  VectorXd b;
};

// The function tolerance is 1e-6. Where columns are nearly dependent, a run that
// holds only the components at bounds ends a thousandth above the minimum.
TEST(WithinBounds, ConvexProblemsEndAtTheirMinimum) {
  constexpr int kNumParameters = 10;
  constexpr double kUpper = 0.1;
  for (const auto& [own_part, start] : {std::pair(0.3, 0.0), {0.05, 0.05}}) {
    for (unsigned seed = 0; seed < 40; ++seed) {
      SCOPED_TRACE(own_part);
      SCOPED_TRACE(seed);
      const BoundedLeastSquares squares(seed, kNumParameters, own_part);
      VectorXd x = VectorXd::Constant(kNumParameters, start);
      ceres::Problem problem;
      problem.AddResidualBlock(
          new BoundedLeastSquares::Residual(squares.A, squares.b),
          nullptr,
          x.data());
      for (int i = 0; i < kNumParameters; ++i) {
        problem.SetParameterLowerBound(x.data(), i, 0.0);
        problem.SetParameterUpperBound(x.data(), i, kUpper);
      }
      MinimizerOptions options;
      options.max_num_iterations = 1000;
      MinimizerSummary summary;
      std::string error;
      ASSERT_TRUE(MinimizeProblem(ParseMethod("ceres_lm"),
                                  options,
                                  nullptr,
                                  &problem,
                                  &summary,
                                  &error))
          << error;
      EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE)
          << summary.message;
      const double least = squares.LeastCost(x, kUpper);
      EXPECT_LE(summary.final_cost, (1.0 + 2e-4) * least);
    }
  }
}

struct Coupled {
  template <typename T>
  bool operator()(const T* a, const T* b, const T* c, T* r) const {
    r[0] = a[0] + 0.999 * b[0] - 3.0 + c[0];
    r[1] = 0.999 * a[0] + b[0] + 2.0;
    r[2] = 0.01 * (a[0] * a[0] - 4.0);
    r[3] = 0.3 * (b[0] * b[0] * b[0] + 1.0);
    return true;
  }
};

// Ceres removes constant blocks from an ordering that it is given; a block that
// is held in one solve is free in the next.
TEST(WithinBounds, TheEliminationOrderIsKept) {
  double a, b;
  double c = 0.0;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Coupled, 4, 1, 1, 1>(new Coupled),
      nullptr,
      &a,
      &b,
      &c);
  problem.SetParameterBlockConstant(&c);
  problem.SetParameterLowerBound(&b, 0, 0.0);
  const auto order = std::make_shared<ceres::ParameterBlockOrdering>();
  order->AddElementToGroup(&a, 0);
  order->AddElementToGroup(&b, 1);
  order->AddElementToGroup(&c, 1);
  double costs[2];
  for (double& cost : costs) {
    a = 2.0;
    b = 1.0;
    MinimizerOptions options;
    options.max_num_iterations = 200;
    MinimizerSummary summary;
    std::string error;
    ASSERT_TRUE(
        MinimizeProblem(ParseMethod("ceres_lm:linear_solver=dense_schur"),
                        options,
                        order,
                        &problem,
                        &summary,
                        &error))
        << error;
    EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE) << summary.message;
    EXPECT_EQ(b, 0.0);
    EXPECT_EQ(order->NumElements(), 3);
    cost = summary.final_cost;
  }
  EXPECT_EQ(costs[0], costs[1]);
}

}  // namespace within_bounds_test
}  // namespace invgrad
