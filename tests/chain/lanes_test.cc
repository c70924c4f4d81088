// Samples in lanes: packs, and what happens where a pack cannot do the work.

#include "invgrad/internal/lanes.h"

#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "ceres/jet.h"
#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/loss.h"
#include "invgrad/model.h"
#include "invgrad/time_stepping_simulator.h"
#include "tests/chain/pendulum_step.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace lanes_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Functions of the standard library and of Ceres, and plain numbers on both
// sides.
template <typename T>
T Formula(const T& x, const T& y) {
  using std::abs;
  using std::atan2;
  using std::cos;
  using std::exp;
  using std::fmax;
  using std::hypot;
  using std::log;
  using std::pow;
  using std::sin;
  using std::sqrt;
  using std::tanh;
  T z = 2.0 - x / 3.0 + sin(x) * cos(y) - exp(-0.5 * x);
  z += log(1.0 + y * y) + sqrt(abs(y) + 0.25) * tanh(x);
  z -= pow(x * x + 1.0, 1.5) + pow(2.0, y) + pow(x * x + 0.5, y);
  z *= 1.0 / (2.0 + atan2(y, x * x + 1.0) + hypot(x, y));
  return -z + T(0.125);
}

TEST(PackTest, EveryLaneHasTheBitsOfADouble) {
  const MatrixXd samples = RandomMatrix(2, Pack::kLanes, 1);
  Pack packs[2];
  LoadLanes(samples.data(), 2, packs);
  const Pack value = Formula(packs[0], packs[1]);
  using Jet = ceres::Jet<double, 2>;
  using PackJet = ceres::Jet<Pack, 2>;
  const PackJet jet = Formula(PackJet(packs[0], 0), PackJet(packs[1], 1));
  EXPECT_FALSE(PackBranches::differ());
  for (int lane = 0; lane < Pack::kLanes; ++lane) {
    const double x = samples(0, lane), y = samples(1, lane);
    EXPECT_EQ(value[lane], Formula(x, y));
    const Jet expected = Formula(Jet(x, 0), Jet(y, 1));
    EXPECT_EQ(jet.a[lane], expected.a);
    EXPECT_EQ(jet.v[0][lane], expected.v[0]);
    EXPECT_EQ(jet.v[1][lane], expected.v[1]);
  }
}

TEST(PackTest, AComparisonNotesLanesThatDisagree) {
  const double values[] = {1.0, 2.0, 3.0, 4.0};
  Pack x;
  LoadLanes(values, 1, &x);
  PackBranches::Reset();
  EXPECT_TRUE(x > 0.5);
  EXPECT_FALSE(4.0 < x);
  EXPECT_TRUE((ceres::Jet<Pack, 1>(x, 0) > 0.5));
  EXPECT_TRUE(isfinite(x));
  EXPECT_FALSE(PackBranches::differ());
  EXPECT_TRUE(x < 2.5);  // of lane 0
  EXPECT_TRUE(PackBranches::differ());
  PackBranches::Reset();
  EXPECT_FALSE((ceres::Jet<Pack, 1>(x, 0) > 2.5));
  EXPECT_TRUE(PackBranches::differ());
  PackBranches::Reset();
}

TEST(PackTest, StoreReversesLoad) {
  const MatrixXd columns = RandomMatrix(5, Pack::kLanes, 2);
  Pack packs[5];
  LoadLanes(columns.data(), 5, packs);
  EXPECT_EQ(packs[3][2], columns(3, 2));
  MatrixXd stored(5, Pack::kLanes);
  StoreLanes(packs, 5, stored.data());
  EXPECT_EQ(stored, columns);
}

TEST(PackTest, OneBadLaneIsNotFinite) {
  for (const int size : {1, 8, 21}) {
    for (const double bad : {HUGE_VAL, -HUGE_VAL, std::nan("")}) {
      MatrixXd columns = MatrixXd::Constant(size, Pack::kLanes, 1e308);
      Pack packs[21];
      LoadLanes(columns.data(), size, packs);
      EXPECT_TRUE(AreLanesFinite(packs, size));
      columns(size - 1, 3) = bad;
      LoadLanes(columns.data(), size, packs);
      EXPECT_FALSE(AreLanesFinite(packs, size));
    }
  }
}

// Branches on the value and counts the calls with packs.
struct Kink {
  int* num_packs = nullptr;
  template <typename T>
  bool operator()(const T* x, T* y) const {
    if constexpr (std::is_same_v<T, Pack>) ++*num_packs;
    y[0] = x[0] < 0.0 ? -3.0 * x[0] : x[0] * x[0];
    return true;
  }
};

