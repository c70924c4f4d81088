#include "problems/oscillator_chain.h"

#include <cmath>

#include "gtest/gtest.h"
#include "tests/support/create_problem.h"

namespace invgrad {
namespace oscillator_chain_test {

using AnyOscillators = OscillatorStep<0>;

// (q, v) after `num_steps` with no force.
Eigen::VectorXd Roll(const AnyOscillators& step,
                     const Eigen::VectorXd& start,
                     int num_steps) {
  Eigen::VectorXd state = start, next(start.size());
  const double u = 0.0;
  for (int t = 0; t < num_steps; ++t) {
    EXPECT_TRUE(step(state.data(), &u, next.data()));
    state.swap(next);
  }
  return state;
}

TEST(OscillatorStep, UncoupledOscillatorsReturnAfterTwoPi) {
  AnyOscillators step;
  step.linear = 0.0;
  step.dt = 2.0 * M_PI / 1000.0;
  const Eigen::Vector4d start(0.3, -0.2, 0.5, 0.1);
  // Global error of order dt^4 times the time.
  EXPECT_LT((Roll(step, start, 1000) - start).norm(), 1e-9);
}

TEST(OscillatorStep, IsOfOrderFour) {
  for (const double cubic : {0.0, 1.0}) {
    AnyOscillators step;
    step.cubic = cubic;
    const Eigen::Vector4d start(0.9, -0.7, 0.5, 0.3);
    const auto at_dt = [&](int num_steps) {
      step.dt = 4.0 / num_steps;
      return Roll(step, start, num_steps);
    };
    const Eigen::VectorXd exact = at_dt(4096);
    const double coarse = (at_dt(32) - exact).norm();
    const double fine = (at_dt(64) - exact).norm();
    EXPECT_NEAR(std::log2(coarse / fine), 4.0, 0.3) << "cubic " << cubic;
  }
}

TEST(OscillatorStep, ConservesEnergyWithoutForce) {
  AnyOscillators step;
  step.num_oscillators = 3;
  step.linear = 0.4;
  step.cubic = 0.8;
  step.dt = 0.005;
  const auto energy = [&](const Eigen::VectorXd& s) {
    double sum = 0.5 * s.squaredNorm();
    for (int i = 0; i < 2; ++i) {
      const double gap = s[i + 1] - s[i];
      sum += 0.5 * step.linear * gap * gap +
             0.25 * step.cubic * std::pow(gap, 4.0);
    }
    return sum;
  };
  Eigen::VectorXd start(6);
  start << 0.5, -0.8, 0.3, 0.1, 0.6, -0.4;
  // The state is off by some dt^4 times the time, 6e-10 * 10.
  EXPECT_NEAR(energy(Roll(step, start, 2000)), energy(start), 6e-9);
}

TEST(OscillatorStep, SwappingTheOscillatorsSwapsTheMotion) {
  AnyOscillators step;
  step.cubic = 1.0;
  const Eigen::Vector4d start(0.9, -0.7, 0.5, 0.3);
  const Eigen::Vector4d swapped(-0.7, 0.9, 0.3, 0.5);
  const Eigen::VectorXd a = Roll(step, start, 50);
  const Eigen::VectorXd b = Roll(step, swapped, 50);
  EXPECT_LT((a - Eigen::Vector4d(b[1], b[0], b[3], b[2])).norm(), 1e-13);
}

TEST(OscillatorStep, ForceActsOnTheLastOscillatorOnly) {
  AnyOscillators step;
  step.control = 3.0;
  const Eigen::Vector4d rest = Eigen::Vector4d::Zero();
  Eigen::Vector4d derivative;
  step.Derivative(rest.data(), 2.0, derivative.data());
  EXPECT_EQ(derivative, Eigen::Vector4d(0.0, 0.0, 0.0, 6.0));
}

TEST(OscillatorChain, DataAreNumpys) {
  // import numpy as np; np.random.seed(0); np.random.rand(8192, 4)[0]
  const LearningProblem problem = CreateLearningProblem("oscillator_chain");
  const DataSet& train = problem.train;
  EXPECT_EQ(train.inputs(0, 0), 0.5488135039273248);
  EXPECT_EQ(train.inputs(1, 0), 0.7151893663724195);
  EXPECT_EQ(train.inputs(2, 0), 0.6027633760716439);
  EXPECT_EQ(train.inputs(3, 0), 0.5448831829968969);
  EXPECT_EQ(train.num_samples(), 4096);
  EXPECT_EQ(problem.test.num_samples(), 4096);
  // 4-20-20-20-24: 1,444 weights; with 96 steps 2,956.
  EXPECT_EQ(problem.model->num_weights(), 1444);
  EXPECT_EQ(CreateLearningProblem("oscillator_chain:coupling=cubic")
                .model->num_weights(),
            2956);
}

}  // namespace oscillator_chain_test
}  // namespace invgrad
