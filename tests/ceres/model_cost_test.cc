#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/gradient_checker.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/ceres/model_function.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/cost.h"
#include "invgrad/random.h"

namespace invgrad {
namespace model_cost_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// y = (x0 x1, x0 + x1^2).
struct Curved {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    y[0] = x[0] * x[1];
    y[1] = x[0] + x[1] * x[1];
    return true;
  }
};

class ModelCostTest : public testing::TestWithParam<Reduction> {
 protected:
  ModelCostTest()
      : model_(DenseNetwork({2, 3, 2}, Activation::kTanh),
               std::make_shared<AutoDiffSimulator<Curved, 2, 2>>(),
               std::make_shared<SquaredNormLoss>(2, 3.0),
               GetParam()) {
    NumpyRandom random(1);
    data_.inputs = random.Rand(2, 5);
    data_.contexts.resize(0, 5);
    data_.targets = random.Rand(2, 5);
    weights_ =
        model_.network().InitialWeights(Initialization::kPytorch, &random);
  }

  Model model_;
  DataSet data_;
  VectorXd weights_;
};

TEST_P(ModelCostTest, ProblemHasTheModelsHessian) {
  LinearizationParts parts;
  parts.hessian = true;
  Linearization of_model, of_problem;
  std::string error;
  ASSERT_TRUE(model_.Linearize(weights_, data_, parts, &of_model, &error));
  ceres::Problem problem;
  AddModelToProblem(model_, data_, weights_.data(), &problem);
  const ProblemLinearizer linearizer(&problem, {});
  ASSERT_TRUE(linearizer.Linearize(parts, &of_problem, &error)) << error;
  // The same terms, summed in another order.
  EXPECT_LT((of_problem.hessian - of_model.hessian).norm(),
            1e-12 * of_model.hessian.norm());
}

TEST_P(ModelCostTest, ProblemHasTheModelsCostAndGradient) {
  LinearizationParts parts;
  parts.gradient = true;
  Linearization at;
  std::string error;
  ASSERT_TRUE(model_.Linearize(weights_, data_, parts, &at, &error));

  ceres::Problem problem;
  AddModelToProblem(model_, data_, weights_.data(), &problem);
  EXPECT_EQ(problem.NumParameterBlocks(), 5);
  EXPECT_EQ(problem.NumResiduals(), 10);
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = WeightBlocks(model_.network(), weights_.data());
  double cost;
  std::vector<double> gradient;
  std::vector<double> residuals;
  ASSERT_TRUE(problem.Evaluate(options, &cost, &residuals, &gradient, nullptr));
  // Sums of ten to a hundred terms of order one.
  EXPECT_NEAR(cost, at.cost, 1e-13);
  ASSERT_EQ(static_cast<int>(gradient.size()), model_.num_weights());
  for (int k = 0; k < model_.num_weights(); ++k) {
    EXPECT_NEAR(gradient[k], at.gradient[k], 1e-13);
  }
  // Without Jacobians the residuals take another way.
  std::vector<double> residuals_alone;
  ASSERT_TRUE(
      problem.Evaluate(options, &cost, &residuals_alone, nullptr, nullptr));
  EXPECT_NEAR(cost, at.cost, 1e-13);
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    EXPECT_NEAR(residuals_alone[i], residuals[i], 1e-14);
  }

  const ModelFunction function(&model_, &data_);
  ASSERT_EQ(function.NumParameters(), model_.num_weights());
  VectorXd function_gradient(model_.num_weights());
  ASSERT_TRUE(
      function.Evaluate(weights_.data(), &cost, function_gradient.data()));
  EXPECT_EQ(cost, at.cost);
  EXPECT_EQ(function_gradient, at.gradient);
  ASSERT_TRUE(function.Evaluate(weights_.data(), &cost, nullptr));
  EXPECT_NEAR(cost, at.cost, 1e-13);
}