TEST(LanesTest, SamplesWithOtherBranchesAreRepeatedOneAtATime) {
  int num_packs = 0;
  const AutoDiffSimulator<Kink, 1, 1> simulator(Kink{&num_packs});
  EXPECT_EQ(simulator.WhyNoLanes(), "");
  // Packs with: one branch, the other branch, both.
  VectorXd x(13), y(13), J(13);
  x << 1, 2, 3, 4, -1, -2, -3, -4, 5, -5, 6, -6, 7;
  ASSERT_EQ(simulator.EvaluateBatch(13, x.data(), nullptr, y.data(), nullptr),
            13);
  EXPECT_EQ(num_packs, 3);
  ASSERT_EQ(simulator.EvaluateBatch(13, x.data(), nullptr, y.data(), J.data()),
            13);
  for (int s = 0; s < 13; ++s) {
    EXPECT_EQ(y[s], x[s] < 0.0 ? -3.0 * x[s] : x[s] * x[s]) << s;
    EXPECT_EQ(J[s], x[s] < 0.0 ? -3.0 : 2.0 * x[s]) << s;
  }
}

TEST(LanesTest, PacksWhoseBranchesDifferAreGivenUp) {
  int num_packs = 0;
  const AutoDiffSimulator<Kink, 1, 1> simulator(Kink{&num_packs});
  const VectorXd x =
      VectorXd::LinSpaced(400, 0.0, 399.0).unaryExpr([](double k) {
        return std::cos(M_PI * k);
      });
  VectorXd y(400);
  ASSERT_EQ(simulator.EvaluateBatch(400, x.data(), nullptr, y.data(), nullptr),
            400);
  EXPECT_LT(num_packs, 4);
}

// Compiles for double and its Jets only.
inline double Half(double x) { return 0.5 * x; }
template <int N>
ceres::Jet<double, N> Half(const ceres::Jet<double, N>& x) {
  return x * 0.5;
}
template <int M, int N>
NestedJet<N, M> Half(const ceres::Jet<InnerJet<M>, N>& x) {
  return x * 0.5;
}
struct OwnOverloads {
  static constexpr bool kInLanes = false;
  template <typename T>
  bool operator()(const T* x, T* y) const {
    y[0] = Half(x[0]);
    return true;
  }
};
struct HalfStep {
  static constexpr bool kInLanes = false;
  template <typename T>
  bool operator()(const T* s, const T* u, T* next) const {
    next[0] = Half(s[0]) + u[0];
    return true;
  }
};

TEST(LanesTest, AFunctorMayDecline) {
  const AutoDiffSimulator<OwnOverloads, 1, 1> simulator;
  EXPECT_EQ(simulator.WhyNoLanes(), "the functor sets kInLanes = false");
  const VectorXd x = VectorXd::LinSpaced(9, 1.0, 9.0);
  VectorXd y(9);
  ASSERT_EQ(simulator.EvaluateBatch(9, x.data(), nullptr, y.data(), nullptr),
            9);
  EXPECT_EQ(y, 0.5 * x);

  const TimeSteppingSimulator<HalfStep> steps(HalfStep(), 1, 1, 1);
  EXPECT_EQ(steps.WhyNoLanes(), "the functor sets kInLanes = false");
  ASSERT_EQ(steps.EvaluateBatch(9, x.data(), x.data(), y.data(), nullptr), 9);
  EXPECT_EQ(y, 1.5 * x);
}

struct Scaled {
  template <typename T>
  bool operator()(const T* x, const double* c, T* y) const {
    y[0] = c[0] * x[0];
    return true;
  }
};
struct ScaledInLanes {
  template <typename T, typename C>
  bool operator()(const T* x, const C* c, T* y) const {
    y[0] = c[0] * x[0];
    return true;
  }
};

TEST(LanesTest, AContextOfDoublesIsOneAtATime) {
  const VectorXd x = VectorXd::LinSpaced(9, 1.0, 9.0);
  VectorXd y(9), in_lanes(9), J(9), J_in_lanes(9);
  const AutoDiffSimulator<Scaled, 1, 1, 1> simulator;
  EXPECT_EQ(simulator.WhyNoLanes(), "the functor's context is double*");
  ASSERT_EQ(simulator.EvaluateBatch(9, x.data(), x.data(), y.data(), J.data()),
            9);
  const AutoDiffSimulator<ScaledInLanes, 1, 1, 1> lanes;
  EXPECT_EQ(lanes.WhyNoLanes(), "");
  ASSERT_EQ(lanes.EvaluateBatch(
                9, x.data(), x.data(), in_lanes.data(), J_in_lanes.data()),
            9);
  EXPECT_EQ(y, x.cwiseAbs2());
  EXPECT_EQ(in_lanes, y);
  EXPECT_EQ(J, x);
  EXPECT_EQ(J_in_lanes, J);
  EXPECT_EQ(IdentitySimulator(1).WhyNoLanes(),
            "the simulator is not a functor");
}

