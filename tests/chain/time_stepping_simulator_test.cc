#include "invgrad/time_stepping_simulator.h"

#include <cmath>
#include <random>
#include <type_traits>
#include <vector>

#include "Eigen/Core"
#include "ceres/jet.h"
#include "gtest/gtest.h"
#include "invgrad/internal/nested_jet.h"

namespace invgrad {
namespace time_stepping_simulator_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// One step of the classical Runge-Kutta method for a pendulum with friction
// that is driven in two ways: q'' = -sin q - 0.1 v^3 + u_0 q + u_1^2.
struct PendulumStep {
  template <typename T>
  void Rate(const T* s, const T* u, T* rate) const {
    using std::sin;
    rate[0] = s[1];
    rate[1] = -sin(s[0]) - 0.1 * s[1] * s[1] * s[1] + u[0] * s[0] + u[1] * u[1];
  }
  template <typename T>
  bool operator()(const T* s, const T* u, T* next) const {
    const double h = 0.2;
    T k1[2], k2[2], k3[2], k4[2], at[2];
    Rate(s, u, k1);
    for (int i = 0; i < 2; ++i) at[i] = s[i] + 0.5 * h * k1[i];
    Rate(at, u, k2);
    for (int i = 0; i < 2; ++i) at[i] = s[i] + 0.5 * h * k2[i];
    Rate(at, u, k3);
    for (int i = 0; i < 2; ++i) at[i] = s[i] + h * k3[i];
    Rate(at, u, k4);
    for (int i = 0; i < 2; ++i) {
      next[i] = s[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
    }
    return true;
  }
};

constexpr int kNumSteps = 6;
constexpr int kNumControls = 2;
constexpr int kNumInputs = kNumSteps * kNumControls;

// The whole roll-out on one scalar type: the oracle.
template <typename T>
std::vector<T> StepAll(const std::vector<T>& controls, const VectorXd& start) {
  std::vector<T> state{T(start[0]), T(start[1])};
  std::vector<T> next(2);
  for (int t = 0; t < kNumSteps; ++t) {
    PendulumStep()(
        state.data(), controls.data() + t * kNumControls, next.data());
    state.swap(next);
  }
  return state;
}

VectorXd Controls() {
  std::mt19937 generator(5);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  return VectorXd::NullaryExpr(kNumInputs, [&] { return uniform(generator); });
}

template <typename Stride>
class TimeSteppingSimulatorTest : public testing::Test {
 protected:
  TimeSteppingSimulatorTest()
      : simulator_(PendulumStep(), 2, kNumControls, kNumSteps) {}

