#include "invgrad/covariance.h"

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Dense"
#include "ceres/autodiff_cost_function.h"
#include "ceres/covariance.h"
#include "ceres/problem.h"
#include "gtest/gtest.h"
#include "tests/rank/rank_problems.h"

namespace invgrad {
namespace covariance_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Covariance Compute(const ceres::Problem& problem,
                   const std::vector<Covariance::Pair>& pairs,
                   const Covariance::Options& options = {}) {
  Covariance covariance;
  std::string error;
  EXPECT_TRUE(ComputeCovariance(options, problem, pairs, &covariance, &error))
      << error;
  return covariance;
}

Covariance::Options Sparse() {
  Covariance::Options options;
  options.rank.max_dense_size = 0;
  return options;
}

std::vector<const double*> BlocksOf(Graph3* graph) {
  std::vector<const double*> blocks;
  for (std::size_t i = 0; i < graph->p.size(); ++i) {
    blocks.push_back(graph->p[i].data());
    blocks.push_back(graph->q[i].data());
  }
  return blocks;
}

// Every pair of blocks, in tangent and ambient coordinates.
void ExpectCeres(const ceres::Covariance::Options& ceres_options,
                 const std::vector<const double*>& blocks,
                 const Covariance& covariance,
                 ceres::Problem* problem) {
  ceres::Covariance expected(ceres_options);
  ASSERT_TRUE(expected.Compute(blocks, problem));
  for (const double* a : blocks) {
    for (const double* b : blocks) {
      RowMajorMatrix tangent(problem->ParameterBlockTangentSize(a),
                             problem->ParameterBlockTangentSize(b));
      RowMajorMatrix ambient(problem->ParameterBlockSize(a),
                             problem->ParameterBlockSize(b));
      ASSERT_TRUE(
          expected.GetCovarianceBlockInTangentSpace(a, b, tangent.data()));
      ASSERT_TRUE(expected.GetCovarianceBlock(a, b, ambient.data()));
      EXPECT_LE((covariance.TangentBlock(a, b) - tangent).norm(), 1e-9);
      EXPECT_LE((covariance.AmbientBlock(a, b) - ambient).norm(), 1e-9);
    }
  }
}

TEST(Covariance, OfFullRankIsThatOfCeres) {
  ceres::Problem problem;
  Graph3 graph(12, &problem);
  problem.SetParameterBlockConstant(graph.p[0].data());
  problem.SetParameterBlockConstant(graph.q[0].data());
  const std::vector<const double*> blocks = BlocksOf(&graph);
  for (const auto& options : {Covariance::Options(), Sparse()}) {
    const Covariance covariance = Compute(problem, AllPairs(blocks), options);
    EXPECT_EQ(covariance.rank(), 66);
    EXPECT_EQ(covariance.num_parameters(), 66);
    ceres::Covariance::Options ceres_options;
    ExpectCeres(ceres_options, blocks, covariance, &problem);
    EXPECT_LE(covariance.block(blocks[2]).undetermined_shares.maxCoeff(),
              1e-12);
  }
}

// Six gauge freedoms.
TEST(Covariance, OfAFreeGraphIsThePseudoInverseOfCeres) {
  ceres::Problem problem;
  Graph3 graph(12, &problem);
  const std::vector<const double*> blocks = BlocksOf(&graph);
  for (const auto& options : {Covariance::Options(), Sparse()}) {
    const Covariance covariance = Compute(problem, AllPairs(blocks), options);
    EXPECT_EQ(covariance.num_parameters() - covariance.rank(), 6);
    ceres::Covariance::Options ceres_options;
    ceres_options.algorithm_type = ceres::DENSE_SVD;
    ceres_options.null_space_rank = 6;
    ExpectCeres(ceres_options, blocks, covariance, &problem);
    // The shares of all parameters are the dimension of the null space.
    double sum = 0.0;
    for (const Covariance::Block& block : covariance.blocks()) {
      sum += block.undetermined_shares.sum();
      EXPECT_LT(block.standard_deviations.maxCoeff(), kInfinity);
    }
    EXPECT_NEAR(sum, 6.0, 1e-10);
  }
}

// The variance of the squared distance of two poses, which the gauge leaves
// unchanged.
TEST(Covariance, OfAnInvariantFunctionDoesNotDependOnTheGauge) {
  ceres::Problem problem;
  Graph2 graph(20, 1.0, &problem);
  const double* const a = graph.poses[3].data();
  const double* const b = graph.poses[16].data();
  Eigen::RowVector3d gradient(2.0 * (a[0] - b[0]), 2.0 * (a[1] - b[1]), 0.0);
  Eigen::Matrix<double, 1, 6> J;
  J << gradient, -gradient;
  const auto variance = [&] {
    std::vector<double> variances;
    for (const auto& options : {Covariance::Options(), Sparse()}) {
      const Covariance covariance = Compute(problem, AllPairs({a, b}), options);
      MatrixXd C(6, 6);
      C << covariance.TangentBlock(a, a), covariance.TangentBlock(a, b),
          covariance.TangentBlock(b, a), covariance.TangentBlock(b, b);
      variances.push_back((J * C * J.transpose())(0, 0));
    }
    EXPECT_NEAR(variances[0], variances[1], 1e-9 * variances[0]);
    return variances[0];
  };
  const double free = variance();
  for (const int anchor : {0, 16}) {
    problem.SetParameterBlockConstant(graph.poses[anchor].data());
    if (anchor != 16) {
      EXPECT_NEAR(variance(), free, 1e-9 * free);
    } else {
      const Covariance covariance = Compute(problem, {{a, a}, {b, b}});
      EXPECT_TRUE(covariance.TangentBlock(b, b).isZero(0.0));
      EXPECT_NEAR((gradient * covariance.TangentBlock(a, a) *
                   gradient.transpose())(0, 0),
                  free,
                  1e-9 * free);
    }
    problem.SetParameterBlockVariable(graph.poses[anchor].data());
  }
}

TEST(Covariance, RowsOfBlocksAreThoseOfAllPairs) {
  ceres::Problem problem;
  Graph3 graph(12, &problem);
  const double* const row = graph.q[4].data();
  const Covariance all = Compute(problem, AllPairs(BlocksOf(&graph)));
  const Covariance rows = Compute(problem, RowPairs(problem, {row}), Sparse());
  const Covariance marginals =
      Compute(problem, MarginalPairs(problem), Sparse());
  for (const double* other : BlocksOf(&graph)) {
    EXPECT_LE(
        (rows.TangentBlock(row, other) - all.TangentBlock(row, other)).norm(),
        1e-9);
    EXPECT_LE(
        (marginals.TangentBlock(other, other) - all.TangentBlock(other, other))
            .norm(),
        1e-9);
  }
}

// A line a + b t through noisy points: C = sigma^2 (X^T X)^-1, with sigma^2 the
// residual variance.
struct Line {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0] + x[1] * t - y;
    return true;
  }
  double t;
  double y;
};

