// Pull-backs by derivatives, and what physical gradients have in common.
#include "invgrad/inverse/simulator_pull_back.h"

#include <cmath>
#include <memory>
#include <utility>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/inverse_simulator.h"
#include "tests/inverse/pull_one_back.h"

namespace invgrad {
namespace simulator_pull_back_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;
using Result = SimulatorPullBack::Result;

constexpr SimulatorWay kAllWays[] = {SimulatorWay::kAdjoint,
                                     SimulatorWay::kInverseGradient,
                                     SimulatorWay::kHalfInverse,
                                     SimulatorWay::kInverse};

// Another map in front: x = A(u) = (2 u0, u1 + u0^3), and Q = Bend o A.
struct BendOfCubic {
  template <typename T>
  bool operator()(const T* u, T* y) const {
    const T x[] = {2.0 * u[0], u[1] + u[0] * u[0] * u[0]};
    return Bend()(x, y);
  }
};

Vector2d CubicInverse(const Vector2d& x) {
  const double u0 = 0.5 * x[0];
  return {u0, x[1] - u0 * u0 * u0};
}

// J of Bend.
MatrixXd BendJacobian(const Vector2d& x) {
  return (MatrixXd(2, 2) << std::exp(x[0]), 0.0, 2.0 * x[0], 1.0).finished();
}

TEST(SimulatorPullBackTest, AdjointIsTheTransposedJacobian) {
  const Vector2d x(0.4, -1.0);
  const Vector2d d_y(0.3, -2.0);
  const SimulatorPullBack pull_back(
      MakeSimulator<2, 2>(Bend()), nullptr, Way(SimulatorWay::kAdjoint));
  const Pulled pulled = Pull(pull_back, x, d_y);
  EXPECT_LT((pulled.d_x - BendJacobian(x).transpose() * d_y).norm(), 1e-15);
  EXPECT_EQ(pulled.result.source, PullBackSource::kDerivative);
  EXPECT_EQ(pulled.result.why, "");
}

// I - 2 v v^T / |v|^2, orthogonal.
MatrixXd Reflection(const VectorXd& v) {
  return MatrixXd::Identity(v.size(), v.size()) -
         2.0 / v.squaredNorm() * v * v.transpose();
}

// A = U diag(4, 1, 1e-3) V^T, tall and wide: V s^-kappa U^T of what is kept.
TEST(SimulatorPullBackTest, GradientsAreTruncatedPowersOfTheJacobian) {
  const MatrixXd U = Reflection(VectorXd::LinSpaced(5, -1.0, 2.0)).leftCols(3);
  const MatrixXd V = Reflection(VectorXd::LinSpaced(3, 1.0, 2.0));
  const Eigen::Vector3d s(4.0, 1.0, 1e-3);
  const MatrixXd A = U * s.asDiagonal() * V.transpose();
  for (const bool is_wide : {false, true}) {
    const MatrixXd& left = is_wide ? V : U;
    const MatrixXd& right = is_wide ? U : V;
    const auto simulator = MakeLinear(is_wide ? MatrixXd(A.transpose()) : A);
    const VectorXd d_y =
        VectorXd::LinSpaced(simulator->num_outputs(), -1.0, 2.0);
    const VectorXd x = VectorXd::Ones(simulator->num_inputs());
    const struct {
      double truncation;
      int rank;
    } cases[] = {{0.0, 3}, {2e-4, 3}, {3e-4, 2}, {0.24, 2}, {0.26, 1}};
    for (const auto& c : cases) {
      for (const double kappa : {0.5, 1.0}) {
        VectorXd powers = VectorXd::Zero(3);
        powers.head(c.rank) = s.head(c.rank).array().pow(-kappa);
        const VectorXd expected =
            right * powers.asDiagonal() * left.transpose() * d_y;
        const SimulatorWay way = kappa == 1.0 ? SimulatorWay::kInverseGradient
                                              : SimulatorWay::kHalfInverse;
        const SimulatorPullBack pull_back(
            simulator, nullptr, Way(way, c.truncation));
        // The rounding of 1e-3 in a matrix of norm 4: 1e-12 of the result.
        EXPECT_LT((Pull(pull_back, x, d_y).d_x - expected).norm(),
                  1e-11 * expected.norm());
      }
    }
  }
}

// Powers of two, so that s = tau s_max is met exactly.
TEST(SimulatorPullBackTest, ASingularValueAtTheThresholdIsDropped) {
  const auto simulator =
      MakeLinear(Eigen::Vector3d(4.0, 1.0, 0.5).asDiagonal());
  const VectorXd ones = VectorXd::Ones(3);
  const auto pulled = [&](SimulatorWay way, double truncation) {
    return Pull(SimulatorPullBack(simulator, nullptr, Way(way, truncation)),
                ones,
                ones)
        .d_x;
  };
  const SimulatorWay inverse = SimulatorWay::kInverseGradient;
  const SimulatorWay half = SimulatorWay::kHalfInverse;
  EXPECT_LT((pulled(inverse, 0.24) - Eigen::Vector3d(0.25, 1, 0)).norm(),
            1e-15);
  EXPECT_LT((pulled(inverse, 0.25) - Eigen::Vector3d(0.25, 0, 0)).norm(),
            1e-15);
  EXPECT_LT(
      (pulled(half, 0.124) - Eigen::Vector3d(0.5, 1, std::sqrt(2.0))).norm(),
      1e-15);
  EXPECT_LT((pulled(half, 0.125) - Eigen::Vector3d(0.5, 1, 0)).norm(), 1e-15);
}

TEST(SimulatorPullBackTest,
     ExactZeroSingularValuesAreDroppedWithoutTruncation) {
  const VectorXd x = Vector2d::Ones();
  const VectorXd d_y = Vector2d(3.0, 5.0);
  for (const SimulatorWay way :
       {SimulatorWay::kInverseGradient, SimulatorWay::kHalfInverse}) {
    const SimulatorPullBack deficient(
        MakeLinear(Vector2d(4.0, 0.0).asDiagonal()), nullptr, Way(way, 0.0));
    const double factor = way == SimulatorWay::kHalfInverse ? 0.5 : 0.25;
    EXPECT_LT((Pull(deficient, x, d_y).d_x - Vector2d(3.0 * factor, 0)).norm(),
              1e-15);
    const SimulatorPullBack zero(
        MakeLinear(MatrixXd::Zero(2, 2)), nullptr, Way(way, 0.0));
    EXPECT_EQ(Pull(zero, x, d_y).d_x, Vector2d::Zero());
  }
}

// --- Failure ---

TEST(SimulatorPullBackTest, FailsWithoutAValueOrAWantedChange) {
  const auto simulator = MakeSimulator<2, 2>(Bend());
  const Simulator::Covector wanted_change = [](const double*, double* change) {
    change[0] = change[1] = 1.0;
    return true;
  };
  const Simulator::Covector none = [](const double*, double*) { return false; };
  for (const SimulatorWay way : kAllWays) {
    const SimulatorPullBack pull_back(simulator, ExactBendInverse(), Way(way));
    Vector2d y;
    VectorXd d_x(2);
    Result result;
    const Vector2d outside(6.0, 0.0);
    const Vector2d inside(0.4, -1.0);
    EXPECT_FALSE(
        pull_back(outside, VectorXd(), wanted_change, y.data(), d_x, &result));
    EXPECT_FALSE(pull_back(inside, VectorXd(), none, y.data(), d_x, &result));
    EXPECT_TRUE(
        pull_back(inside, VectorXd(), wanted_change, y.data(), d_x, &result));
  }
}

TEST(SimulatorPullBackDeathTest, RefusesWhatMakesNoSense) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const auto simulator = MakeSimulator<2, 2>(Bend());
  SimulatorPullBack::Options options;
  EXPECT_DEATH(SimulatorPullBack(nullptr, nullptr, options), "simulator");
  options.truncation = -0.1;
  EXPECT_DEATH(SimulatorPullBack(simulator, nullptr, options), "truncation");
  options = SimulatorPullBack::Options();
  options.round_trip = 0.0;
  EXPECT_DEATH(SimulatorPullBack(simulator, nullptr, options), "round_trip");
}

