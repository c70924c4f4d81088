#include "invgrad/equations/equation_cost.h"

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/gradient_checker.h"
#include "ceres/problem.h"
#include "gtest/gtest.h"
#include "invgrad/cost.h"
#include "invgrad/equation.h"
#include "invgrad/minimize.h"
#include "invgrad/random.h"
#include "invgrad/rules.h"
#include "tests/equations/decay.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace equation_cost_test {

using Eigen::VectorXd;

// Decay with exact values of the solution of rate 2 at 5 points.
Equation Measured(double first_rate) {
  Equation decay = DecayEquation(first_rate);
  EquationTerm values;
  values.name = "values";
  values.residual = std::make_shared<ValueResidual>(decay.trial, 1);
  values.points = SequencePoints(kDecayBox, 5, 0);
  values.context = [](const VectorXd& point, Eigen::Index, auto c) {
    c[0] = DecaySolution(2.0, point);
  };
  decay.terms.push_back(values);
  return decay;
}

TEST(EquationCost, DerivativesAreDifferences) {
  Equation equation = Measured(1.3);
  DataSet samples;
  std::string error;
  ASSERT_TRUE(EquationSamples(equation, &samples, &error)) << error;
  const EquationCostFunction cost(equation, samples);
  const Model model = EquationModel(equation);
  VectorXd weights = RandomMatrix(model.num_weights(), 1, 3);
  std::vector<const double*> blocks;
  for (double* block : WeightBlocks(model.network(), weights.data())) {
    blocks.push_back(block);
  }
  blocks.push_back(equation.coefficients.data());
  ceres::NumericDiffOptions options;
  options.ridders_relative_initial_step_size = 1e-3;
  const std::vector<const ceres::Manifold*>* const no_manifolds = nullptr;
  ceres::GradientChecker checker(&cost, no_manifolds, options);
  ceres::GradientChecker::ProbeResults results;
  EXPECT_TRUE(checker.Probe(blocks.data(), 1e-6, &results))
      << results.error_log;
}

TEST(EquationCost, CostIsTheLossOfTheModel) {
  Equation equation = Measured(1.3);
  const Model model = EquationModel(equation);
  VectorXd weights = RandomMatrix(model.num_weights(), 1, 3);
  DataSet samples;
  std::string error;
  double loss = 0.0, cost = 0.0;
  ASSERT_TRUE(EquationSamples(equation, &samples, &error)) << error;
  ASSERT_TRUE(model.Cost(weights, samples, &loss, &error)) << error;
  ceres::Problem problem;
  ASSERT_TRUE(AddEquationToProblem(&equation, &weights, &problem, &error));
  EXPECT_EQ(problem.NumParameterBlocks(),
            static_cast<int>(model.network().WeightBlocks().size()) + 1);
  ASSERT_TRUE(problem.Evaluate({}, &cost, nullptr, nullptr, nullptr));
  EXPECT_NEAR(cost, loss, 1e-14 * loss);
}

TEST(EquationCost, FindsTheCoefficient) {
  Equation equation = Measured(1.0);
  const Model model = EquationModel(equation);
  NumpyRandom random(1);
  VectorXd weights =
      model.network().InitialWeights(Initialization::kGlorotUniform, &random);
  ceres::Problem problem;
  std::string error;
  ASSERT_TRUE(AddEquationToProblem(&equation, &weights, &problem, &error));
  const auto rule = MakeRule("geodesic");
  MinimizerOptions options;
  options.max_num_iterations = 100;
  MinimizerSummary summary;
  Minimize(options, rule.get(), &problem, &summary);
  // As well as eight neurons know u.
  EXPECT_NEAR(equation.coefficients[0], 2.0, 1e-3);
  // A coefficient that is constant stays.
  equation.coefficients[0] = 1.0;
  problem.SetParameterBlockConstant(equation.coefficients.data());
  Minimize(options, rule.get(), &problem, &summary);
  EXPECT_EQ(equation.coefficients[0], 1.0);
}

}  // namespace equation_cost_test
}  // namespace invgrad
