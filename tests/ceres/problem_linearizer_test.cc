#include "invgrad/ceres/problem_linearizer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/crs_matrix.h"
#include "ceres/evaluation_callback.h"
#include "ceres/local_parameterization.h"
#include "ceres/loss_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/product_manifold.h"
#include "gtest/gtest.h"
#include "invgrad/ceres/autodiff_second_order_cost_function.h"

namespace invgrad {
namespace problem_linearizer_test {

using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// The sums are the same as Ceres', in another order: rounding of numbers of the
// size of 1 to 100.
constexpr double kTolerance = 1e-12;

// r_i = scale (sin(i + sum_k (k + 1) a_k) + i b_0 b_last), curved in a and in
// b.
template <int kA, int kB>
struct Mix {
  explicit Mix(double scale) : scale(scale) {}
  template <typename T>
  bool operator()(const T* a, const T* b, T* r) const {
    T sum(0.0);
    for (int k = 0; k < kA; ++k) sum += (k + 1.0) * a[k];
    for (int i = 0; i < 3; ++i) {
      r[i] = scale * (sin(sum + double(i)) + double(i) * b[0] * b[kB - 1]);
    }
    return true;
  }
  double scale;
};

template <int kA, int kB>
ceres::CostFunction* NewMix(double scale) {
  return new AutoDiffSecondOrderCostFunction<Mix<kA, kB>, 3, kA, kB>(
      new Mix<kA, kB>(scale));
}

// Several blocks, of several kinds. The order in which residual blocks name
// them is not the order of the columns.
struct Blocks {
  double x[2] = {0.3, -0.8};
  double q[4] = {0.8, 0.4, -0.4, 0.2};  // unit length
  double e[4] = {0.5, -0.5, 0.5, 0.5};
  double s[3] = {1.1, -0.2, 0.6};
  double pose[7] = {0.1, 0.7, 0.7, 0.1, 2.0, -1.0, 0.5};
  double constant[2] = {0.9, 0.2};
  double frozen[3] = {0.3, 0.4, 0.5};
  double unused[3] = {7.0, 8.0, 9.0};