// --- Properties of physical gradients ---

// With x(t) = P^-1(y + t d_y), dx/dt = J(x(t))^-1 d_y: the step is the mean of
// the inverse gradients along the path, and not that at its start.
TEST(PhysicalGradientTest, IsTheMeanOfTheInverseGradientsAlongItsPath) {
  const auto simulator = MakeSimulator<2, 2>(Bend());
  const Vector2d x(0.2, 0.5);
  const Vector2d d_y(1.5, -0.7);
  const Pulled physical =
      Pull(SimulatorPullBack(
               simulator, ExactBendInverse(), SimulatorPullBack::Options()),
           x,
           d_y);
  ASSERT_EQ(physical.result.source, PullBackSource::kInverse);
  const SimulatorPullBack inverse_gradient(
      simulator, nullptr, Way(SimulatorWay::kInverseGradient));
  const auto local = [&](double t) {
    const VectorXd at = BendInverse(physical.y + t * d_y);
    return Pull(inverse_gradient, at, d_y).d_x;
  };
  // The midpoint rule, whose error falls with the square of the intervals.
  const auto error = [&](int num_intervals) {
    VectorXd mean = VectorXd::Zero(2);
    for (int k = 0; k < num_intervals; ++k) {
      mean += local((k + 0.5) / num_intervals) / num_intervals;
    }
    return (mean - physical.d_x).norm();
  };
  double last = error(16);
  for (const int num_intervals : {32, 64, 128}) {
    const double next = error(num_intervals);
    EXPECT_NEAR(last / next, 4.0, 0.05);
    last = next;
  }
  EXPECT_LT(last, 1e-4);
  EXPECT_GT((local(0.0) - physical.d_x).norm(), 0.3);
}