class LineFit {
 public:
  explicit LineFit(int num_points) {
    for (int i = 0; i < num_points; ++i) {
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Line, 1, 2>(
                                   new Line{1.0 * i, i % 2 == 0 ? 0.5 : -0.5}),
                               nullptr,
                               x);
    }
  }
  double x[2] = {0.0, 0.0};
  ceres::Problem problem;
};

TEST(Covariance, UsesTheResidualVariance) {
  LineFit fit(6);
  Covariance::Options options;
  options.use_residual_variance = true;
  const Covariance covariance =
      Compute(fit.problem, MarginalPairs(fit.problem), options);
  // 6 residuals of 1/2, 4 degrees of freedom.
  const double variance = 6.0 * 0.25 / 4.0;
  EXPECT_NEAR(covariance.residual_variance(), variance, 1e-15);
  Eigen::Matrix2d XtX;
  XtX << 6.0, 15.0, 15.0, 55.0;
  const Eigen::Matrix2d expected = variance * XtX.inverse();
  EXPECT_LE((covariance.TangentBlock(fit.x, fit.x) - expected).norm(), 1e-14);
  EXPECT_NEAR(covariance.Correlations(fit.x, fit.x)(0, 1),
              -15.0 / std::sqrt(6.0 * 55.0),
              1e-14);
  EXPECT_EQ(covariance.ToText(),
            "6 residuals, 2 parameters, 2 determined; variance of a residual "
            "0.375 (2 L / (m - rank))\n"
            "  `block 0`[0]  0  +/- 0.4432\n"
            "  `block 0`[1]  0  +/- 0.14639\n"
            "correlations of at least 0.1:\n"
            "  `block 0`[0], `block 0`[1]: -0.8257\n");
}

