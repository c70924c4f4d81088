// Which time step a failed roll-out names: TimeSteppingSimulator,
// TrajectorySimulator, the Schroedinger simulator, and the closed loop.

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/internal/trajectory_simulator.h"
#include "invgrad/minimize.h"
#include "invgrad/model.h"
#include "invgrad/rules.h"
#include "invgrad/time_stepping_simulator.h"
#include "invgrad/train.h"
#include "problems/schroedinger.h"

namespace invgrad {
namespace describe_failure_test {

using Eigen::VectorXd;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// s <- s^2 + u: from s = 2 and without control, 2^(2^k) after k steps, which
// overflows at k = 10.
struct SquareStep {
  template <typename T>
  bool operator()(const T* s, const T* u, T* next) const {
    next[0] = s[0] * s[0] + u[0];
    return true;
  }
};

// s <- s + u, and no value beyond 10.
struct BoundedStep {
  template <typename T>
  bool operator()(const T* s, const T* u, T* next) const {
    next[0] = s[0] + u[0];
    return next[0] < T(10.0);
  }
};

// s <- s + sqrt(u): a value at u = 0, and no derivative there.
struct RootStep {
  template <typename T>
  bool operator()(const T* s, const T* u, T* next) const {
    using std::sqrt;
    next[0] = s[0] + sqrt(u[0]);
    return true;
  }
};

struct Root {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::sqrt;
    y[0] = sqrt(x[0]);
    return true;
  }
};

// s <- 1e100 s + 0 u: every step has a derivative, four of them have none.
struct LargeStep {
  template <typename T>
  bool operator()(const T* s, const T* u, T* next) const {
    next[0] = 1e100 * s[0] + 1e100 * u[0];
    return true;
  }
};

struct State {
  template <typename T>
  bool operator()(int /*t*/, const T* next_state, const T*, T* z) const {
    z[0] = next_state[0];
    return true;
  }
};

// 1 / u at the third step alone.
struct Reciprocal {
  template <typename T>
  bool operator()(int t, const T* next_state, const T* u, T* z) const {
    z[0] = t == 2 ? 1.0 / u[0] : next_state[0];
    return true;
  }
};

// After Evaluate with or without Jacobian, which must fail.
std::string Describe(const Simulator& simulator,
                     const VectorXd& x,
                     const VectorXd& start,
                     bool with_jacobian) {
  VectorXd y(simulator.num_outputs());
  VectorXd jacobian(simulator.num_outputs() * simulator.num_inputs());
  EXPECT_FALSE(simulator.Evaluate(x.data(),
                                  start.data(),
                                  y.data(),
                                  with_jacobian ? jacobian.data() : nullptr));
  return simulator.DescribeFailure(x.data(), start.data());
}

template <typename Step>
void ExpectDescribed(const VectorXd& x,
                     double start,
                     bool with_jacobian,
                     const std::string& expected) {
  const int num_steps = static_cast<int>(x.size());
  const VectorXd s_0 = VectorXd::Constant(1, start);
  EXPECT_EQ(Describe(TimeSteppingSimulator<Step>(Step(), 1, 1, num_steps),
                     x,
                     s_0,
                     with_jacobian),
            expected);
  EXPECT_EQ(Describe(TrajectorySimulator<Step, State>(
                         Step(), State(), 1, 1, 1, num_steps),
                     x,
                     s_0,
                     with_jacobian),
            expected);
}

TEST(DescribeFailure, NamesTheStepThatOverflows) {
  for (const bool with_jacobian : {false, true}) {
    ExpectDescribed<SquareStep>(
        VectorXd::Zero(12),
        2.0,
        with_jacobian,
        "the state is not finite after time step 10 of 12");
    // NaN is not infinity; and a later infinity does not hide it.
    VectorXd x = VectorXd::Zero(12);
    x[6] = kNan;
    x[8] = std::numeric_limits<double>::infinity();
    ExpectDescribed<SquareStep>(
        x,
        2.0,
        with_jacobian,
        "the state is not finite after time step 7 of 12");
  }
}

TEST(DescribeFailure, NamesTheStepThatHasNoValue) {
  for (const bool with_jacobian : {false, true}) {
    ExpectDescribed<BoundedStep>(VectorXd::Constant(6, 3.0),
                                 0.0,
                                 with_jacobian,
                                 "the step has no value at time step 4 of 6");
  }
}

TEST(DescribeFailure, NamesTheStepWhoseDerivativeIsNotFinite) {
  VectorXd x = VectorXd::Ones(5);
  x[1] = 0.0;
  x[3] = 0.0;
  ExpectDescribed<RootStep>(
      x, 0.0, true, "its derivative is not finite at time step 2 of 5");
}

TEST(DescribeFailure, TellsAProductFromAStep) {
  ExpectDescribed<LargeStep>(
      VectorXd::Zero(5),
      0.0,
      true,
      "its derivatives are finite at every time step, and not over all 5");
}

TEST(DescribeFailure, NamesTheOutput) {
  const TrajectorySimulator<RootStep, Reciprocal> simulator(
      RootStep(), Reciprocal(), 1, 1, 1, 4);
  VectorXd x = VectorXd::Ones(4);
  x[2] = 0.0;
  for (const bool with_jacobian : {false, true}) {
    EXPECT_EQ(Describe(simulator, x, VectorXd::Zero(1), with_jacobian),
              "the output is not finite at time step 3 of 4");
  }
}

// The state turns in the box: the first of N steps after which it overflows is
// the first N for which a simulator of N steps fails.
TEST(DescribeFailure, NamesTheStepOfTheSchroedingerEquation) {
  constexpr int kNumSteps = 40;
  VectorXd start = VectorXd::Zero(SchroedingerSimulator::kStateSize);
  // Spread over the box, and flat: what it becomes has higher peaks.
  // Whether a sum overflows depends on fused multiply-adds.
  const VectorXd x = VectorXd::Zero(kNumSteps);
  VectorXd y(start.size());
  int expected = kNumSteps + 1;
  for (double size = 7e307; expected > kNumSteps; size *= 1.1) {
    ASSERT_LT(size, 1.7e308);
    for (int k = 0; k < start.size(); k += 2) start[k] = size;
    expected = 1;
    while (expected <= kNumSteps &&
           SchroedingerSimulator(expected, 0.05)
               .Evaluate(x.data(), start.data(), y.data(), nullptr)) {
      ++expected;
    }
  }
  ASSERT_GT(expected, 1);
  ASSERT_LE(expected, kNumSteps);
  EXPECT_EQ(Describe(SchroedingerSimulator(kNumSteps, 0.05), x, start, false),
            "the state is not finite after time step " +
                std::to_string(expected) + " of 40");
}

// dt x phi overflows where phi does not.
TEST(DescribeFailure, NamesTheStepOfTheSchroedingerEquationsDerivative) {
  // A field that takes away the energy of the ground state, so that the
  // midpoint is as large as phi although dt is large.
  const SchroedingerSimulator simulator(3, 10.0);
  const VectorXd start = 1e308 * SchroedingerSimulator::Eigenstate(1);
  const VectorXd x = VectorXd::Constant(3, -2.45);
  VectorXd y(start.size());
  ASSERT_TRUE(simulator.Evaluate(x.data(), start.data(), y.data(), nullptr));
  EXPECT_EQ(simulator.DescribeFailure(x.data(), start.data())
                .rfind("its derivative is not finite at time step ", 0),
            0u)
      << simulator.DescribeFailure(x.data(), start.data());
}

// Nothing is known of a simulator without time steps.
TEST(DescribeFailure, IsEmptyByDefault) {
  const IdentitySimulator identity(1);
  const double x = kNan;
  EXPECT_EQ(identity.DescribeFailure(&x, nullptr), "");
  EXPECT_EQ(SimulatorFailure(identity, &x, nullptr),
            "the simulator has no finite value");
}

TEST(DescribeFailure, TellsAValueFromADerivative) {
  const AutoDiffSimulator<Root, 1, 1> root;
  const std::string no_value = "the simulator has no finite value";
  const std::string no_derivative =
      "the simulator's value is finite, its derivative is not (an infinite "
      "slope, such as that of sqrt at 0?)";
  const double zero = 0.0;
  EXPECT_EQ(SimulatorFailure(root, &zero, nullptr), no_derivative);
  EXPECT_EQ(SimulatorFailure(root, &kNan, nullptr), no_value);
}

// What Train says in the end; weights 0 and bias 1, but for `slopes`.
std::string TrainMessage(std::shared_ptr<const Simulator> simulator,
                         std::shared_ptr<const Feedback> feedback,
                         const DataSet& data,
                         const VectorXd& slopes) {
  const auto num_outputs = static_cast<int>(slopes.size());
  const Model model(DenseNetwork({1, num_outputs}, Activation::kTanh),
                    std::move(simulator),
                    std::make_shared<SquaredNormLoss>(1, 1.0),
                    Reduction::kMean,
                    std::move(feedback));
  VectorXd weights(model.num_weights());
  for (int i = 0; i < num_outputs; ++i) {
    weights.segment<2>(2 * i) << slopes[i], 1.0;
  }
  TrainOptions options;
  options.max_num_steps = 1;
  options.initial_weights = weights;
  const TrainResult result = Train(model, data, "gradient_descent", options);
  EXPECT_EQ(result.error, "");
  return result.summary.message;
}

// Of 4 samples, number 2 gets u = 1 - 1 at the fifth step and in the loop at
// the first: there RootStep has a value and no derivative.
TEST(DescribeFailure, TrainingNamesSampleAndTimeStep) {
  constexpr int kNumSteps = 6;
  const auto simulator = std::make_shared<TimeSteppingSimulator<RootStep>>(
      RootStep(), 1, 1, kNumSteps);
  DataSet data;
  data.inputs = Eigen::MatrixXd::Zero(1, 4);
  data.inputs(0, 2) = -1.0;
  data.contexts = data.inputs;
  data.targets = Eigen::MatrixXd::Zero(1, 4);
  const std::string diverged =
      "diverged at step 1: sample 2: the simulator's value is finite, its "
      "derivative is not (an infinite slope, such as that of sqrt at 0?): ";
  EXPECT_EQ(
      TrainMessage(simulator, nullptr, data, VectorXd::Unit(kNumSteps, 4)),
      diverged + "its derivative is not finite at time step 5 of 6");
  EXPECT_EQ(TrainMessage(simulator, simulator, data, VectorXd::Ones(1)),
            diverged + "its derivative is not finite at time step 1 of 6");
}

TEST(DescribeFailure, TrainingNamesThemAtTheInitialWeights) {
  constexpr int kNumSteps = 10;
  const auto simulator = std::make_shared<TimeSteppingSimulator<SquareStep>>(
      SquareStep(), 1, 1, kNumSteps);
  DataSet data;
  data.inputs = Eigen::MatrixXd::Zero(1, 4);
  data.inputs(0, 2) = 1e200;
  data.contexts = Eigen::MatrixXd::Zero(1, 4);
  data.targets = Eigen::MatrixXd::Zero(1, 4);
  EXPECT_EQ(
      TrainMessage(simulator, nullptr, data, VectorXd::Unit(kNumSteps, 7)),
      "the loss is not finite at the initial weights: sample 2: the simulator "
      "has no finite value: the state is not finite after time step 9 of 10");
  // s_1 = 1e200 + u_0, s_2 = s_1^2 + u_1.
  data.contexts(0, 2) = 1e100;
  data.inputs(0, 2) = 1e100;
  EXPECT_EQ(TrainMessage(simulator, simulator, data, VectorXd::Zero(1)),
            "the loss is not finite at the initial weights: sample 2: the "
            "simulator has no finite value: there is no finite state after "
            "time step 2 of 10");
}

// A point problem names the step, too.
TEST(DescribeFailure, PointObjectiveSaysWhere) {
  // Starts by itself: it has no context.
  class Squares final : public Simulator {
   public:
    int num_inputs() const override { return 12; }
    int num_outputs() const override { return 1; }
    bool Evaluate(const double* x,
                  const double* /*context*/,
                  double* y,
                  double* jacobian) const override {
      const double start = 2.0;
      return steps_.Evaluate(x, &start, y, jacobian);
    }
    bool WeightedHessian(const double* x,
                         const double* /*context*/,
                         const double* w,
                         double* hessian) const override {
      const double start = 2.0;
      return steps_.WeightedHessian(x, &start, w, hessian);
    }
    std::string DescribeFailure(const double* x,
                                const double* /*context*/) const override {
      const double start = 2.0;
      return steps_.DescribeFailure(x, &start);
    }

   private:
    TimeSteppingSimulator<SquareStep> steps_{SquareStep(), 1, 1, 12};
  };
  const PointObjective objective(std::make_shared<Squares>(),
                                 std::make_shared<SquaredNormLoss>(1, 1.0),
                                 VectorXd::Zero(1),
                                 VectorXd::Zero(12));
  const std::string expected =
      "the simulator has no finite value: the state is not finite after "
      "time step 10 of 12";
  double cost = 0.0;
  std::string error;
  EXPECT_FALSE(objective.Cost(&cost, &error));
  EXPECT_EQ(error, expected);
  for (const bool jacobian : {false, true}) {
    LinearizationParts parts;
    parts.gradient = true;
    parts.jacobian = jacobian;
    Linearization at_x;
    error.clear();
    EXPECT_FALSE(objective.Linearize(parts, &at_x, &error));
    EXPECT_EQ(error, expected);
  }
}

}  // namespace describe_failure_test
}  // namespace invgrad