  void AddTo(ceres::Problem* problem) {
    problem->AddParameterBlock(x, 2);
    problem->AddParameterBlock(unused, 3);
    problem->AddParameterBlock(constant, 2);
    problem->AddParameterBlock(q, 4, new ceres::QuaternionManifold);
    problem->AddParameterBlock(e, 4, new ceres::EigenQuaternionManifold);
    problem->AddParameterBlock(s, 3, new ceres::SubsetManifold(3, {1}));
    problem->AddParameterBlock(
        pose,
        7,
        new ceres::ProductManifold<ceres::QuaternionManifold,
                                   ceres::EuclideanManifold<3>>);
    // Constant by a tangent space of size 0.
    problem->AddParameterBlock(
        frozen, 3, new ceres::SubsetManifold(3, {0, 1, 2}));
    problem->SetParameterBlockConstant(constant);
  }
};

// Residuals of size `scale`: losses of scale 1 see inliers and outliers.
void AddResiduals(double scale, Blocks* b, ceres::Problem* problem) {
  problem->AddResidualBlock(NewMix<2, 4>(scale), nullptr, b->x, b->q);
  problem->AddResidualBlock(
      NewMix<4, 2>(scale), new ceres::HuberLoss(1.0), b->e, b->x);
  problem->AddResidualBlock(
      NewMix<7, 3>(scale), new ceres::CauchyLoss(1.0), b->pose, b->s);
  problem->AddResidualBlock(
      NewMix<2, 3>(scale), new ceres::TukeyLoss(1.0), b->constant, b->s);
  problem->AddResidualBlock(
      NewMix<2, 3>(scale),
      new ceres::ScaledLoss(
          new ceres::HuberLoss(0.5), 3.0, ceres::TAKE_OWNERSHIP),
      b->x,
      b->frozen);
  problem->AddResidualBlock(
      NewMix<4, 7>(scale),
      new ceres::ScaledLoss(nullptr, 0.3, ceres::TAKE_OWNERSHIP),
      b->q,
      b->pose);
  // rho'' > 0: the second-order correction.
  problem->AddResidualBlock(
      NewMix<3, 2>(scale), new ceres::TolerantLoss(1.0, 0.5), b->s, b->x);
  // Nothing here can change.
  problem->AddResidualBlock(NewMix<2, 3>(scale),
                            new ceres::SoftLOneLoss(1.0),
                            b->constant,
                            b->frozen);
}

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

void ExpectAgreesWithCeres(ceres::Problem* problem,
                           const ProblemLinearizer::Options& options) {
  ProblemLinearizer linearizer(problem, options);
  ceres::Problem::EvaluateOptions evaluate_options;
  evaluate_options.parameter_blocks = linearizer.parameter_blocks();
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
  ASSERT_EQ(at_x.loss_gradient.size(), linearizer.num_residuals());
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
  const auto column_blocks = at_x.jacobian->ColumnBlocks();
  ASSERT_EQ(column_blocks.size(), linearizer.parameter_blocks().size());
  for (size_t b = 0; b < column_blocks.size(); ++b) {
    Eigen::MatrixXd J_b;
    column_blocks[b]->ToDense(&J_b);
    EXPECT_EQ(
        J_b.cols(),
        problem.ParameterBlockTangentSize(linearizer.parameter_blocks()[b]));
    EXPECT_EQ(J_b,
              J.middleCols(linearizer.column(static_cast<int>(b)), J_b.cols()));
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

// Deprecated, but in the code that exists: Ceres adapts it to a manifold.
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

TEST(ProblemLinearizer, StateAndPlus) {
  Blocks blocks;
  ceres::Problem problem;
  blocks.AddTo(&problem);
  AddResiduals(1.0, &blocks, &problem);
  ProblemLinearizer linearizer(&problem, {});
  EXPECT_EQ(linearizer.parameter_blocks(),
            std::vector<double*>({blocks.x,
                                  blocks.q,
                                  blocks.e,
                                  blocks.pose,
                                  blocks.s,
                                  blocks.unused}));
  EXPECT_EQ(linearizer.num_parameters(), 2 + 3 + 3 + 6 + 2 + 3);
  EXPECT_EQ(linearizer.num_ambient(), 2 + 4 + 4 + 7 + 3 + 3);
  EXPECT_EQ(linearizer.column(3), 8);

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

// A Plus that fails leaves every block as it was.
class FailingManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 3; }
  int TangentSize() const override { return 1; }
  bool Plus(const double*, const double*, double* y) const override {
    y[0] = -1.0;
    return false;
  }
  // Ceres asks for one when the manifold is set, and insists on it.
  bool PlusJacobian(const double*, double* jacobian) const override {
    std::fill_n(jacobian, 3, 1.0);
    return num_calls++ == 0;
  }
  bool Minus(const double*, const double*, double*) const override {
    return false;
  }
  bool MinusJacobian(const double*, double*) const override { return false; }

  mutable int num_calls = 0;
};

TEST(ProblemLinearizer, FailingManifold) {
  Blocks blocks;
  ceres::Problem problem;
  problem.AddParameterBlock(blocks.x, 2);
  problem.AddParameterBlock(blocks.s, 3, new FailingManifold);
  problem.AddResidualBlock(NewMix<2, 3>(1.0), nullptr, blocks.x, blocks.s);
  ProblemLinearizer linearizer(&problem, {});
  const Eigen::VectorXd state = linearizer.State();
  EXPECT_FALSE(linearizer.Plus(Eigen::VectorXd::Ones(3)));
  EXPECT_EQ(linearizer.State(), state);
  LinearizationParts parts;
  parts.gradient = true;
  Linearization at_x;
  std::string error;
  EXPECT_FALSE(linearizer.Linearize(parts, &at_x, &error));
  EXPECT_NE(error.find("PlusJacobian of parameter block 1"), std::string::npos)
      << error;
}

// Residuals of which one is told to misbehave.
struct Misbehaving {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = bad_value * x[0];
    return !fails;
  }
  double bad_value;
  bool fails;
};

std::string LinearizeError(double bad_value, bool fails) {
  double x = 1.0;
  double constant = 1.0;
  ceres::Problem problem;
  using CostFunction = ceres::AutoDiffCostFunction<Misbehaving, 1, 1>;
  problem.AddResidualBlock(
      new CostFunction(new Misbehaving{1.0, false}), nullptr, &constant);
  problem.AddResidualBlock(
      new CostFunction(new Misbehaving{1.0, false}), nullptr, &x);
  const ceres::ResidualBlockId bad = problem.AddResidualBlock(
      new CostFunction(new Misbehaving{bad_value, fails}), nullptr, &x);
  problem.SetParameterBlockConstant(&constant);
  ProblemLinearizer::Options options;
  options.residual_blocks = {bad};
  ProblemLinearizer linearizer(&problem, options);
  LinearizationParts parts;
  parts.gradient = true;
  Linearization at_x;
  std::string error;
  std::string cost_error;
  double cost = 0.0;
  const bool cost_ok = linearizer.Cost(&cost, &cost_error);
  const bool ok = linearizer.Linearize(parts, &at_x, &error);
  EXPECT_EQ(ok, cost_ok);
  EXPECT_EQ(error, cost_error);
  return ok ? "" : error;
}

// The index is that in the problem, not that in the mini-batch.
TEST(ProblemLinearizer, FailuresNameTheResidualBlock) {
  EXPECT_EQ(LinearizeError(1.0, false), "");
  EXPECT_EQ(LinearizeError(1.0, true),
            "residual block 2: the cost function returned false");
  EXPECT_EQ(LinearizeError(std::nan(""), false),
            "residual block 2: a residual is not finite");
  // 1e200 is finite, its square is not.
  EXPECT_EQ(LinearizeError(1e200, false),
            "residual block 2: the cost is not finite");
}

// d/dx sqrt(x) at 0: the residual is finite, the Jacobian is not.
struct Root {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = sqrt(x[0]);
    return true;
  }
};

TEST(ProblemLinearizer, JacobianNotFinite) {
  double x = 0.0;
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Root, 1, 1>(new Root), nullptr, &x);
  ProblemLinearizer linearizer(&problem, {});
  LinearizationParts parts;
  Linearization at_x;
  std::string error;
  EXPECT_TRUE(linearizer.Linearize(parts, &at_x, &error));
  parts.gradient = true;
  EXPECT_FALSE(linearizer.Linearize(parts, &at_x, &error));
  EXPECT_NE(error.find("residual block 0"), std::string::npos) << error;
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

// The blocks whose Plus is linear, robust losses included.
struct LinearPlus {
  double x[2] = {0.3, -0.8};
  double s[3] = {1.1, -0.2, 0.6};
  double y[2] = {0.4, 0.9};
  double constant[2] = {0.9, 0.2};
  ceres::Problem problem;

