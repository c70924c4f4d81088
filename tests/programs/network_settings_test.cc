// Another network in front of a problem's physics.

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "bin/support/training_flags.h"
#include "gtest/gtest.h"
#include "invgrad/random.h"
#include "problems/problems.h"
#include "tests/support/create_problem.h"

namespace invgrad {
namespace network_settings_test {

// The loss is finite in front of another network too, in a closed loop as well.
void TakesAnotherNetwork(LearningProblem problem) {
  const LearningProblem own = problem;
  std::string error;
  ASSERT_TRUE(SetNetwork({"5-3", "gelu", "pytorch"}, &problem, &error))
      << error;
  const DenseNetwork& network = *problem.model->dense_network();
  EXPECT_EQ(network.widths(),
            (std::vector<int>{own.model->network().num_inputs(),
                              5,
                              3,
                              own.model->network().num_outputs()}));
  EXPECT_EQ(network.hidden_activation(), Activation::kGelu);
  EXPECT_EQ(problem.initialization, Initialization::kPytorch);
  EXPECT_EQ(&problem.model->simulator(), &own.model->simulator());
  EXPECT_EQ(&problem.model->loss(), &own.model->loss());
  EXPECT_EQ(problem.model->feedback(), own.model->feedback());
  EXPECT_EQ(problem.model->reduction(), own.model->reduction());
  NumpyRandom random(1);
  double cost = 0.0;
  EXPECT_TRUE(problem.model->Cost(
      network.InitialWeights(problem.initialization, &random),
      problem.train.Range(0, 1),
      &cost,
      &error))
      << error;
  EXPECT_TRUE(std::isfinite(cost));
}

// One test: parameters would create all problems before each test of the program.
TEST(NetworkSettings, EveryLearningProblemTakesAnotherNetwork) {
  int num_problems = 0;
  for (const ProblemRow& row : Problems()) {
    SCOPED_TRACE(row.name);
    PhysicsProblem problem;
    std::string error;
    ASSERT_TRUE(row.create({}, nullptr, &problem, &error)) << error;
    if (!problem.learning.has_value()) continue;
    TakesAnotherNetwork(*problem.learning);
    ++num_problems;
  }
  EXPECT_GT(num_problems, 20);
}

TEST(NetworkSettings, WhatIsNotGivenStays) {
  const LearningProblem own =
      CreateLearningProblem("oscillator_chain:coupling=cubic");
  const auto with = [&own](const NetworkSettings& settings) {
    LearningProblem problem = own;
    std::string error;
    EXPECT_TRUE(SetNetwork(settings, &problem, &error)) << error;
    return problem;
  };
  const DenseNetwork& own_network = *own.model->dense_network();
  LearningProblem problem = with({});
  EXPECT_EQ(problem.model->dense_network()->widths(), own_network.widths());
  EXPECT_EQ(problem.model->dense_network()->hidden_activation(),
            Activation::kRelu);
  EXPECT_EQ(problem.initialization, Initialization::kGlorotUniform);
  problem = with({"7", "", ""});
  EXPECT_EQ(problem.model->dense_network()->widths(),
            (std::vector<int>{4, 7, 96}));
  EXPECT_EQ(problem.model->dense_network()->hidden_activation(),
            Activation::kRelu);
  problem = with({"", "sigmoid", ""});
  EXPECT_EQ(problem.model->dense_network()->widths(), own_network.widths());
  EXPECT_EQ(problem.model->dense_network()->hidden_activation(),
            Activation::kSigmoid);
  problem = with({"", "", "he"});
  EXPECT_EQ(problem.model->dense_network()->hidden_activation(),
            Activation::kRelu);
  EXPECT_EQ(problem.initialization, Initialization::kHeUniform);
}

TEST(NetworkSettings, SaysWhatItRefusesAndChangesNothing) {
  const std::vector<std::pair<NetworkSettings, std::string>> cases = {
      {{"20-x", "", ""}, "hidden=20-x: width=x"},
      {{"20-0-20", "", ""}, "hidden=20-0-20: width=0 is out of range"},
      {{"20--20", "", ""}, "hidden=20--20: width= "},
      {{"-20", "", ""}, "as in 20-20-20"},
      {{"20-", "", ""}, "as in 20-20-20"},
      {{"1000000-1000000", "", ""}, "more than the 2147483647 weights"},
      {{"", "sine", ""},
       "activation=sine is no choice; allowed: one of linear, tanh, relu, "
       "sigmoid, gelu"},
      {{"5", "relu", "xavier"},
       "initialization=xavier is no choice; allowed: one of glorot, he, "
       "pytorch"}};
  LearningProblem problem = CreateLearningProblem("toy_network");
  const Model* const model = problem.model.get();
  for (const auto& [settings, words] : cases) {
    SCOPED_TRACE(words);
    std::string error;
    EXPECT_FALSE(SetNetwork(settings, &problem, &error));
    EXPECT_NE(error.find(words), std::string::npos) << error;
    EXPECT_EQ(problem.model.get(), model);
  }
}

TEST(NetworkSettings, ADifferentialEquationNeedsALaplacian) {
  LearningProblem problem = CreateLearningProblem("poisson_pinn");
  std::string error;
  EXPECT_FALSE(SetNetwork({"", "relu", ""}, &problem, &error));
  EXPECT_EQ(
      error,
      "activation=relu has no second derivative, which this problem needs");
  EXPECT_EQ(problem.model->dense_network()->hidden_activation(),
            Activation::kTanh);
}

}  // namespace network_settings_test
}  // namespace invgrad
