#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Dense"
#include "ceres/loss_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/internal/qr.h"
#include "invgrad/separable.h"
#include "tests/separable/exponentials.h"
#include "tests/support/least_squares.h"

namespace invgrad {
namespace reduced_cost_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

std::unique_ptr<SeparableProblem> Reduce(
    const std::vector<LinearBlock>& linear,
    ceres::Problem* problem,
    const SeparableProblem::Options& options = {}) {
  std::string error;
  auto separable = SeparableProblem::Create(options, linear, problem, &error);
  EXPECT_NE(separable, nullptr) << error;
  return separable;
}

// The only residual block of the reduced problem, at a.
struct At {
  VectorXd f;
  RowMajorMatrix J;
};

At EvaluateAt(const VectorXd& a, SeparableProblem* separable) {
  std::vector<ceres::ResidualBlockId> ids;
  separable->reduced()->GetResidualBlocks(&ids);
  EXPECT_EQ(ids.size(), 1u);
  const ceres::CostFunction* cost =
      separable->reduced()->GetCostFunctionForResidualBlock(ids[0]);
  At at;
  at.f.resize(cost->num_residuals());
  at.J.resize(cost->num_residuals(), a.size());
  const double* parameters = a.data();
  double* jacobian = at.J.data();
  EXPECT_TRUE(cost->Evaluate(&parameters, at.f.data(), &jacobian));
  return at;
}

// Central differences of f, of the fourth order: truncation and rounding errors
// are about 1e-12 at steps of 1e-3.
MatrixXd Differences(const VectorXd& a, SeparableProblem* separable) {
  const double h = 1e-3;
  MatrixXd J(EvaluateAt(a, separable).f.size(), a.size());
  for (Eigen::Index k = 0; k < a.size(); ++k) {
    const auto f = [&](double steps) {
      VectorXd moved = a;
      moved[k] += steps * h;
      return EvaluateAt(moved, separable).f;
    };
    J.col(k) = (8.0 * (f(1.0) - f(-1.0)) - f(2.0) + f(-2.0)) / (12.0 * h);
  }
  return J;
}

constexpr double kDifferences = 1e-9;

TEST(ReducedCost, IsTheMinimumOverTheLinearParameters) {
  Exponentials data(20);
  ceres::Problem problem;
  data.AddTo(&problem);
  const auto separable = Reduce({{data.c.data(), {}}}, &problem);
  const MatrixXd Phi = data.Phi();
  const VectorXd c = LeastSquares(Phi, data.y);
  const At at = EvaluateAt(data.a, separable.get());
  EXPECT_LE((at.f - (Phi * c - data.y)).norm(), 1e-13);
  std::string error;
  ASSERT_TRUE(separable->SolveLinear(&error)) << error;
  EXPECT_LE((data.c - c).norm(), 1e-12 * c.norm());
  EXPECT_EQ(separable->rank(), 2);
  EXPECT_EQ(separable->num_linear(), 2);
}

TEST(ReducedCost, JacobianOfGolubAndPereyraIsExact) {
  Exponentials data(20, 0.3);  // a large residual
  ceres::Problem problem;
  data.AddTo(&problem);
  SeparableProblem::Options options;
  options.is_golub_pereyra = true;
  const auto separable = Reduce({{data.c.data(), {}}}, &problem, options);
  const At at = EvaluateAt(data.a, separable.get());
  const MatrixXd J = Differences(data.a, separable.get());
  EXPECT_LE((at.J - J).norm(), kDifferences);
}

// It is J without a part in the range of Phi: Phi^T J_kaufman = 0, and the
// gradient is the same.
TEST(ReducedCost, JacobianOfKaufmanHasTheGradientAndTheProjection) {
  Exponentials data(20, 0.3);
  ceres::Problem problem;
  data.AddTo(&problem);
  const auto separable = Reduce({{data.c.data(), {}}}, &problem);
  const At at = EvaluateAt(data.a, separable.get());
  const MatrixXd J = Differences(data.a, separable.get());
  const MatrixXd Phi = data.Phi();
  const MatrixXd Q = Orthonormalized(Phi);
  EXPECT_LE((at.J - (J - Q * (Q.transpose() * J))).norm(), kDifferences);
  EXPECT_GE((at.J - J).norm(), 1e-2);
  EXPECT_LE((at.J.transpose() * at.f - J.transpose() * at.f).norm(),
            kDifferences);
}

// c' = B c with another basis of the same functions.
struct Recombined {
  Eigen::Matrix2d B;
  ExponentialSample<2> sample;
  template <typename T>
  bool operator()(const T* c, const T* a, T* r) const {
    const T mixed[2] = {B(0, 0) * c[0] + B(0, 1) * c[1],
                        B(1, 0) * c[0] + B(1, 1) * c[1]};
    return sample(mixed, a, r);
  }
};

TEST(ReducedCost, DoesNotDependOnTheBasis) {
  Exponentials data(20, 0.3);
  ceres::Problem problem;
  data.AddTo(&problem);
  Eigen::Matrix2d B;
  B << 2.0, -1.0, 1e3, 5.0;
  ceres::Problem recombined;
  for (Eigen::Index i = 0; i < data.t.size(); ++i) {
    recombined.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Recombined, 1, 2, 2>(
            new Recombined{B, {data.t[i], data.y[i]}}),
        nullptr,
        data.c.data(),
        data.a.data());
  }
  for (const bool is_golub_pereyra : {false, true}) {
    SeparableProblem::Options options;
    options.is_golub_pereyra = is_golub_pereyra;
    const At a = EvaluateAt(
        data.a, Reduce({{data.c.data(), {}}}, &problem, options).get());
    const At b = EvaluateAt(
        data.a, Reduce({{data.c.data(), {}}}, &recombined, options).get());
    // cond(Phi B) is 1e3, and c has 1e-13.
    EXPECT_LE((a.f - b.f).norm(), 1e-13);
    EXPECT_LE((a.J - b.J).norm(), 1e-11);
  }
}