  explicit LinearPlus(double scale) {
    problem.AddParameterBlock(x, 2);
    problem.AddParameterBlock(y, 2, new ceres::EuclideanManifold<2>);
    problem.AddParameterBlock(s, 3, new ceres::SubsetManifold(3, {1}));
    problem.AddResidualBlock(NewMix<2, 3>(scale), nullptr, x, s);
    problem.AddResidualBlock(
        NewMix<3, 2>(scale), new ceres::HuberLoss(1.0), s, y);
    problem.AddResidualBlock(
        NewMix<2, 2>(scale), new ceres::CauchyLoss(1.0), y, x);
    problem.AddResidualBlock(
        NewMix<2, 2>(scale), new ceres::TukeyLoss(4.0), constant, x);
    problem.AddResidualBlock(
        NewMix<2, 2>(scale), new ceres::TolerantLoss(1.0, 0.5), x, constant);
    // No Hessian can be asked of this one, and none is needed.
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Root, 1, 2>(new Root),
        nullptr,
        constant);
    problem.SetParameterBlockConstant(constant);
  }
};

TEST(ProblemLinearizer, HessianIsTheDerivativeOfTheGradient) {
  for (const double scale : {0.1, 1.0, 30.0}) {
    SCOPED_TRACE(scale);
    LinearPlus p(scale);
    ProblemLinearizer linearizer(&p.problem, {});
    const int n = linearizer.num_parameters();
    ASSERT_EQ(n, 6);
    LinearizationParts parts;
    parts.hessian = true;
    Linearization at_x;
    std::string error;
    ASSERT_TRUE(linearizer.Linearize(parts, &at_x, &error)) << error;

    parts.hessian = false;
    parts.gradient = true;
    const Eigen::VectorXd state = linearizer.State();
    constexpr double kStep = 1e-5;
    Eigen::MatrixXd expected(n, n);
    for (int i = 0; i < n; ++i) {
      Linearization ahead;
      Linearization behind;
      Eigen::VectorXd step = Eigen::VectorXd::Zero(n);
      step[i] = kStep;
      ASSERT_TRUE(linearizer.Plus(step));
      ASSERT_TRUE(linearizer.Linearize(parts, &ahead, &error));
      linearizer.SetState(state);
      ASSERT_TRUE(linearizer.Plus(-step));
      ASSERT_TRUE(linearizer.Linearize(parts, &behind, &error));
      linearizer.SetState(state);
      expected.col(i) = (ahead.gradient - behind.gradient) / (2.0 * kStep);
    }
    // Truncation h^2/6 times a fourth derivative (below 1e3 relative to the
    // Hessian), rounding epsilon / h: both below 1e-7.
    EXPECT_LT((at_x.hessian - expected).norm(), 1e-7 * expected.norm());
    EXPECT_LT((at_x.hessian - at_x.hessian.transpose()).norm(),
              1e-14 * expected.norm());
  }
}