// Squares the state; refuses controls above one.
struct Square {
  template <typename T>
  bool operator()(const T* s, const T* u, T* next) const {
    if (u[0] > 1.0) return false;
    next[0] = s[0] * s[0] + u[0];
    return true;
  }
};

// A model whose network is the identity.
Model SquareModel(int num_steps) {
  return Model(DenseNetwork({num_steps, num_steps}, Activation::kLinear),
               std::make_shared<TimeSteppingSimulator<Square>>(
                   Square(), 1, 1, num_steps),
               std::make_shared<SquaredNormLoss>(1, 1.0),
               Reduction::kMean);
}

TEST(LanesTest, TheMessageNamesTheSampleOfAPackAndItsTimeStep) {
  constexpr int kNumSteps = 12;
  const Model model = SquareModel(kNumSteps);
  VectorXd weights = VectorXd::Zero(model.num_weights());
  for (int i = 0; i < kNumSteps; ++i) weights[i * (kNumSteps + 2)] = 1.0;
  DataSet batch;
  batch.inputs = MatrixXd::Constant(kNumSteps, 11, 0.1);
  batch.contexts = MatrixXd::Constant(1, 11, 0.5);
  batch.targets = MatrixXd::Zero(1, 11);
  const auto errors = [&](const std::string& expected) {
    for (const int num_threads : {1, 2, 3}) {
      const Model threaded = model.WithThreads(num_threads);
      std::string error;
      Linearization linearization;
      EXPECT_FALSE(threaded.Linearize(weights,
                                      batch,
                                      LinearizationParts::Gradient(),
                                      &linearization,
                                      &error));
      EXPECT_EQ(error, expected);
      LinearizationParts parts;
      parts.jacobian = true;
      EXPECT_FALSE(
          threaded.Linearize(weights, batch, parts, &linearization, &error));
      EXPECT_EQ(error, expected);
      MatrixXd outputs;
      EXPECT_FALSE(threaded.Predict(weights, batch, &outputs, &error));
      EXPECT_EQ(error, expected);
    }
  };
  batch.contexts(0, 10) = 1e30;
  errors(
      "sample 10: the simulator has no finite value: the state is not finite "
      "after time step 4 of 12");
  batch.contexts(0, 6) = 1e100;
  errors(
      "sample 6: the simulator has no finite value: the state is not finite "
      "after time step 2 of 12");
  batch.inputs(7, 5) = 2.0;
  errors(
      "sample 5: the simulator has no finite value: the step has no value at "
      "time step 8 of 12");
}

MatrixXd Dense(const JacobianOperator& jacobian) {
  MatrixXd J;
  jacobian.ToDense(&J);
  return J;
}

TEST(LanesTest, ABatchThroughThreadsAndLanesHasTheSameBits) {
  const auto simulator = std::make_shared<TimeSteppingSimulator<PendulumStep>>(
      PendulumStep(), 2, 1, 9);
  for (const bool in_loop : {false, true}) {
    const Model model(DenseNetwork({2, 7, in_loop ? 1 : 9}, Activation::kTanh),
                      simulator,
                      std::make_shared<SquaredNormLoss>(2, 1.0),
                      Reduction::kMean,
                      in_loop ? simulator : nullptr);
    const VectorXd weights = RandomMatrix(model.num_weights(), 1, 5);
    DataSet batch;
    batch.inputs = RandomMatrix(2, 23, 6);
    batch.contexts = batch.inputs;
    batch.targets = RandomMatrix(2, 23, 7);
    LinearizationParts parts = LinearizationParts::Gradient();
    std::string error;
    Linearization adjoint, jacobian;
    ASSERT_TRUE(model.Linearize(weights, batch, parts, &adjoint, &error));
    parts.jacobian = true;
    ASSERT_TRUE(model.Linearize(weights, batch, parts, &jacobian, &error));
    for (const int num_threads : {2, 3, 64}) {
      const Model threaded = model.WithThreads(num_threads);
      EXPECT_EQ(threaded.num_threads(), num_threads);
      Linearization other;
      ASSERT_TRUE(threaded.Linearize(weights, batch, parts, &other, &error));
      EXPECT_EQ(other.cost, jacobian.cost);
      EXPECT_EQ(other.gradient, jacobian.gradient);
      EXPECT_EQ(other.loss_gradient, jacobian.loss_gradient);
      EXPECT_EQ(Dense(*other.jacobian), Dense(*jacobian.jacobian));
      ASSERT_TRUE(threaded.Linearize(
          weights, batch, LinearizationParts::Gradient(), &other, &error));
      EXPECT_EQ(other.cost, adjoint.cost);
      EXPECT_EQ(other.gradient, adjoint.gradient);
    }
  }
}

}  // namespace lanes_test
}  // namespace invgrad
