#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Dense"
#include "ceres/autodiff_cost_function.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "ceres/sphere_manifold.h"
#include "gtest/gtest.h"
#include "invgrad/random.h"
#include "invgrad/rank_report.h"
#include "invgrad/rules.h"
#include "invgrad/separable.h"
#include "invgrad/update_callback.h"
#include "tests/separable/exponentials.h"
#include "tests/support/least_squares.h"

namespace invgrad {
namespace separable_problem_test {

using Eigen::VectorXd;

ceres::Solver::Summary Solve(const std::vector<LinearBlock>& linear,
                             ceres::Problem* problem) {
  std::string error;
  const auto separable = SeparableProblem::Create({}, linear, problem, &error);
  EXPECT_NE(separable, nullptr) << error;
  ceres::Solver::Summary summary;
  ceres::Solve(Exact(), separable->reduced(), &summary);
  EXPECT_TRUE(separable->SolveLinear(&error)) << error;
  return summary;
}

double Cost(ceres::Problem* problem) {
  double cost = -1.0;
  EXPECT_TRUE(problem->Evaluate({}, &cost, nullptr, nullptr, nullptr));
  return cost;
}

TEST(SeparableProblem, HasTheMinimumOfTheProblem) {
  Exponentials data(20);
  ceres::Problem problem;
  data.AddTo(&problem);
  data.c = {100.0, -100.0};  // has no influence
  const ceres::Solver::Summary summary = Solve({{data.c.data(), {}}}, &problem);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_NEAR(Cost(&problem), summary.final_cost, 1e-15);
  const Eigen::Vector2d a = data.a;
  const Eigen::Vector2d c = data.c;
  ceres::Solver::Summary full;
  ceres::Solve(Exact(), &problem, &full);
  EXPECT_NEAR(full.final_cost, summary.final_cost, 1e-15);
  EXPECT_LE((data.a - a).norm() + (data.c - c).norm(), 1e-7);
}

// b0 exp(-b1 t), one block: the linear component has no place in the reduced
// step, and the bound of the other holds.
struct Decay {
  double t;
  template <typename T>
  bool operator()(const T* b, T* r) const {
    using std::exp;
    r[0] = b[0] * exp(-b[1] * t) - 3.0 * std::exp(-0.5 * t);
    return true;
  }
};

void AddDecay(double* b, ceres::Problem* problem) {
  for (int i = 0; i < 10; ++i) {
    problem->AddResidualBlock(
        new ceres::AutoDiffCostFunction<Decay, 1, 2>(new Decay{0.3 * i}),
        nullptr,
        b);
  }
}

TEST(SeparableProblem, OfABlockWithBothKinds) {
  for (const double bound : {0.1, 0.7}) {
    double b[2] = {1.0, 2.0};
    ceres::Problem problem;
    AddDecay(b, &problem);
    problem.SetParameterLowerBound(b, 1, bound);
    const ceres::Solver::Summary summary = Solve({{b, {0}}}, &problem);
    EXPECT_EQ(summary.num_effective_parameters, 1);
    EXPECT_NEAR(b[1], std::max(0.5, bound), 1e-12);
    if (bound < 0.5) {
      EXPECT_NEAR(b[0], 3.0, 1e-12);
    } else {
      const double at_bound = Cost(&problem);
      ceres::Solver::Summary full;
      ceres::Solve(Exact(), &problem, &full);
      EXPECT_NEAR(full.final_cost, at_bound, 1e-12);
    }
  }
}

// A linear parameter that shares a block with others has no part in the size of
// the block, a share of which is Ceres' smallest step.
TEST(SeparableProblem, OfABlockWithBothKindsNeedsNoStart) {
  double b[2] = {1e9, 2.0};
  ceres::Problem problem;
  AddDecay(b, &problem);
  std::string error;
  const auto separable =
      SeparableProblem::Create({}, {{b, {0}}}, &problem, &error);
  ASSERT_NE(separable, nullptr) << error;
  ceres::Solver::Summary summary;
  ceres::Solve({}, separable->reduced(), &summary);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  ASSERT_TRUE(separable->SolveLinear(&error)) << error;
  EXPECT_NEAR(b[0], 3.0, 1e-4);
  EXPECT_NEAR(b[1], 0.5, 1e-4);
}

// Points seen by affine cameras, x = u . X + v: a component a point. The
// directions u are on the unit sphere; v is nonlinear by choice.
struct Projection {
  double x;
  template <typename T>
  bool operator()(const T* u, const T* v, const T* X, T* r) const {
    r[0] = u[0] * X[0] + u[1] * X[1] + u[2] * X[2] + v[0] - x;
    return true;
  }
};

struct AffineCameras {
  static constexpr int kCameras = 9;
  static constexpr int kPoints = 20;
  std::array<Eigen::Vector3d, kCameras> u;
  std::array<double, kCameras> v;
  std::array<Eigen::Vector3d, kPoints> X;