  const TimeSteppingSimulator<PendulumStep, Stride::value> simulator_;
  const VectorXd controls_ = Controls();
  const VectorXd start_ = Eigen::Vector2d(0.8, -0.4);
};

// State and control have four entries together: strides that divide it, do not,
// and exceed it.
using Strides = testing::Types<std::integral_constant<int, 2>,
                               std::integral_constant<int, 3>,
                               std::integral_constant<int, 6>>;
TYPED_TEST_SUITE(TimeSteppingSimulatorTest, Strides);

// All values are of order one, and a few hundred operations lie between the
// controls and the final state.
constexpr double kRounding = 1e-13;

TYPED_TEST(TimeSteppingSimulatorTest, JacobianIsThatOfJetsThroughTheRollOut) {
  using Jet = ceres::Jet<double, kNumInputs>;
  std::vector<Jet> jets(kNumInputs);
  for (int i = 0; i < kNumInputs; ++i) {
    jets[i] = Jet(this->controls_[i], i);
  }
  const std::vector<Jet> expected = StepAll(jets, this->start_);

  VectorXd y(2);
  RowMajorMatrix J = RowMajorMatrix::Constant(2, kNumInputs, 9.0);
  ASSERT_TRUE(this->simulator_.Evaluate(
      this->controls_.data(), this->start_.data(), y.data(), J.data()));
  VectorXd value(2);
  ASSERT_TRUE(this->simulator_.Evaluate(
      this->controls_.data(), this->start_.data(), value.data(), nullptr));
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(y[i], expected[i].a, kRounding);
    EXPECT_NEAR(value[i], expected[i].a, kRounding);
    EXPECT_LT((J.row(i).transpose() - expected[i].v).norm(), kRounding);
  }
}

TYPED_TEST(TimeSteppingSimulatorTest, AdjointIsTheTransposedJacobian) {
  VectorXd y(2);
  RowMajorMatrix J(2, kNumInputs);
  ASSERT_TRUE(this->simulator_.Evaluate(
      this->controls_.data(), this->start_.data(), y.data(), J.data()));
  VectorXd value(2);
  VectorXd pulled(kNumInputs);
  const auto covector = [](const double* at, double* w) {
    w[0] = 3.0 * at[0];
    w[1] = -2.0 * at[1];
    return true;
  };
  ASSERT_TRUE(this->simulator_.Adjoint(this->controls_.data(),
                                       this->start_.data(),
                                       covector,
                                       value.data(),
                                       pulled.data()));
  EXPECT_EQ(value, y);
  const Eigen::Vector2d w(3.0 * y[0], -2.0 * y[1]);
  EXPECT_LT((pulled - J.transpose() * w).norm(), kRounding);
}

TYPED_TEST(TimeSteppingSimulatorTest,
           HessianIsThatOfNestedJetsThroughTheRollOut) {
  using Jet = NestedJet<kNumInputs>;
  std::vector<Jet> jets(kNumInputs);
  for (int i = 0; i < kNumInputs; ++i) {
    jets[i] = MakeHessianJet<kNumInputs>(this->controls_[i], i);
  }
  const std::vector<Jet> y = StepAll(jets, this->start_);
  const Eigen::Vector2d w(1.3, -0.7);
  MatrixXd expected(kNumInputs, kNumInputs);
  for (int i = 0; i < kNumInputs; ++i) {
    expected.col(i) = w[0] * y[0].v[i].v + w[1] * y[1].v[i].v;
  }
  MatrixXd H = MatrixXd::Constant(kNumInputs, kNumInputs, 9.0);
  ASSERT_TRUE(this->simulator_.WeightedHessian(
      this->controls_.data(), this->start_.data(), w.data(), H.data()));
  EXPECT_LT((H - expected).cwiseAbs().maxCoeff(), kRounding);
  EXPECT_EQ(H, H.transpose());
  EXPECT_GT(expected.cwiseAbs().minCoeff(), 1e-6);  // no entry is trivial
}

// s_{t+1} = A s_t + b u_t: J_t = A^(N - 1 - t) b, and no Hessian. The size is a
// run-time value here.
struct LinearStep {
  MatrixXd A;
  VectorXd b;
  template <typename T>
  bool operator()(const T* s, const T* u, T* next) const {
    for (Eigen::Index i = 0; i < b.size(); ++i) {
      next[i] = b[i] * u[0];
      for (Eigen::Index k = 0; k < b.size(); ++k) next[i] += A(i, k) * s[k];
    }
    return true;
  }
};

TEST(TimeSteppingSimulator, LinearStepsHaveMatrixPowersAsJacobian) {
  std::mt19937 generator(3);
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  const int size = 9;
  const int num_steps = 5;
  LinearStep step;
  step.A =
      MatrixXd::NullaryExpr(size, size, [&] { return uniform(generator); });
  step.b = VectorXd::NullaryExpr(size, [&] { return uniform(generator); });
  const TimeSteppingSimulator<LinearStep> simulator(step, size, 1, num_steps);
  const VectorXd x = VectorXd::LinSpaced(num_steps, -1.0, 1.0);
  const VectorXd start = VectorXd::LinSpaced(size, 0.0, 1.0);
  VectorXd y(size);
  RowMajorMatrix J(size, num_steps);
  ASSERT_TRUE(simulator.Evaluate(x.data(), start.data(), y.data(), J.data()));
  VectorXd power = step.b;
  for (int t = num_steps - 1; t >= 0; --t) {
    EXPECT_LT((J.col(t) - power).norm(), 1e-14) << t;
    power = step.A * power;
  }
  MatrixXd H(num_steps, num_steps);
  ASSERT_TRUE(
      simulator.WeightedHessian(x.data(), start.data(), y.data(), H.data()));
  EXPECT_EQ(H, MatrixXd::Zero(num_steps, num_steps));
}

// x <- x^2 u: overflows after a few steps from 1e100; refuses u < 0.
struct SquaringStep {
  template <typename T>
  bool operator()(const T* s, const T* u, T* next) const {
    next[0] = s[0] * s[0] * u[0];
    return !(u[0] < 0.0);
  }
};

TEST(TimeSteppingSimulator, FailsWithTheStepOrAnInfinity) {
  const TimeSteppingSimulator<SquaringStep> simulator(SquaringStep(), 1, 1, 3);
  const auto covector = [](const double*, double* w) {
    w[0] = 1.0;
    return true;
  };
  double y;
  double w = 1.0;
  double J[3];
  double H[9];
  const struct {
    double start;
    double controls[3];
  } kCases[] = {{1e100, {1.0, 1.0, 1.0}}, {1.0, {1.0, -1.0, 1.0}}};
  for (const auto& c : kCases) {
    EXPECT_FALSE(simulator.Evaluate(c.controls, &c.start, &y, nullptr));
    EXPECT_FALSE(simulator.Evaluate(c.controls, &c.start, &y, J));
    EXPECT_FALSE(simulator.Adjoint(c.controls, &c.start, covector, &y, J));
    EXPECT_FALSE(simulator.WeightedHessian(c.controls, &c.start, &w, H));
  }
  const double start = 1.0;
  const double ones[] = {1.0, 1.0, 1.0};
  EXPECT_TRUE(simulator.Evaluate(ones, &start, &y, J));
  EXPECT_EQ(y, 1.0);
  EXPECT_EQ(J[0], 4.0);  // u_0 enters to the fourth power
  EXPECT_EQ(J[1], 2.0);
  EXPECT_EQ(J[2], 1.0);
}

}  // namespace time_stepping_simulator_test
}  // namespace invgrad