Vector2d Moved(const Simulator& simulator,
               const Vector2d& x,
               const VectorXd& d_x) {
  const Vector2d moved = x + d_x;
  Vector2d before;
  Vector2d after;
  EXPECT_TRUE(simulator.Evaluate(x.data(), nullptr, before.data(), nullptr));
  EXPECT_TRUE(simulator.Evaluate(moved.data(), nullptr, after.data(), nullptr));
  return after - before;
}

// P alone, and behind another map A: the change of y that a step causes depends
// on A for gradient descent and for Newton's method in x, and not for physical
// gradients.
TEST(PhysicalGradientTest, TheStepInYDoesNotDependOnWhatStandsBefore) {
  const auto P = MakeSimulator<2, 2>(Bend());
  const auto Q = MakeSimulator<2, 2>(BendOfCubic());
  const Vector2d x(0.2, 0.5);
  const Vector2d u = CubicInverse(x);
  const Vector2d d_y(1.5, -0.7);
  const auto inverse_of_q = Inverse([](const auto& y, const auto& /*x_now*/) {
    return VectorXd(CubicInverse(BendInverse(y)));
  });
  SimulatorPullBack::Options newton = Way(SimulatorWay::kNewton);
  newton.newton.max_loss_change = 1e9;
  SimulatorPullBack::Options numerical;
  numerical.round_trip = 1e-8;

  const auto change = [&](const std::shared_ptr<const Simulator>& simulator,
                          std::shared_ptr<const InverseSimulator> inverse,
                          const SimulatorPullBack::Options& options,
                          const Vector2d& from) {
    const SimulatorPullBack pull_back(simulator, std::move(inverse), options);
    return Moved(*simulator, from, Pull(pull_back, from, d_y).d_x);
  };
  const SimulatorPullBack::Options physical;
  EXPECT_LT((change(P, ExactBendInverse(), physical, x) - d_y).norm(), 1e-14);
  EXPECT_LT((change(Q, inverse_of_q, physical, u) - d_y).norm(), 1e-14);
  EXPECT_LT((change(P, nullptr, numerical, x) - d_y).norm(), 1e-7);
  EXPECT_LT((change(Q, nullptr, numerical, u) - d_y).norm(), 1e-7);

  EXPECT_GT(
      (change(P, nullptr, newton, x) - change(Q, nullptr, newton, u)).norm(),
      0.1 * d_y.norm());
  // Of gradient descent even the direction depends on A, to first order in the
  // step: it is that of J J^T d_y.
  const auto direction = [&](const std::shared_ptr<const Simulator>& simulator,
                             const Vector2d& from) {
    const SimulatorPullBack descent(
        simulator, nullptr, Way(SimulatorWay::kAdjoint));
    const VectorXd small = 1e-6 * Pull(descent, from, d_y).d_x;
    return Vector2d(Moved(*simulator, from, small).normalized());
  };
  EXPECT_GT((direction(P, x) - direction(Q, u)).norm(), 0.1);
  EXPECT_LT((direction(P, x) -
             Vector2d(BendJacobian(x) * BendJacobian(x).transpose() * d_y)
                 .normalized())
                .norm(),
            1e-4);
}

}  // namespace simulator_pull_back_test
}  // namespace invgrad