  explicit AffineCameras(ceres::Problem* problem, double error = 0.1) {
    NumpyRandom random(3);
    for (int i = 0; i < kCameras; ++i) {
      u[i] = random.Normal(3).normalized();
      v[i] = random.Normal(1)[0];
    }
    for (Eigen::Vector3d& point : X) point = random.Normal(3);
    for (int j = 0; j < kPoints; ++j) {
      for (int i = 0; i < kCameras; ++i) {
        const double x = u[i].dot(X[j]) + v[i] + 0.01 * random.Normal(1)[0];
        problem->AddResidualBlock(
            new ceres::AutoDiffCostFunction<Projection, 1, 3, 1, 3>(
                new Projection{x}),
            nullptr,
            u[i].data(),
            &v[i],
            X[j].data());
      }
    }
    for (int i = 0; i < kCameras; ++i) {
      problem->SetManifold(u[i].data(), new ceres::SphereManifold<3>);
      if (i > 2) u[i] = (u[i] + error * random.Normal(3)).normalized();
    }
    for (int i = 0; i < 3; ++i) {  // fix the coordinates
      problem->SetParameterBlockConstant(u[i].data());
      problem->SetParameterBlockConstant(&v[i]);
    }
  }

  std::vector<LinearBlock> Points() {
    std::vector<LinearBlock> linear;
    for (Eigen::Vector3d& point : X) linear.push_back({point.data(), {}});
    return linear;
  }
};

TEST(SeparableProblem, HasAComponentForEachPoint) {
  ceres::Problem problem;
  AffineCameras cameras(&problem);
  std::string error;
  const auto separable =
      SeparableProblem::Create({}, cameras.Points(), &problem, &error);
  ASSERT_NE(separable, nullptr) << error;
  EXPECT_EQ(separable->num_components(), AffineCameras::kPoints);
  EXPECT_EQ(separable->reduced()->NumResidualBlocks(), AffineCameras::kPoints);
  EXPECT_EQ(separable->num_linear(), 3 * AffineCameras::kPoints);
  ceres::Solver::Summary summary;
  ceres::Solve(Exact(), separable->reduced(), &summary);
  // Six directions of the sphere and six offsets.
  EXPECT_EQ(summary.num_effective_parameters_reduced, 18);
  ASSERT_TRUE(separable->SolveLinear(&error)) << error;
  EXPECT_EQ(separable->rank(), 3 * AffineCameras::kPoints);
  const double cost = Cost(&problem);
  EXPECT_NEAR(cost, summary.final_cost, 1e-13);
  ceres::Solver::Summary full;
  ceres::Solve(Exact(), &problem, &full);
  EXPECT_NEAR(full.final_cost, cost, 1e-12);
  for (const Eigen::Vector3d& u : cameras.u) EXPECT_NEAR(u.norm(), 1.0, 1e-14);
}

struct Prior {
  template <typename T>
  bool operator()(const T* a, T* r) const {
    r[0] = 0.1 * (a[0] - 3.0);
    r[1] = 0.1 * (a[1] - 1.0);
    return true;
  }
};

// A prior on the nonlinear parameters is outside of all components.
TEST(SeparableProblem, KeepsOtherResidualBlocks) {
  Exponentials data(20);
  ceres::Problem problem;
  data.AddTo(&problem);
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Prior, 2, 2>(new Prior),
      new ceres::CauchyLoss(0.1),
      data.a.data());
  const ceres::Solver::Summary summary = Solve({{data.c.data(), {}}}, &problem);
  EXPECT_EQ(summary.num_residual_blocks, 2);
  ceres::Solver::Summary full;
  ceres::Solve(Exact(), &problem, &full);
  EXPECT_NEAR(full.final_cost, summary.final_cost, 1e-13);
}

// A problem without nonlinear parameters is solved at once, and a constant
// linear block stays.
TEST(SeparableProblem, OfLinearParametersAlone) {
  Exponentials data(20);
  ceres::Problem problem;
  data.AddTo(&problem);
  problem.SetParameterBlockConstant(data.a.data());
  const ceres::Solver::Summary summary = Solve({{data.c.data(), {}}}, &problem);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_NEAR(Cost(&problem), summary.final_cost, 1e-15);
  const Eigen::Vector2d c = data.c;
  ceres::Solver::Summary full;
  ceres::Solve(Exact(), &problem, &full);
  EXPECT_LE((data.c - c).norm(), 1e-12);

  problem.SetParameterBlockConstant(data.c.data());
  problem.SetParameterBlockVariable(data.a.data());
  data.c = {1.0, 1.0};
  Solve({{data.c.data(), {}}}, &problem);
  EXPECT_EQ(data.c, Eigen::Vector2d(1.0, 1.0));
}

// Values of constant blocks count, too.
TEST(SeparableProblem, FollowsConstantBlocks) {
  Exponentials data(20);
  ceres::Problem problem;
  data.AddTo(&problem);
  problem.SetParameterBlockConstant(data.a.data());
  std::string error;
  const auto separable =
      SeparableProblem::Create({}, {{data.c.data(), {}}}, &problem, &error);
  ASSERT_NE(separable, nullptr) << error;
  ASSERT_TRUE(separable->SolveLinear(&error)) << error;
  data.a = {1.5, 0.3};
  ASSERT_TRUE(separable->SolveLinear(&error)) << error;
  const Eigen::Vector2d c = LeastSquares(data.Phi(), data.y);
  EXPECT_LE((data.c - c).norm(), 1e-12);
}

struct Line {
  double t;
  template <typename T>
  bool operator()(const T* x, T* r) const {
    r[0] = x[0] + t * x[1] - 1.0 - 2.0 * t;
    return true;
  }
};

// The same with a block that no residual block but these has.
TEST(SeparableProblem, OfAProblemWithoutOtherBlocks) {
  double x[2] = {5.0, 5.0};
  ceres::Problem problem;
  for (const double t : {0.0, 1.0, 2.0}) {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Line, 1, 2>(new Line{t}), nullptr, x);
  }
  const ceres::Solver::Summary summary = Solve({{x, {}}}, &problem);
  EXPECT_EQ(summary.termination_type, ceres::CONVERGENCE);
  EXPECT_NEAR(summary.final_cost, 0.0, 1e-28);
  EXPECT_NEAR(x[0], 1.0, 1e-13);
  EXPECT_NEAR(x[1], 2.0, 1e-13);
}

