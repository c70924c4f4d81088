#include "invgrad/ceres/problem_linearizer.h"

#include <cmath>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/crs_matrix.h"
#include "ceres/evaluation_callback.h"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "gtest/gtest.h"
#include "invgrad/internal/objective.h"
#include "invgrad/jacobian_operator.h"
#include "tests/ceres/mixed_problem.h"

// Deprecated, but in the code that exists: Ceres 2.1 adapts them to manifolds.
#if __has_include("ceres/local_parameterization.h")
#include "ceres/local_parameterization.h"
#include "invgrad/stored_jacobian.h"
#endif

namespace invgrad {
namespace problem_linearizer_test {

// The sums are the same as Ceres', in another order: rounding of numbers of the
// size of 1 to 100.
constexpr double kTolerance = 1e-12;

Eigen::MatrixXd Dense(const ceres::CRSMatrix& matrix) {
  Eigen::MatrixXd dense =
      Eigen::MatrixXd::Zero(matrix.num_rows, matrix.num_cols);
  for (int row = 0; row < matrix.num_rows; ++row) {
    for (int k = matrix.rows[row]; k < matrix.rows[row + 1]; ++k) {
      dense(row, matrix.cols[k]) = matrix.values[k];
    }
  }
  return dense;
}

Eigen::VectorXd AsVector(const std::vector<double>& v) {
  return Eigen::Map<const Eigen::VectorXd>(v.data(), v.size());
}

// The blocks that are not constant, in column order.
std::vector<double*> BlocksOf(const ProblemLinearizer& linearizer) {
  std::vector<double*> blocks;
  for (const auto& block : linearizer.structure().parameter_blocks) {
    blocks.push_back(block.values);
  }
  return blocks;
}

void ExpectAgreesWithCeres(ceres::Problem* problem,
                           const ProblemLinearizer::Options& options) {
  ProblemLinearizer linearizer(problem, options);
  ceres::Problem::EvaluateOptions evaluate_options;
  evaluate_options.parameter_blocks = BlocksOf(linearizer);
  evaluate_options.residual_blocks = options.residual_blocks;
  evaluate_options.apply_loss_function = options.apply_loss_function;
  double cost = 0.0;
  std::vector<double> residuals;
  std::vector<double> gradient;
  ceres::CRSMatrix jacobian;
  ASSERT_TRUE(problem->Evaluate(
      evaluate_options, &cost, &residuals, &gradient, &jacobian));

  LinearizationParts parts;
  parts.gradient = true;
  parts.jacobian = true;
  Linearization at_x;
  std::string error;
  ASSERT_TRUE(linearizer.Linearize(parts, &at_x, &error)) << error;
  ASSERT_EQ(at_x.loss_gradient.size(), linearizer.structure().num_residuals);
  ASSERT_EQ(at_x.jacobian->cols(), linearizer.num_parameters());
  EXPECT_NEAR(at_x.cost, cost, kTolerance * cost);
  EXPECT_LT((at_x.loss_gradient - AsVector(residuals)).norm(),
            kTolerance * at_x.loss_gradient.norm());
  EXPECT_LT((at_x.gradient - AsVector(gradient)).norm(),
            kTolerance * at_x.gradient.norm());
  Eigen::MatrixXd J;
  at_x.jacobian->ToDense(&J);
  const Eigen::MatrixXd expected = Dense(jacobian);
  ASSERT_EQ(J.rows(), expected.rows());
  ASSERT_EQ(J.cols(), expected.cols());
  EXPECT_LT((J - expected).norm(), kTolerance * expected.norm());
  EXPECT_FALSE(at_x.loss_hessian_times);

  double cost_alone = 0.0;
  ASSERT_TRUE(linearizer.Cost(&cost_alone, &error)) << error;
  EXPECT_EQ(cost_alone, at_x.cost);
}

TEST(ProblemLinearizer, AgreesWithCeresOnInliersAndOutliers) {
  for (const double scale : {0.1, 1.0, 30.0}) {
    SCOPED_TRACE(scale);
    Blocks blocks;
    ceres::Problem problem;
    blocks.AddTo(&problem);
    AddResiduals(scale, &blocks, &problem);
    ExpectAgreesWithCeres(&problem, {});
    ProblemLinearizer::Options options;
    options.apply_loss_function = false;
    ExpectAgreesWithCeres(&problem, options);
  }
}

TEST(ProblemLinearizer, AgreesWithCeresOnASubset) {
  Blocks blocks;
  ceres::Problem problem;
  blocks.AddTo(&problem);
  AddResiduals(1.0, &blocks, &problem);
  std::vector<ceres::ResidualBlockId> all;
  problem.GetResidualBlocks(&all);
  ProblemLinearizer::Options options;
  options.residual_blocks = {all[6], all[1], all[7], all[2]};
  ExpectAgreesWithCeres(&problem, options);
}

TEST(ProblemLinearizer, ColumnBlocksAreTheParameterBlocks) {
  Blocks blocks;
  ceres::Problem problem;
  blocks.AddTo(&problem);
  AddResiduals(1.0, &blocks, &problem);
  const ProblemLinearizer linearizer(&problem, {});
  LinearizationParts parts;
  parts.jacobian = true;
  Linearization at_x;
  std::string error;
  ASSERT_TRUE(linearizer.Linearize(parts, &at_x, &error)) << error;
  Eigen::MatrixXd J;
  at_x.jacobian->ToDense(&J);
  const auto column_blocks = ColumnBlocksOf(*at_x.jacobian);
  ASSERT_EQ(column_blocks.size(), BlocksOf(linearizer).size());
  for (size_t b = 0; b < column_blocks.size(); ++b) {
    Eigen::MatrixXd J_b;
    column_blocks[b]->ToDense(&J_b);
    EXPECT_EQ(J_b.cols(),
              problem.ParameterBlockTangentSize(BlocksOf(linearizer)[b]));
    EXPECT_EQ(J_b,
              J.middleCols(linearizer.structure().parameter_blocks[b].column,
                           J_b.cols()));
  }
}

TEST(ProblemLinearizer, ZeroResidual) {
  double x[2] = {0.0, 0.0};
  double y[2] = {0.0, 0.0};
  ceres::Problem problem;
  // sin(0) = 0 in the first row only; scale 0 makes all of r zero.
  problem.AddResidualBlock(
      NewMix<2, 2>(0.0), new ceres::TolerantLoss(1.0, 0.5), x, y);
  problem.AddResidualBlock(NewMix<2, 2>(1.0), nullptr, x, y);
  ExpectAgreesWithCeres(&problem, {});
}

#if __has_include("ceres/local_parameterization.h")
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
TEST(ProblemLinearizer, LocalParameterization) {
  Blocks blocks;
  ceres::Problem problem;
  problem.AddParameterBlock(blocks.x, 2);
  problem.AddParameterBlock(blocks.q, 4, new ceres::QuaternionParameterization);
  problem.AddParameterBlock(
      blocks.s, 3, new ceres::SubsetParameterization(3, {0}));
  problem.AddResidualBlock(NewMix<2, 4>(1.0), nullptr, blocks.x, blocks.q);
  problem.AddResidualBlock(NewMix<3, 4>(1.0), nullptr, blocks.s, blocks.q);
  ExpectAgreesWithCeres(&problem, {});

  ProblemLinearizer linearizer(&problem, {});
  EXPECT_EQ(linearizer.num_parameters(), 2 + 3 + 2);
  ASSERT_TRUE(linearizer.Plus(Eigen::VectorXd::Constant(7, 0.1)));
  EXPECT_DOUBLE_EQ(blocks.s[0], 1.1);
  EXPECT_DOUBLE_EQ(blocks.s[1], -0.1);
  EXPECT_NEAR(Eigen::Map<Eigen::Vector4d>(blocks.q).norm(),
              std::sqrt(0.64 + 0.16 + 0.16 + 0.04),
              1e-15);
}
#pragma GCC diagnostic pop
#endif

TEST(ProblemLinearizer, StateAndPlus) {
  Blocks blocks;
  ceres::Problem problem;
  blocks.AddTo(&problem);
  AddResiduals(1.0, &blocks, &problem);
  ProblemLinearizer linearizer(&problem, {});
  EXPECT_EQ(BlocksOf(linearizer),
            std::vector<double*>({blocks.x,
                                  blocks.q,
                                  blocks.e,
                                  blocks.pose,
                                  blocks.s,
                                  blocks.unused}));
  EXPECT_EQ(linearizer.num_parameters(), 2 + 3 + 3 + 6 + 2 + 3);
  EXPECT_EQ(linearizer.structure().num_ambient, 2 + 4 + 4 + 7 + 3 + 3);
  EXPECT_EQ(linearizer.structure().parameter_blocks[3].column, 8);

  const Blocks before = blocks;
  const Eigen::VectorXd state = linearizer.State();
  Eigen::VectorXd step(linearizer.num_parameters());
  for (int i = 0; i < step.size(); ++i) step[i] = 0.01 * (i + 1);
  ASSERT_TRUE(linearizer.Plus(step));
  EXPECT_DOUBLE_EQ(blocks.x[1], before.x[1] + 0.02);
  double q[4];
  ceres::QuaternionManifold().Plus(before.q, step.data() + 2, q);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(blocks.q[i], q[i]);
  EXPECT_EQ(blocks.s[1], before.s[1]);
  EXPECT_NE(blocks.s[2], before.s[2]);
  EXPECT_EQ(blocks.constant[0], before.constant[0]);

  linearizer.SetState(state);
  EXPECT_EQ(linearizer.State(), state);
  EXPECT_EQ(blocks.pose[6], before.pose[6]);
}

struct Product {
  template <typename T>
  bool operator()(const T* a, const T* b, T* r) const {
    r[0] = a[0] * b[0] - 1.0;
    return true;
  }
};

TEST(ProblemLinearizer, StoresAFullJacobianDenselyAndASparseOneInRows) {
  double x[6] = {1.0, 2.0, 3.0, 4.0, 5.0, 6.0};
  LinearizationParts parts;
  parts.jacobian = true;
  // One residual on 2 of 2, 3, ... unknowns each: full, then ever emptier.
  for (const int num_pairs : {1, 3}) {
    ceres::Problem problem;
    for (int i = 0; i < num_pairs; ++i) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<Product, 1, 1, 1>(new Product),
          nullptr,
          &x[2 * i],
          &x[2 * i + 1]);
    }
    const ProblemLinearizer linearizer(&problem, {});
    Linearization at_x;
    std::string error;
    ASSERT_TRUE(linearizer.Linearize(parts, &at_x, &error)) << error;
    EXPECT_EQ(
        dynamic_cast<const DenseJacobian*>(at_x.jacobian.get()) != nullptr,
        num_pairs == 1);
    Eigen::MatrixXd J;
    at_x.jacobian->ToDense(&J);
    EXPECT_EQ(J(0, 0), 2.0);
    EXPECT_EQ(J(0, 1), 1.0);
  }
}