TEST(Covariance, WithoutDegreesOfFreedomThereIsNoResidualVariance) {
  LineFit fit(2);
  Covariance::Options options;
  options.use_residual_variance = true;
  Covariance covariance;
  std::string error;
  EXPECT_FALSE(ComputeCovariance(
      options, fit.problem, MarginalPairs(fit.problem), &covariance, &error));
  EXPECT_EQ(error,
            "use_residual_variance needs more residuals (2) than determined "
            "parameters (2)");
  EXPECT_TRUE(std::isnan(Compute(fit.problem, {}).residual_variance()));
}

// r = x_0 + x_1, a parameter in no residual, a zero column, and a constant
// block.
TEST(Covariance, MarksWhatTheDataDoNotDetermine) {
  double x[2] = {1.0, 2.0};
  double unused = 3.0;
  double partly[2] = {4.0, 5.0};
  double constant[3] = {6.0, 7.0, 8.0};
  ceres::Problem problem;
  problem.AddResidualBlock(new Linear({Row({1.0, 1.0})}), nullptr, x);
  problem.AddResidualBlock(new Linear({Row({0.0, 2.0})}), nullptr, partly);
  problem.AddParameterBlock(&unused, 1);
  problem.AddParameterBlock(constant, 3);
  problem.SetParameterBlockConstant(constant);
  for (const auto& options : {Covariance::Options(), Sparse()}) {
    const Covariance covariance =
        Compute(problem, AllPairs({x, &unused, partly, constant}), options);
    EXPECT_EQ(covariance.rank(), 2);
    EXPECT_EQ(covariance.num_parameters(), 5);
    EXPECT_NEAR(covariance.block(x).undetermined_shares[0], 0.5, 1e-12);
    EXPECT_NEAR(covariance.TangentBlock(x, x)(0, 1), 0.25, 1e-12);
    EXPECT_EQ(covariance.block(&unused).standard_deviations[0], kInfinity);
    EXPECT_EQ(covariance.block(partly).standard_deviations[0], kInfinity);
    EXPECT_NEAR(covariance.block(partly).standard_deviations[1], 0.5, 1e-15);
    EXPECT_TRUE(std::isnan(covariance.Correlations(partly, partly)(0, 1)));
    EXPECT_EQ(covariance.TangentBlock(constant, x).rows(), 3);
    EXPECT_TRUE(covariance.AmbientBlock(constant, x).isZero(0.0));
    EXPECT_TRUE(covariance.Correlations(constant, x).array().isNaN().all());
    EXPECT_EQ(covariance.Correlations(x, constant).rows(), 2);
    EXPECT_EQ(covariance.Correlations(x, constant).cols(), 3);
    EXPECT_TRUE(covariance.TangentBlock(x, partly).isZero(0.0));
    const std::string text = covariance.ToText();
    EXPECT_NE(text.find("`block 0`[0]  1  +/- 0.5 (no error bar: 50 % not "
                        "determined)"),
              std::string::npos)
        << text;
    EXPECT_NE(text.find("`block 1`[0]  4  not determined"), std::string::npos)
        << text;
  }
}

TEST(Covariance, InvalidInputIsAMessage) {
  LineFit fit(4);
  Covariance covariance;
  std::string error;
  Covariance::Options options;
  options.rank.threshold = 2.0;
  EXPECT_FALSE(ComputeCovariance(
      options, fit.problem, MarginalPairs(fit.problem), &covariance, &error));
  EXPECT_EQ(error, "threshold must be in (1e-12, 1)");
  fit.x[0] = std::nan("");
  EXPECT_FALSE(ComputeCovariance(
      {}, fit.problem, MarginalPairs(fit.problem), &covariance, &error));
  EXPECT_NE(error.find("residual block 0"), std::string::npos) << error;
}

