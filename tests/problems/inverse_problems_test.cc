// The problems that know an inverse: sine, exponential, multimodal and
// squared_component.
#include <cmath>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/random.h"
#include "problems/problems.h"

namespace invgrad {
namespace inverse_problems_test {

constexpr double kPi = 3.14159265358979323846;

PhysicsProblem Create(const std::string& specification) {
  PhysicsProblem problem;
  std::string error;
  EXPECT_TRUE(CreateProblem(specification, nullptr, &problem, &error)) << error;
  return problem;
}

Eigen::VectorXd Invert(const InverseSimulator& inverse,
                       const Eigen::VectorXd& y,
                       const Eigen::VectorXd& x0) {
  Eigen::VectorXd x;
  std::string why;
  EXPECT_TRUE(inverse.Invert(y, x0, Eigen::VectorXd(), &x, &why)) << why;
  return x;
}

class WithInverse : public ::testing::TestWithParam<std::string> {};

// From everywhere, to the outputs of everywhere.
TEST_P(WithInverse, PUndoesItsInverse) {
  const PhysicsProblem problem = Create(GetParam());
  const bool is_point = problem.point.has_value();
  const Simulator& simulator = is_point ? *problem.point->simulator
                                        : problem.learning->model->simulator();
  const InverseSimulator& inverse =
      is_point ? *problem.point->inverse : *problem.learning->inverse;
  NumpyRandom random(3);
  const int n = simulator.num_inputs();
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::VectorXd source = 2.0 * random.Rand(n, 1).array() - 1.0;
    const Eigen::VectorXd x0 = 2.0 * random.Rand(n, 1).array() - 1.0;
    Eigen::VectorXd y(simulator.num_outputs());
    ASSERT_TRUE(simulator.Evaluate(source.data(), nullptr, y.data(), nullptr));
    const Eigen::VectorXd x = Invert(inverse, y, x0);
    Eigen::VectorXd again(y.size());
    ASSERT_TRUE(simulator.Evaluate(x.data(), nullptr, again.data(), nullptr));
    // Conditioning: h reaches a few hundred, so that a rounding of x moves
    // sin h by some 1e-13.
    EXPECT_LT((again - y).norm(), 1e-11 * (1.0 + y.norm()));
    // A local inverse leaves a solution where it is.
    EXPECT_LT((Invert(inverse, y, x) - x).norm(), 1e-10 * (1.0 + x.norm()));
  }
}

INSTANTIATE_TEST_SUITE_P(Problems,
                         WithInverse,
                         ::testing::Values("squared_component",
                                           "sine_point:xi=4",
                                           "sine",
                                           "sine:xi=32:phi=45",
                                           "sine:xi=64:phi=-100",
                                           "exponential",
                                           "multimodal"),
                         [](const auto& info) {
                           std::string name = info.param;
                           for (char& c : name) {
                             if (std::isalnum(c) == 0) c = '_';
                           }
                           return name;
                         });

// No other pre-image is closer: all of them within some periods are tried.
TEST(Sine, ItsInverseIsTheClosestPreImage) {
  const double xi = 3.0;
  const double phi = 20.0 * kPi / 180.0;
  const PhysicsProblem problem = Create("sine:xi=3:phi=20");
  NumpyRandom random(4);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Vector2d y(random.Uniform(-1.0, 1.0),
                            random.Uniform(-1.0, 1.0));
    const Eigen::Vector2d x0(random.Uniform(-4.0, 4.0),
                             random.Uniform(-4.0, 4.0));
    double closest = 1e300;
    for (int period = -10; period <= 10; ++period) {
      for (const double angle : {std::asin(y[0]), kPi - std::asin(y[0])}) {
        const double a = (angle + 2.0 * kPi * period) * xi / 10.0;
        const double b = y[1] / (10.0 * xi);
        const Eigen::Vector2d x(std::cos(phi) * a + std::sin(phi) * b,
                                std::cos(phi) * b - std::sin(phi) * a);
        closest = std::min(closest, (x - x0).norm());
      }
    }
    const Eigen::VectorXd x = Invert(*problem.learning->inverse, y, x0);
    EXPECT_NEAR((x - x0).norm(), closest, 1e-12);
  }
}

TEST(Sine, TheMetricIsTheDistanceToIt) {
  const PhysicsProblem problem = Create("sine:xi=8:phi=30:num_samples=50");
  const PhysicsProblem relative =
      Create("sine:xi=8:phi=30:num_samples=50:metric=relative_distance");
  const DataSet& data = problem.learning->test;
  Eigen::MatrixXd x(2, data.num_samples());
  for (int s = 0; s < data.num_samples(); ++s) {
    x.col(s) = Invert(
        *problem.learning->inverse, data.targets.col(s), Eigen::Vector2d(1, 2));
  }
  EXPECT_LT(problem.learning->metric->evaluate(x, data), 1e-14);
  x.row(0).array() += 0.003;
  x.row(1).array() -= 0.004;
  // The shift is far below half the distance between two pre-images for all
  // samples but those near a maximum of the sine.
  const double distance = problem.learning->metric->evaluate(x, data);
  EXPECT_LT(distance, 0.005 + 1e-14);
  EXPECT_GT(distance, 0.0045);
  EXPECT_NEAR(
      relative.learning->metric->evaluate(x, data), distance / 8.0, 1e-16);
}

TEST(InverseProblems, WhatHasNoPreImageIsRefusedWithAReason) {
  const std::vector<std::pair<std::string, Eigen::VectorXd>> cases = {
      {"sine", Eigen::Vector2d(1.0000001, 0.0)},
      {"sine", Eigen::Vector2d(std::nan(""), 0.0)},
      {"exponential", Eigen::VectorXd::Zero(1)},
      {"multimodal", Eigen::VectorXd::Constant(1, -1e-9)},
  };
  for (const auto& [name, y] : cases) {
    SCOPED_TRACE(name);
    const PhysicsProblem problem = Create(name);
    Eigen::VectorXd x;
    std::string why;
    EXPECT_FALSE(problem.learning->inverse->Invert(
        y, Eigen::VectorXd::Ones(y.size()), Eigen::VectorXd(), &x, &why));
    EXPECT_NE(why.find("the inverse has no x for y = ("), std::string::npos)
        << why;
  }
}

TEST(InverseProblems, SolutionsSolve) {
  for (const char* name : {"exponential", "multimodal"}) {
    SCOPED_TRACE(name);
    const PhysicsProblem problem = Create(name);
    const DataSet& data = problem.learning->train;
    ASSERT_EQ(data.solutions.cols(), data.num_samples());
    for (int s = 0; s < 20; ++s) {
      double y = 0.0;
      ASSERT_TRUE(problem.learning->model->simulator().Evaluate(
          data.solutions.col(s).data(), nullptr, &y, nullptr));
      EXPECT_DOUBLE_EQ(y, data.targets(0, s));
    }
    EXPECT_EQ(problem.learning->metric->evaluate(data.solutions, data), 0.0);
  }
}

}  // namespace inverse_problems_test
}  // namespace invgrad
