#include "invgrad/inverse/descents.h"

#include <cmath>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "tests/inverse/bend_chain.h"
#include "tests/inverse/pull_one_back.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace descents_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

SimulatorPullBack::Options Descent(int num_steps,
                                   double step_size,
                                   bool rescale = false) {
  SimulatorPullBack::Options options = Way(SimulatorWay::kGradientDescent);
  options.gradient_descent = {num_steps, step_size, rescale};
  return options;
}

SimulatorPullBack::Options Lbfgs(int num_iterations, double tolerance) {
  SimulatorPullBack::Options options = Way(SimulatorWay::kLbfgs);
  options.lbfgs = {num_iterations, tolerance};
  return options;
}

TEST(DescendByGradient, OneStepIsTheAdjointTimesTheStepSize) {
  const auto simulator = MakeSimulator<2, 2>(Bend());
  const Vector2d x(0.4, -1.0);
  const Vector2d d_y(0.3, -2.0);
  const VectorXd adjoint =
      Pull(SimulatorPullBack(simulator, nullptr, Way(SimulatorWay::kAdjoint)),
           x,
           d_y)
          .d_x;
  for (const bool rescale : {false, true}) {
    const Pulled pulled =
        Pull(SimulatorPullBack(simulator, nullptr, Descent(1, 0.04, rescale)),
             x,
             d_y);
    EXPECT_LT((pulled.d_x - 0.04 * adjoint).norm(), 1e-15);
    EXPECT_EQ(pulled.result.source, PullBackSource::kInverse);
    EXPECT_EQ(pulled.result.why, "");
  }
}

// The error after k steps is (I - eta A^T A)^k times that at the start.
TEST(DescendByGradient, ConvergesToALinearInverseAtTheRateOfTheClosedForm) {
  const MatrixXd A = RandomMatrix(4, 4, 1) + 2.0 * MatrixXd::Identity(4, 4);
  const auto simulator = MakeLinear(A);
  const VectorXd x = RandomMatrix(4, 1, 2);
  const VectorXd d_y = RandomMatrix(4, 1, 3);
  const VectorXd inverse = A.inverse() * d_y;
  const double eta = 1.0 / A.squaredNorm();
  VectorXd error = -inverse;
  int k = 0;
  for (const int num_steps : {1, 2, 8, 50, 500}) {
    for (; k < num_steps; ++k) error -= eta * (A.transpose() * (A * error));
    const VectorXd d_x =
        Pull(SimulatorPullBack(simulator, nullptr, Descent(num_steps, eta)),
             x,
             d_y)
            .d_x;
    EXPECT_LT((d_x - (inverse + error)).norm(), 1e-13 * inverse.norm());
  }
  EXPECT_LT(error.norm(), 1e-3 * inverse.norm());
}

TEST(DescendByGradient, RescalesTheSumToTheLengthOfTheFirstStep) {
  const auto simulator = MakeSimulator<2, 2>(Bend());
  const Vector2d x(0.4, -1.0);
  const Vector2d d_y(0.3, -2.0);
  const auto pull = [&](int num_steps, bool rescale) {
    return Pull(SimulatorPullBack(
                    simulator, nullptr, Descent(num_steps, 0.04, rescale)),
                x,
                d_y)
        .d_x;
  };
  const VectorXd sum = pull(8, false);
  const VectorXd first = pull(1, false);
  EXPECT_LT((pull(8, true) - sum * (first.norm() / sum.norm())).norm(), 1e-15);
  EXPECT_GT(sum.norm(), 2.0 * first.norm());
}

TEST(DescendByGradient, DoesNotMoveWhereThereIsNoValueOnItsWay) {
  const auto simulator = MakeSimulator<2, 2>(Bend());
  const Pulled pulled =
      Pull(SimulatorPullBack(simulator, nullptr, Descent(3, 100.0)),
           Vector2d(0.4, -1.0),
           Vector2d(0.3, -2.0));
  EXPECT_EQ(pulled.result.source, PullBackSource::kNone);
  EXPECT_EQ(pulled.result.why,
            "gradient descent: no finite value after 2 steps of size 100");
  EXPECT_EQ(pulled.d_x, VectorXd(VectorXd::Zero(2)));
}

TEST(DescendByLbfgs, ReachesTheNumericalInverse) {
  const auto simulator = MakeSimulator<2, 2>(Bend());
  const Vector2d x(0.4, -1.0);
  const Vector2d d_y(1.3, 2.0);
  const VectorXd numerical =
      Pull(SimulatorPullBack(simulator, nullptr, Way(SimulatorWay::kNumerical)),
           x,
           d_y)
          .d_x;
  const Pulled pulled =
      Pull(SimulatorPullBack(simulator, nullptr, Lbfgs(200, 0.0)), x, d_y);
  EXPECT_EQ(pulled.result.source, PullBackSource::kInverse);
  EXPECT_LT((pulled.d_x - numerical).norm(), 1e-5 * numerical.norm());
  // A few iterations come nearer, and a tolerance ends them.
  const VectorXd target = pulled.y + d_y;
  const auto distance = [&](const SimulatorPullBack::Options& options) {
    const Vector2d x_new =
        x + Pull(SimulatorPullBack(simulator, nullptr, options), x, d_y).d_x;
    Vector2d y;
    EXPECT_TRUE(simulator->Evaluate(x_new.data(), nullptr, y.data(), nullptr));
    return (y - target).norm();
  };
  EXPECT_LT(distance(Lbfgs(1, 0.0)), d_y.norm());
  EXPECT_LT(distance(Lbfgs(5, 0.0)), distance(Lbfgs(1, 0.0)));
  EXPECT_GT(distance(Lbfgs(200, 0.1)), 1e3 * distance(Lbfgs(200, 0.0)));
}