TEST_P(ModelCostTest, PassesCeresGradientChecker) {
  const ModelCost function(model_, data_);
  ceres::NumericDiffOptions options;
  const ceres::GradientChecker checker(
      &function,
      static_cast<const std::vector<const ceres::Manifold*>*>(nullptr),
      options);
  const std::vector<double*> blocks =
      WeightBlocks(model_.network(), weights_.data());
  ceres::GradientChecker::ProbeResults results;
  // Ridders' extrapolation reaches about 1e-10.
  EXPECT_TRUE(checker.Probe(blocks.data(), 1e-8, &results))
      << results.error_log;
}

TEST_P(ModelCostTest, JacobiansOfConstantNeuronsAreNotAskedFor) {
  ceres::Problem problem;
  AddModelToProblem(model_, data_, weights_.data(), &problem);
  const std::vector<double*> blocks =
      WeightBlocks(model_.network(), weights_.data());
  problem.SetParameterBlockConstant(blocks[0]);
  const VectorXd before = weights_;
  ceres::Solver::Options options;
  options.max_num_iterations = 20;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  EXPECT_LT(summary.final_cost, summary.initial_cost);
  EXPECT_EQ(weights_.head(3), before.head(3));
  EXPECT_NE(weights_[3], before[3]);
}

INSTANTIATE_TEST_SUITE_P(Reductions,
                         ModelCostTest,
                         testing::Values(Reduction::kMean, Reduction::kSum));

// Targets that the network itself made: the least cost is zero, and Ceres'
// Levenberg-Marquardt finds it from elsewhere.
TEST(AddModelToProblem, CeresTrainsARegression) {
  const Model model(DenseNetwork({1, 2, 1}, Activation::kTanh),
                    std::make_shared<IdentitySimulator>(1),
                    std::make_shared<SquaredNormLoss>(1, 0.5),
                    Reduction::kSum);
  NumpyRandom random(2);
  VectorXd weights =
      model.network().InitialWeights(Initialization::kPytorch, &random);
  DataSet data;
  data.inputs = VectorXd::LinSpaced(20, -2.0, 2.0).transpose();
  data.contexts.resize(0, 20);
  std::string error;
  ASSERT_TRUE(model.Predict(weights, data, &data.targets, &error));
  for (double& weight : weights) weight += random.Uniform(-0.3, 0.3);

  ceres::Problem problem;
  AddModelToProblem(model, data, weights.data(), &problem);
  ceres::Solver::Options options;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-30;
  options.gradient_tolerance = 1e-30;
  options.parameter_tolerance = 1e-30;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  EXPECT_GT(summary.initial_cost, 1e-3);
  EXPECT_LT(summary.final_cost, 1e-12);
  double cost;
  ASSERT_TRUE(model.Cost(weights, data, &cost, &error));
  EXPECT_NEAR(cost, summary.final_cost, 1e-20);
}

TEST(ModelCost, FailsWhereTheModelDoes) {
  const Model model(DenseNetwork({1, 1}, Activation::kLinear),
                    std::make_shared<IdentitySimulator>(1),
                    std::make_shared<SquaredNormLoss>(1, 0.5),
                    Reduction::kSum);
  DataSet data;
  data.inputs = MatrixXd::Ones(1, 1);
  data.contexts.resize(0, 1);
  data.targets = MatrixXd::Zero(1, 1);
  double weights[] = {std::numeric_limits<double>::quiet_NaN(), 0.0};
  const double* blocks[] = {weights};
  double residual;
  double jacobian[2];
  double* jacobians[] = {jacobian};
  const ModelCost function(model, data);
  EXPECT_FALSE(function.Evaluate(blocks, &residual, nullptr));
  EXPECT_FALSE(function.Evaluate(blocks, &residual, jacobians));
  double cost;
  EXPECT_FALSE(ModelFunction(&model, &data).Evaluate(weights, &cost, jacobian));
}

}  // namespace model_cost_test
}  // namespace invgrad