// The rank report of the user's problem names what the residuals leave open.
TEST(SeparableProblem, LeavesTheRankReportToNameWhatIsUndetermined) {
  Exponentials data(20);
  data.a = {0.5, 0.5};
  ceres::Problem problem;
  data.AddTo(&problem);
  problem.SetParameterBlockConstant(data.a.data());
  std::string error;
  const auto separable =
      SeparableProblem::Create({}, {{data.c.data(), {}}}, &problem, &error);
  ASSERT_NE(separable, nullptr) << error;
  ASSERT_TRUE(separable->SolveLinear(&error)) << error;
  EXPECT_EQ(separable->rank(), 1);
  EXPECT_NEAR(data.c[0], data.c[1], 1e-13);
  RankReport report;
  ASSERT_TRUE(ComputeRankReport({}, problem, &report, &error)) << error;
  EXPECT_EQ(report.num_undetermined(), 1);
  const VectorXd motion = report.undetermined[0].parts[0].motion;
  EXPECT_LE((motion - Eigen::Vector2d(1.0, -1.0)).norm(), 1e-13);
}

// Proposals of a rule on the reduced problem.
TEST(SeparableProblem, TakesAnUpdateCallback) {
  Exponentials data(20);
  ceres::Problem problem;
  data.AddTo(&problem);
  std::string error;
  const auto separable =
      SeparableProblem::Create({}, {{data.c.data(), {}}}, &problem, &error);
  ASSERT_NE(separable, nullptr) << error;
  auto rule = MakeRule("half_inverse:step_size=auto:rho=1");
  UpdateCallback callback(rule.get(), separable->reduced());
  ceres::Solver::Options options = Exact();
  callback.AddTo(&options);
  ceres::Solver::Summary summary;
  ceres::Solve(options, separable->reduced(), &summary);
  EXPECT_GT(callback.summary().num_proposed, 0);
  ASSERT_TRUE(separable->SolveLinear(&error)) << error;
  ceres::Solver::Summary full;
  ceres::Solve(Exact(), &problem, &full);
  EXPECT_NEAR(full.final_cost, Cost(&problem), 1e-12);
}

}  // namespace separable_problem_test
}  // namespace invgrad