// With more unknowns than outputs every point is a start.
TEST(DescendByLbfgs, ReachesAnUnderdeterminedTarget) {
  const MatrixXd A = RandomMatrix(3, 6, 1);
  const VectorXd d_y = RandomMatrix(3, 1, 3);
  const Pulled pulled =
      Pull(SimulatorPullBack(MakeLinear(A), nullptr, Lbfgs(200, 0.0)),
           RandomMatrix(6, 1, 2),
           d_y);
  EXPECT_LT((A * pulled.d_x - d_y).norm(), 1e-6 * d_y.norm());
}

TEST(DescendByLbfgs, AReachedTargetIsAStepOfZero) {
  const auto simulator = MakeSimulator<2, 2>(Bend());
  const Pulled pulled = Pull(SimulatorPullBack(simulator, nullptr, Lbfgs(9, 0)),
                             Vector2d(0.4, -1.0),
                             Vector2d::Zero());
  EXPECT_EQ(pulled.d_x, VectorXd(VectorXd::Zero(2)));
  // Where the adjoint is zero there is no descent.
  const Pulled flat = Pull(
      SimulatorPullBack(MakeLinear(MatrixXd::Zero(2, 2)), nullptr, Lbfgs(9, 0)),
      Vector2d(0.4, -1.0),
      Vector2d::Ones());
  EXPECT_EQ(flat.d_x, VectorXd(VectorXd::Zero(2)));
}

// With a gradient step in y, a descent lowers eta L itself, and the batch's cost
// stays the loss at x.
TEST(Descents, LowerTheLossOfAGradientStep) {
  constexpr double kEta = 0.5;
  constexpr double kStepSize = 0.02;
  const auto loss = QuarticLoss();
  const Model model = MakeModel(loss);
  const DataSet data = RandomData();
  const VectorXd weights = RandomWeights(model);
  const MatrixXd x = NetworkOutputs(model, weights, data);
  ChainPullBack::Options options =
      Ways(LossWay::kGradient, SimulatorWay::kGradientDescent);
  options.y_step_size = kEta;
  options.simulator.gradient_descent = {4, kStepSize, false};
  const auto change = [&](const ChainPullBack::Options& way) {
    ChainPullBack chain(&model, nullptr, way);
    const Linearization at = Linearized(&chain, weights, data);
    double cost = 0.0;
    std::string error;
    EXPECT_TRUE(model.Cost(weights, data, &cost, &error)) << error;
    EXPECT_NEAR(at.cost, cost, 1e-14 * cost);
    return WeightedChange(model, at);
  };
  MatrixXd expected = MatrixXd::Zero(2, kNumSamples);
  for (int s = 0; s < kNumSamples; ++s) {
    Vector2d at = x.col(s);
    for (int k = 0; k < 4; ++k) {
      Vector2d y, x_bar;
      const auto gradient = [&](const double* outputs, double* w) {
        double ignored = 0.0;
        return loss->Evaluate(
            outputs, data.targets.col(s).data(), &ignored, w, nullptr);
      };
      ASSERT_TRUE(model.simulator().Adjoint(
          at.data(), nullptr, gradient, y.data(), x_bar.data()));
      at -= kStepSize * kEta * x_bar;
    }
    expected.col(s) = at - x.col(s);
  }
  EXPECT_LT((change(options) - expected).norm(), 1e-13 * expected.norm());

  // The minimum of L is y*, for any eta, and y + d_y of a Newton step is not.
  options.simulator.way = SimulatorWay::kLbfgs;
  options.simulator.lbfgs = {200, 0.0};
  EXPECT_LT((x + change(options) - data.solutions).norm(), 1e-4);
  options.loss = LossWay::kNewton;
  const MatrixXd towards = change(options);
  EXPECT_GT((x + towards - data.solutions).norm(), 0.1);
  options.simulator.way = SimulatorWay::kNumerical;
  options.simulator.round_trip = 1e-9;
  EXPECT_LT((towards - change(options)).norm(), 1e-4);
}

// Bend as a field simulator: its Jacobian must not be formed.
class BendWithoutJacobian final : public Simulator {
 public:
  int num_inputs() const override { return 2; }
  int num_outputs() const override { return 2; }
  bool forms_jacobian() const override { return false; }
  bool Evaluate(const double* x,
                const double*,
                double* y,
                double* jacobian) const override {
    EXPECT_EQ(jacobian, nullptr) << "forms J";
    return Bend()(x, y);
  }
  bool Adjoint(const double* x,
               const double*,
               const Covector& covector,
               double* y,
               double* x_bar) const override {
    double w[2];
    if (!Bend()(x, y) || !covector(y, w)) return false;
    x_bar[0] = std::exp(x[0]) * w[0] + 2.0 * x[0] * w[1];
    x_bar[1] = w[1];
    return true;
  }
};

// Also where a descent fails.
TEST(Descents, NeverFormTheJacobian) {
  const auto simulator = std::make_shared<BendWithoutJacobian>();
  const Vector2d x(0.4, -1.0);
  for (const auto& options :
       {Descent(8, 0.04), Descent(8, 0.04, true), Lbfgs(16, 1e-5)}) {
    const Pulled pulled = Pull(
        SimulatorPullBack(simulator, nullptr, options), x, Vector2d(0.3, -2.0));
    EXPECT_EQ(pulled.result.source, PullBackSource::kInverse);
    EXPECT_GT(pulled.d_x.norm(), 0.0);
  }
  EXPECT_EQ(Pull(SimulatorPullBack(simulator, nullptr, Descent(3, 100.0)),
                 x,
                 Vector2d(0.3, -2.0))
                .result.source,
            PullBackSource::kNone);
}

}  // namespace descents_test
}  // namespace invgrad