std::string HessianError(ceres::Problem* problem) {
  ProblemLinearizer linearizer(problem, {});
  LinearizationParts parts;
  parts.hessian = true;
  Linearization at_x;
  std::string error;
  return linearizer.Linearize(parts, &at_x, &error) ? "" : error;
}

TEST(ProblemLinearizer, HessianNeedsSecondOrderCostFunctions) {
  LinearPlus p(1.0);
  EXPECT_EQ(HessianError(&p.problem), "");
  p.problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Root, 1, 2>(new Root), nullptr, p.x);
  const std::string error = HessianError(&p.problem);
  EXPECT_NE(error.find("residual block 6"), std::string::npos) << error;
  EXPECT_NE(error.find("AutoDiffSecondOrderCostFunction"), std::string::npos);
}

TEST(ProblemLinearizer, HessianRefusesACurvedPlus) {
  // At the identity, where the PlusJacobian of the quaternions has the same
  // entries as that of a subset.
  double q[4] = {1.0, 0.0, 0.0, 0.0};
  double x[2] = {0.3, -0.8};
  ceres::Problem problem;
  problem.AddResidualBlock(NewMix<2, 4>(1.0), nullptr, x, q);
  EXPECT_EQ(HessianError(&problem), "");
  problem.SetManifold(q, new ceres::QuaternionManifold);
  const std::string error = HessianError(&problem);
  EXPECT_NE(error.find("residual block 0"), std::string::npos) << error;
  EXPECT_NE(error.find("parameter block 1"), std::string::npos) << error;
  // What is linear in another guise is accepted, whatever its scale.
  x[0] = 1e6;
  problem.SetManifold(
      q,
      new ceres::ProductManifold<ceres::EuclideanManifold<2>,
                                 ceres::SubsetManifold>(
          ceres::EuclideanManifold<2>(), ceres::SubsetManifold(2, {0})));
  problem.SetManifold(x, new ceres::EuclideanManifold<2>);
  EXPECT_EQ(HessianError(&problem), "");
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

}  // namespace problem_linearizer_test
}  // namespace invgrad