// Equal rates: two equal columns. The cost is that of one exponential.
TEST(ReducedCost, OfDependentFeatures) {
  Exponentials data(20);
  data.a = {0.5, 0.5};
  ceres::Problem problem;
  data.AddTo(&problem);
  const auto separable = Reduce({{data.c.data(), {}}}, &problem);
  const At at = EvaluateAt(data.a, separable.get());
  const VectorXd phi = (-0.5 * data.t.array()).exp();
  const VectorXd f = phi * (phi.dot(data.y) / phi.squaredNorm()) - data.y;
  EXPECT_LE((at.f - f).norm(), 1e-13);
  std::string error;
  ASSERT_TRUE(separable->SolveLinear(&error)) << error;
  EXPECT_EQ(separable->rank(), 1);
  // The least norm of all c with the same sum.
  EXPECT_NEAR(data.c[0], data.c[1], 1e-13);
  EXPECT_NEAR(data.c.sum(), phi.dot(data.y) / phi.squaredNorm(), 1e-13);
}

// One sample for two amplitudes: the reduced residual is zero, and so is its
// Jacobian.
TEST(ReducedCost, OfMoreFeaturesThanSamples) {
  Exponentials data(1);
  ceres::Problem problem;
  data.AddTo(&problem);
  for (const bool is_golub_pereyra : {false, true}) {
    SeparableProblem::Options options;
    options.is_golub_pereyra = is_golub_pereyra;
    const auto separable = Reduce({{data.c.data(), {}}}, &problem, options);
    const At at = EvaluateAt(data.a, separable.get());
    EXPECT_LE(at.f.norm(), 1e-15);
    EXPECT_LE(at.J.norm(), 1e-15);
    std::string error;
    EXPECT_TRUE(separable->SolveLinear(&error)) << error;
    EXPECT_EQ(separable->rank(), 1);
  }
}

using MakeLoss = std::function<ceres::LossFunction*()>;

const std::vector<MakeLoss>& Losses() {
  static const auto& losses = *new std::vector<MakeLoss>{
      [] { return new ceres::HuberLoss(0.05); },
      [] { return new ceres::SoftLOneLoss(0.05); },
      [] { return new ceres::CauchyLoss(0.3); },
      [] { return new ceres::ArctanLoss(1.0); },
      [] { return new ceres::TukeyLoss(0.4); },  // outliers have no weight
      [] { return new ceres::TolerantLoss(0.3, 0.1); }};
  return losses;
}