TEST(ProblemLinearizer, EmptyProblem) {
  ceres::Problem problem;
  ProblemLinearizer linearizer(&problem, {});
  LinearizationParts parts;
  parts.gradient = true;
  parts.jacobian = true;
  parts.hessian = true;
  Linearization at_x;
  std::string error;
  ASSERT_TRUE(linearizer.Linearize(parts, &at_x, &error));
  EXPECT_EQ(at_x.cost, 0.0);
  EXPECT_EQ(at_x.gradient.size(), 0);
  EXPECT_EQ(at_x.jacobian->rows(), 0);
}

// A cost function that reads what an evaluation callback has prepared.
struct Shared final : public ceres::EvaluationCallback {
  void PrepareForEvaluation(bool evaluate_jacobians, bool is_new) override {
    doubled = 2.0 * *x;
    jacobians_ready = evaluate_jacobians && is_new;
  }
  const double* x;
  double doubled = 0.0;
  bool jacobians_ready = false;
};

TEST(ProblemLinearizer, EvaluationCallback) {
  double x = 3.0;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Root, 1, 1>(new Root), nullptr, &x);
  Shared shared;
  shared.x = &x;
  ProblemLinearizer::Options options;
  options.evaluation_callback = &shared;
  ProblemLinearizer linearizer(&problem, options);
  LinearizationParts parts;
  parts.gradient = true;
  Linearization at_x;
  std::string error;
  ASSERT_TRUE(linearizer.Linearize(parts, &at_x, &error));
  EXPECT_EQ(shared.doubled, 6.0);
  EXPECT_TRUE(shared.jacobians_ready);
  double cost = 0.0;
  ASSERT_TRUE(linearizer.Cost(&cost, &error));
  EXPECT_FALSE(shared.jacobians_ready);
}

