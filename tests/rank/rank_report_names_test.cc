// How the rank report names parameters: components of blocks with a manifold,
// and parameters that coincide.
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/autodiff_manifold.h"
#include "ceres/manifold.h"
#include "ceres/problem.h"
#include "ceres/product_manifold.h"
#include "ceres/rotation.h"
#include "ceres/sphere_manifold.h"
#include "gtest/gtest.h"
#include "invgrad/rank_report.h"
#include "tests/rank/rank_problems.h"

namespace invgrad {
namespace rank_report_names_test {

// The gravity that an attitude sees: a turn about it is open.
struct Gravity {
  template <typename T>
  bool operator()(const T* q, T* r) const {
    const T gravity[] = {T(0.0), T(0.0), T(9.81)};
    ceres::QuaternionRotatePoint(q, gravity, r);
    r[2] -= 9.81;
    return true;
  }
};

TEST(RankReportNames, ARotationHasNoComponentsAtTheIdentityEither) {
  for (const double angle : {0.0, 0.1}) {
    double q[] = {std::cos(angle), 0.0, 0.0, std::sin(angle)};
    ceres::Problem problem;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Gravity, 3, 4>(new Gravity),
        nullptr,
        q);
    problem.SetManifold(q, new ceres::QuaternionManifold);
    const RankReport report = Report(problem);
    EXPECT_EQ(report.rank, 2);
    EXPECT_EQ(report.blocks[0].components, std::vector<int>(3, -1));
    EXPECT_EQ(report.ToText().find("`block 0`["), std::string::npos)
        << report.ToText();
  }
}

// -pi <= angle < pi
struct WrappedAngle {
  template <typename T>
  bool Plus(const T* x, const T* delta, T* y) const {
    using std::floor;
    *y = *x + *delta;
    *y -= 2.0 * M_PI * floor((*y + M_PI) / (2.0 * M_PI));
    return true;
  }
  template <typename T>
  bool Minus(const T* y, const T* x, T* delta) const {
    T difference = *y - *x;
    return Plus(&difference, std::array<T, 1>{T(0.0)}.data(), delta);
  }
};

std::vector<int> ComponentsOf(std::vector<double> x,
                              ceres::Manifold* manifold) {
  ceres::Problem problem;
  const auto size = static_cast<Eigen::Index>(x.size());
  AddPrior(Eigen::MatrixXd::Identity(size, size), x.data(), &problem);
  problem.SetManifold(x.data(), manifold);
  return Report(problem).blocks[0].components;
}

TEST(RankReportNames, ComponentsAreWhatPlusMovesAlone) {
  using Components = std::vector<int>;
  using Pose = ceres::ProductManifold<ceres::EuclideanManifold<3>,
                                      ceres::EigenQuaternionManifold>;
  EXPECT_EQ(ComponentsOf({1.0, -2e9, 0.0, 0.0, 0.0, 0.0, 1.0}, new Pose),
            (Components{0, 1, 2, -1, -1, -1}));
  EXPECT_EQ(ComponentsOf({1.0, 2.0, 3.0}, new ceres::SubsetManifold(3, {1})),
            (Components{0, 2}));
  EXPECT_EQ(ComponentsOf({0.0, 0.0, 1.0}, new ceres::SphereManifold<3>),
            (Components{-1, -1}));
  for (const double angle : {-3.14, 0.0, 1.0, 3.14}) {
    using Angle = ceres::AutoDiffManifold<WrappedAngle, 1, 1>;
    EXPECT_EQ(ComponentsOf({angle}, new Angle), Components{0}) << angle;
  }
}

// Two decays with amplitudes x[C1], x[C2] and rates x[B1], x[B2].
template <int C1, int B1, int C2, int B2>
struct TwoDecays {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    using std::exp;
    for (int i = 0; i < 20; ++i) {
      const double t = 0.1 * i;
      r[i] = x[C1] * exp(-x[B1] * t) + x[C2] * exp(-x[B2] * t) - 1.0;
    }
    return true;
  }
};

template <typename Functor>
std::vector<std::array<int, 2>> EqualPairs() {
  double x[] = {1.0, 1.0, 1.0, 1.0};
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<Functor, 20, 4>(new Functor), nullptr, x);
  std::vector<std::array<int, 2>> pairs;
  for (const auto& equal : Report(problem).equal_parameters) {
    EXPECT_EQ(equal.value, 1.0);
    pairs.push_back(equal.tangents);
  }
  return pairs;
}

TEST(RankReportNames, EqualParametersAreNamedInAnyOrder) {
  using Pairs = std::vector<std::array<int, 2>>;
  EXPECT_EQ((EqualPairs<TwoDecays<0, 2, 1, 3>>()), (Pairs{{0, 1}, {2, 3}}));
  EXPECT_EQ((EqualPairs<TwoDecays<0, 1, 2, 3>>()), (Pairs{{0, 2}, {1, 3}}));
  EXPECT_EQ((EqualPairs<TwoDecays<0, 1, 3, 2>>()), (Pairs{{0, 3}, {1, 2}}));
}

}  // namespace rank_report_names_test
}  // namespace invgrad