// Gradient of the reduced cost, and its stationarity in c.
TEST(ReducedCost, OfRobustLossesHasTheGradient) {
  for (const MakeLoss& make_loss : Losses()) {
    Exponentials data(25, 0.05, 0.5);
    ceres::Problem problem;
    data.AddTo(&problem, make_loss);
    const auto separable = Reduce({{data.c.data(), {}}}, &problem);
    const At at = EvaluateAt(data.a, separable.get());
    const MatrixXd J = Differences(data.a, separable.get());
    const Eigen::Vector2d gradient = J.transpose() * at.f;
    EXPECT_LE((at.J.transpose() * at.f - gradient).norm(), 1e-7);
    std::string error;
    ASSERT_TRUE(separable->SolveLinear(&error)) << error;
    double cost;
    std::vector<double> full;
    ceres::Problem::EvaluateOptions of_c;
    of_c.parameter_blocks = {data.c.data()};
    ASSERT_TRUE(problem.Evaluate(of_c, &cost, nullptr, &full, nullptr));
    EXPECT_NEAR(cost, 0.5 * at.f.squaredNorm(), 1e-13);
    EXPECT_LE(std::hypot(full[0], full[1]), 1e-8);
  }
}

TEST(ReducedCost, OfRobustLossesHasTheMinimumOfTheProblem) {
  for (const MakeLoss& make_loss : Losses()) {
    Exponentials data(40, 0.05, 0.5);
    ceres::Problem problem;
    data.AddTo(&problem, make_loss);
    const auto separable = Reduce({{data.c.data(), {}}}, &problem);
    ceres::Solver::Summary summary;
    ceres::Solve(Exact(), separable->reduced(), &summary);
    std::string error;
    ASSERT_TRUE(separable->SolveLinear(&error)) << error;
    // A solve of the whole problem from there changes nothing.
    const Eigen::Vector2d a = data.a;
    const Eigen::Vector2d c = data.c;
    ceres::Solver::Summary full;
    ceres::Solve(Exact(), &problem, &full);
    EXPECT_NEAR(full.final_cost, summary.final_cost, 1e-11);
    EXPECT_LE((data.a - a).norm() + (data.c - c).norm(), 2e-4);
  }
}

// Close to the L1 norm. The gradient's terms are of the size of the width.
TEST(ReducedCost, OfNarrowLossesIsStationaryInTheLinearParameters) {
  for (const double width : {0.03, 1e-3, 1e-6}) {
    for (int k = 0; k < 20; ++k) {
      SCOPED_TRACE(width);
      SCOPED_TRACE(k);
      Exponentials data(25, 0.05, 0.5);
      data.a = {0.5 + 0.15 * k, 0.1 + 0.02 * k};
      ceres::Problem problem;
      data.AddTo(&problem, [width] { return new ceres::HuberLoss(width); });
      const auto separable = Reduce({{data.c.data(), {}}}, &problem);
      std::string error;
      ASSERT_TRUE(separable->SolveLinear(&error)) << error;
      std::vector<double> gradient;
      ceres::Problem::EvaluateOptions of_c;
      of_c.parameter_blocks = {data.c.data()};
      ASSERT_TRUE(problem.Evaluate(of_c, nullptr, nullptr, &gradient, nullptr));
      EXPECT_LE(std::hypot(gradient[0], gradient[1]), 1e-4 * width);
    }
  }
}

// y = c_0 + c_1 exp(-a t)
struct DecayToALevel {
  double t;
  double y;

  template <typename T>
  bool operator()(const T* c, const T* a, T* r) const {
    using std::exp;
    r[0] = c[0] + c[1] * exp(-a[0] * t) - y;
    return true;
  }
};

// From c = 0 all rows lie beyond the width, where the loss is constant and no
// row has a weight.
TEST(ReducedCost, OfARedescendingLossLeavesThePlateau) {
  for (const double level : {0.0, 20.0}) {
    double a = 0.4;
    double c[2] = {level, 0.0};
    ceres::Problem problem;
    for (int i = 0; i < 20; ++i) {
      const double y = 20.0 + 3.0 * std::exp(-0.5 * i) + (i == 4 ? 5.0 : 0.0);
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<DecayToALevel, 1, 2, 1>(
              new DecayToALevel{1.0 * i, y}),
          new ceres::TukeyLoss(1.0),
          c,
          &a);
    }
    const auto separable = Reduce({{c, {}}}, &problem);
    ceres::Solver::Summary summary;
    ceres::Solve(Exact(), separable->reduced(), &summary);
    std::string error;
    ASSERT_TRUE(separable->SolveLinear(&error)) << error;
    EXPECT_EQ(separable->rank(), 2);
    EXPECT_NEAR(c[0], 20.0, 1e-6);
    EXPECT_NEAR(c[1], 3.0, 1e-6);
    EXPECT_NEAR(a, 0.5, 1e-6);
    EXPECT_NEAR(summary.final_cost, 1.0 / 6.0, 1e-12);  // of the outlier
  }
}

}  // namespace reduced_cost_test
}  // namespace invgrad
