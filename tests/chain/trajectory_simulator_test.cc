#include "invgrad/internal/trajectory_simulator.h"

#include <cmath>
#include <vector>

#include "Eigen/Core"
#include "ceres/jet.h"
#include "gtest/gtest.h"
#include "invgrad/internal/nested_jet.h"
#include "invgrad/time_stepping_simulator.h"

namespace invgrad {
namespace trajectory_simulator_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr int kNumSteps = 5;
constexpr int kNumControls = 2;
constexpr int kNumOutputs = 3;  // at each step
constexpr int kNumInputs = kNumSteps * kNumControls;

// A pendulum with two controls, semi-implicit Euler.
struct PendulumStep {
  template <typename T>
  bool operator()(const T* s, const T* u, T* next) const {
    using std::sin;
    next[1] = s[1] + 0.3 * (u[0] * (1.0 + s[0] * s[0]) - sin(s[0]));
    next[0] = s[0] + 0.3 * next[1] * (1.0 + 0.5 * u[1]);
    return true;
  }
};

// The terms of a loss whose last errors weigh three times as much.
struct Terms {
  template <typename T>
  bool operator()(int t, const T* next_state, const T* u, T* z) const {
    using std::cos;
    const double weight = t + 1 == kNumSteps ? 3.0 : 1.0;
    z[0] = weight * (cos(next_state[0]) - 0.1 * t);
    z[1] = next_state[1] * u[1];
    z[2] = 0.2 * u[0];
    return true;
  }
};

// The whole roll-out on one scalar type: the oracle.
template <typename T, typename Start>
std::vector<T> Trajectory(const std::vector<T>& controls, const Start& start) {
  std::vector<T> state{T(start[0]), T(start[1])};
  std::vector<T> next(2);
  std::vector<T> y(kNumSteps * kNumOutputs);
  for (int t = 0; t < kNumSteps; ++t) {
    const T* u = controls.data() + t * kNumControls;
    PendulumStep()(state.data(), u, next.data());
    Terms()(t, next.data(), u, y.data() + t * kNumOutputs);
    state.swap(next);
  }
  return y;
}

// time_stepping_simulator_test.cc tests the strides.
class TrajectorySimulatorTest : public testing::Test {
 protected:
  const TrajectorySimulator<PendulumStep, Terms> simulator_{
      PendulumStep(), Terms(), 2, kNumControls, kNumOutputs, kNumSteps};
  const VectorXd controls_ = VectorXd::LinSpaced(kNumInputs, -0.9, 0.7);
  const VectorXd start_ = Eigen::Vector2d(0.8, -0.4);
  const VectorXd w_ = VectorXd::LinSpaced(kNumSteps * kNumOutputs, -1.0, 1.5);
};

// All values are of order one, and some hundred operations lie between the
// controls and the outputs.
constexpr double kRounding = 1e-13;

TEST_F(TrajectorySimulatorTest, JacobianIsThatOfJetsThroughTheRollOut) {
  using Jet = ceres::Jet<double, kNumInputs>;
  std::vector<Jet> jets(kNumInputs);
  for (int i = 0; i < kNumInputs; ++i) jets[i] = Jet(controls_[i], i);
  const std::vector<Jet> expected = Trajectory(jets, start_);

  ASSERT_EQ(simulator_.num_inputs(), kNumInputs);
  ASSERT_EQ(simulator_.num_outputs(), kNumSteps * kNumOutputs);
  ASSERT_EQ(simulator_.num_context(), 2);
  VectorXd y(simulator_.num_outputs());
  VectorXd value(simulator_.num_outputs());
  RowMajorMatrix J =
      RowMajorMatrix::Constant(simulator_.num_outputs(), kNumInputs, 9.0);
  ASSERT_TRUE(
      simulator_.Evaluate(controls_.data(), start_.data(), y.data(), J.data()));
  ASSERT_TRUE(simulator_.Evaluate(
      controls_.data(), start_.data(), value.data(), nullptr));
  for (int i = 0; i < simulator_.num_outputs(); ++i) {
    EXPECT_NEAR(y[i], expected[i].a, kRounding);
    EXPECT_NEAR(value[i], expected[i].a, kRounding);
    EXPECT_LT((J.row(i).transpose() - expected[i].v).norm(), kRounding);
    // Later controls change nothing, to the bit.
    const int num_later = (kNumSteps - 1 - i / kNumOutputs) * kNumControls;
    EXPECT_EQ(J.row(i).tail(num_later).norm(), 0.0);
  }
}

TEST_F(TrajectorySimulatorTest, ContextJacobianIsThatOfJetsOfTheStart) {
  using Jet = ceres::Jet<double, 2>;
  std::vector<Jet> start{Jet(start_[0], 0), Jet(start_[1], 1)};
  const std::vector<Jet> controls(controls_.begin(), controls_.end());
  const std::vector<Jet> y = Trajectory(controls, start);
  RowMajorMatrix jacobian(kNumSteps * kNumOutputs, 2);
  ASSERT_TRUE(simulator_.has_context_jacobian());
  ASSERT_TRUE(simulator_.ContextJacobian(
      controls_.data(), start_.data(), jacobian.data()));
  for (int i = 0; i < jacobian.rows(); ++i) {
    EXPECT_LE((jacobian.row(i).transpose() - y[i].v).norm(), kRounding)
        << "output " << i;
  }
  // Without outputs y is the last state.
  const TimeSteppingSimulator<PendulumStep> last(
      PendulumStep(), 2, kNumControls, kNumSteps);
  std::vector<Jet> state = start;
  for (int t = 0; t < kNumSteps; ++t) {
    std::vector<Jet> next(2);
    PendulumStep()(state.data(), &controls[t * kNumControls], next.data());
    state = next;
  }
  RowMajorMatrix of_last(2, 2);
  ASSERT_TRUE(
      last.ContextJacobian(controls_.data(), start_.data(), of_last.data()));
  for (int i = 0; i < 2; ++i) {
    EXPECT_LE((of_last.row(i).transpose() - state[i].v).norm(), kRounding);
  }
}

TEST_F(TrajectorySimulatorTest, AdjointIsTheTransposedJacobian) {
  VectorXd y(simulator_.num_outputs());
  RowMajorMatrix J(simulator_.num_outputs(), kNumInputs);
  ASSERT_TRUE(
      simulator_.Evaluate(controls_.data(), start_.data(), y.data(), J.data()));
  VectorXd value(y.size());
  VectorXd pulled(kNumInputs);
  const auto covector = [&y](const double* at, double* w) {
    for (int i = 0; i < y.size(); ++i) w[i] = (i - 4) * at[i];
    return true;
  };
  ASSERT_TRUE(simulator_.Adjoint(
      controls_.data(), start_.data(), covector, value.data(), pulled.data()));
  EXPECT_EQ(value, y);
  VectorXd w(y.size());
  covector(y.data(), w.data());
  EXPECT_LT((pulled - J.transpose() * w).norm(), kRounding * w.norm());
}

TEST_F(TrajectorySimulatorTest, HessianIsThatOfNestedJetsThroughTheRollOut) {
  using Jet = NestedJet<kNumInputs>;
  std::vector<Jet> jets(kNumInputs);
  for (int i = 0; i < kNumInputs; ++i) {
    jets[i] = MakeHessianJet<kNumInputs>(controls_[i], i);
  }
  const std::vector<Jet> y = Trajectory(jets, start_);
  MatrixXd expected = MatrixXd::Zero(kNumInputs, kNumInputs);
  for (int i = 0; i < kNumInputs; ++i) {
    for (std::size_t j = 0; j < y.size(); ++j) {
      expected.col(i) += w_[j] * y[j].v[i].v;
    }
  }
  MatrixXd H = MatrixXd::Constant(kNumInputs, kNumInputs, 9.0);
  ASSERT_TRUE(simulator_.WeightedHessian(
      controls_.data(), start_.data(), w_.data(), H.data()));
  EXPECT_LT((H - expected).cwiseAbs().maxCoeff(), kRounding);
  EXPECT_EQ(H, H.transpose());
  EXPECT_GT(expected.cwiseAbs().maxCoeff(), 0.1);
}

// The state itself as output: the last one is the time-stepping simulator's y.
struct StateOutput {
  template <typename T>
  bool operator()(int /*t*/, const T* next_state, const T*, T* z) const {
    z[0] = next_state[0];
    z[1] = next_state[1];
    return true;
  }
};

TEST(TrajectorySimulator, LastStateIsThatOfTheTimeSteppingSimulator) {
  const TrajectorySimulator<PendulumStep, StateOutput> trajectory(
      PendulumStep(), StateOutput(), 2, kNumControls, 2, kNumSteps);
  const TimeSteppingSimulator<PendulumStep> end(
      PendulumStep(), 2, kNumControls, kNumSteps);
  const VectorXd x = VectorXd::LinSpaced(kNumInputs, -0.9, 0.7);
  const Eigen::Vector2d start(0.8, -0.4);
  VectorXd states(2 * kNumSteps);
  Eigen::Vector2d last;
  RowMajorMatrix J(2 * kNumSteps, kNumInputs);
  RowMajorMatrix J_last(2, kNumInputs);
  ASSERT_TRUE(
      trajectory.Evaluate(x.data(), start.data(), states.data(), J.data()));
  ASSERT_TRUE(end.Evaluate(x.data(), start.data(), last.data(), J_last.data()));
  EXPECT_EQ(states.tail(2), last);
  EXPECT_LT((J.bottomRows(2) - J_last).norm(), kRounding);

  // Both are the same loop.
  const int size = 2 * (2 + kNumControls);
  VectorXd M(kNumSteps * size);
  VectorXd M_end(kNumSteps * size);
  ASSERT_TRUE(trajectory.StepJacobians(x.data(), start.data(), M.data()));
  ASSERT_TRUE(end.StepJacobians(x.data(), start.data(), M_end.data()));
  EXPECT_EQ(M, M_end);
  Eigen::Vector2d state = start;
  Eigen::Vector2d next;
  for (int t = 0; t < kNumSteps; ++t) {
    ASSERT_TRUE(trajectory.Advance(
        state.data(), x.data() + t * kNumControls, next.data()));
    EXPECT_EQ(next, states.segment(2 * t, 2));
    state = next;
  }
}

// Overflows in the output only, or refuses it.
struct FragileOutput {
  template <typename T>
  bool operator()(int t, const T* next_state, const T* u, T* z) const {
    z[0] = next_state[0] * 1e200 * u[1];
    return !(t == 1 && u[1] < 0.0);
  }
};

TEST(TrajectorySimulator, FailsWithTheOutputOrAnInfinity) {
  const TrajectorySimulator<PendulumStep, FragileOutput> simulator(
      PendulumStep(), FragileOutput(), 2, 2, 1, 2);
  const Eigen::Vector2d start(0.8, -0.4);
  const auto covector = [](const double*, double* w) {
    w[0] = w[1] = 1.0;
    return true;
  };
  double y[2];
  double J[8];
  double H[16];
  const double w[] = {1.0, 1.0};
  for (const double last : {-1.0, 1e120}) {
    const double x[] = {0.0, 1.0, 0.0, last};
    EXPECT_FALSE(simulator.Evaluate(x, start.data(), y, nullptr));
    EXPECT_FALSE(simulator.Evaluate(x, start.data(), y, J));
    EXPECT_FALSE(simulator.Adjoint(x, start.data(), covector, y, J));
    EXPECT_FALSE(simulator.WeightedHessian(x, start.data(), w, H));
  }
  const double x[] = {0.0, 1.0, 0.0, 1.0};
  EXPECT_TRUE(simulator.Evaluate(x, start.data(), y, J));
}

}  // namespace trajectory_simulator_test
}  // namespace invgrad