// An outlier and an inlier of a robust loss, of degree two.
struct Circle {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0] * x[0] + x[1] * x[1] - radius * radius;
    r[1] = x[0] * x[1] - 0.3;
    return true;
  }
  double radius;
};

// The second difference along v holds the weights of x: it is sqrt(rho') r_vv,
// whatever the length of the difference. Weights that moved would add a term of
// first order, which the division by the length enlarges.
TEST(ProblemLinearizer, TrialStepsHaveTheWeightsOfTheLastJacobian) {
  double x[] = {1.1, 0.7};
  ceres::Problem problem;
  for (const double radius : {1.4, 3.0}) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Circle, 2, 2>(new Circle{radius}),
        new ceres::CauchyLoss(0.5),
        x);
  }
  ProblemLinearizer linearizer(&problem, {});
  LinearizationParts parts;
  parts.jacobian = true;
  Linearization at_x;
  std::string error;
  ASSERT_TRUE(linearizer.Linearize(parts, &at_x, &error)) << error;
  const Eigen::Vector2d v(0.4, -0.9);
  Eigen::VectorXd J_v;
  at_x.jacobian->Times(v, &J_v);
  Eigen::Vector4d expected;
  for (const int block : {0, 1}) {
    Eigen::Vector2d r;
    Circle{block == 0 ? 1.4 : 3.0}(x, r.data());
    const double weight = 1.0 / (1.0 + r.squaredNorm() / 0.25);  // rho'
    expected.segment<2>(2 * block) =
        std::sqrt(weight) *
        Eigen::Vector2d(2.0 * v.squaredNorm(), 2.0 * v[0] * v[1]);
  }
  const LinearizeAfter after = AfterOf(&linearizer);
  for (const double h : {1.0, 0.1, 1e-3}) {
    Linearization there;
    ASSERT_TRUE(
        after(h * v, LinearizationParts::LossGradient(), &there, &error));
    const Eigen::VectorXd second =
        2.0 / h * ((there.loss_gradient - at_x.loss_gradient) / h - J_v);
    EXPECT_LT((second - expected).norm(), 1e-14 / (h * h) * 10.0) << h;
    // The cost is that of the robust loss there.
    Eigen::Map<Eigen::Vector2d>(x) += h * v;
    double cost = 0.0;
    ASSERT_TRUE(problem.Evaluate({}, &cost, nullptr, nullptr, nullptr));
    Eigen::Map<Eigen::Vector2d>(x) -= h * v;
    EXPECT_NEAR(there.cost, cost, 1e-14 * cost);
  }
}

}  // namespace problem_linearizer_test
}  // namespace invgrad