// x_1 at a bound counts as constant, in blocks of size one and two.
TEST(Covariance, ComponentsAtBoundsCountAsConstant) {
  MatrixXd A(5, 2);
  A << 1.0, 1.0, 2.0, 1.0, 3.0, 1.0, 4.0, 1.0, 5.0, 2.0;
  const double free_variance = 1.0 / A.col(0).squaredNorm();
  for (const bool is_lower : {true, false}) {
    for (const auto& options : {Covariance::Options(), Sparse()}) {
      double x[2] = {0.5, 0.25};
      ceres::Problem one;
      one.AddResidualBlock(new Linear({A}), nullptr, x);
      ceres::Problem two;
      two.AddResidualBlock(new Linear({A.col(0), A.col(1)}), nullptr, x, x + 1);
      if (is_lower) {
        one.SetParameterLowerBound(x, 1, x[1]);
        two.SetParameterLowerBound(x + 1, 0, x[1]);
      } else {
        one.SetParameterUpperBound(x, 1, x[1]);
        two.SetParameterUpperBound(x + 1, 0, x[1]);
      }
      one.SetParameterLowerBound(x, 0, x[0] - 1.0);  // not active
      const Covariance of_one = Compute(one, {{x, x}}, options);
      EXPECT_NEAR(of_one.TangentBlock(x, x)(0, 0), free_variance, 1e-15);
      EXPECT_EQ(of_one.TangentBlock(x, x).col(1), Eigen::Vector2d::Zero());
      EXPECT_EQ(of_one.block(x).at_bound, std::vector<int>{1});
      const Covariance of_two = Compute(two, AllPairs({x, x + 1}), options);
      EXPECT_NEAR(of_two.TangentBlock(x, x)(0, 0), free_variance, 1e-15);
      EXPECT_EQ(of_two.block(x + 1).standard_deviations[0], 0.0);
      for (const Covariance* C : {&of_one, &of_two}) {
        EXPECT_EQ(C->rank(), 1);
        EXPECT_EQ(C->num_parameters(), 1);
        const std::string text = C->ToText();
        EXPECT_EQ(text.find("5 residuals, 1 parameters (and 1 at bounds), 1 "
                            "determined"),
                  0u)
            << text;
        EXPECT_NE(text.find("0.25  at its bound"), std::string::npos) << text;
      }
    }
  }
}

// x + y / u: the variance of y is u^-2, the sum of terms of u^2.
TEST(Covariance, VariancesAreNotNegative) {
  for (double u = 1e7; u < 1e10; u *= 1.1) {
    double x[2] = {1.0, u};
    ceres::Problem problem;
    problem.AddResidualBlock(
        new Linear({MatrixXd::Ones(1, 1), MatrixXd::Constant(1, 1, 1.0 / u)}),
        nullptr,
        x,
        x + 1);
    const Covariance covariance =
        Compute(problem, AllPairs({x, x + 1}), Sparse());
    EXPECT_EQ(covariance.rank(), 1);
    for (const double* value : {x, x + 1}) {
      EXPECT_GE(covariance.TangentBlock(value, value)(0, 0), 0.0) << u;
    }
  }
}

TEST(CovarianceDeathTest, AMissingPairIsACallersBug) {
  ceres::Problem problem;
  Graph2 graph(3, 1.0, &problem);
  const double* const a = graph.poses[0].data();
  const double* const b = graph.poses[1].data();
  const Covariance covariance = Compute(problem, {{a, a}});
  EXPECT_DEATH(covariance.TangentBlock(a, b),
               "was not given to ComputeCovariance");
  double other = 0.0;
  EXPECT_DEATH(Compute(problem, {{&other, a}}), "not part of the problem");
}

}  // namespace covariance_test
}  // namespace invgrad
