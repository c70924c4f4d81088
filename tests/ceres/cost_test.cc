// Simulators and networks as cost functions of Ceres: against Ceres' own
// automatic differentiation of the same functors, to rounding, and against its
// numerical differences.

#include "invgrad/cost.h"

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/dynamic_autodiff_cost_function.h"
#include "ceres/gradient_checker.h"
#include "ceres/normal_prior.h"
#include "ceres/solver.h"
#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/dense_network.h"
#include "invgrad/random.h"

namespace invgrad {
namespace cost_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Sums of up to a hundred terms of order one.
constexpr double kRounding = 1e-12;

// y = (x0 x1 c, sin x0 + x1^2, x0), c: the context.
struct Curved {
  template <typename T, typename C>
  bool operator()(const T* x, const C* context, T* y) const {
    using std::sin;
    y[0] = x[0] * x[1] * context[0];
    y[1] = sin(x[0]) + x[1] * x[1];
    y[2] = x[0];
    return true;
  }
};
using CurvedSimulator = AutoDiffSimulator<Curved, 2, 3, 1>;

// The same as a functor of Ceres.
struct CurvedResidual {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    const double context = 0.7;
    if (!Curved()(x, &context, r)) return false;
    for (int i = 0; i < 3; ++i) r[i] -= target[i];
    return true;
  }
  Vector3d target;
};

// Values and Jacobians of the same parameters are equal to rounding.
void ExpectEqual(const ceres::CostFunction& cost,
                 const ceres::CostFunction& expected,
                 const std::vector<const double*>& parameters) {
  ASSERT_EQ(cost.num_residuals(), expected.num_residuals());
  ASSERT_EQ(cost.parameter_block_sizes(), expected.parameter_block_sizes());
  const int m = cost.num_residuals();
  const auto evaluate = [&](const ceres::CostFunction& function,
                            VectorXd* residuals) {
    std::vector<VectorXd> blocks;
    std::vector<double*> jacobians;
    for (const int size : function.parameter_block_sizes()) {
      blocks.emplace_back(VectorXd::Zero(m * size));
    }
    for (VectorXd& block : blocks) jacobians.push_back(block.data());
    residuals->resize(m);
    EXPECT_TRUE(function.Evaluate(
        parameters.data(), residuals->data(), jacobians.data()));
    VectorXd alone(m);
    EXPECT_TRUE(function.Evaluate(parameters.data(), alone.data(), nullptr));
    EXPECT_LE((alone - *residuals).norm(), kRounding);
    return blocks;
  };
  VectorXd residuals, expected_residuals;
  const auto jacobians = evaluate(cost, &residuals);
  const auto expected_jacobians = evaluate(expected, &expected_residuals);
  EXPECT_LE((residuals - expected_residuals).norm(), kRounding);
  for (std::size_t b = 0; b < jacobians.size(); ++b) {
    EXPECT_LE((jacobians[b] - expected_jacobians[b]).norm(), kRounding)
        << "block " << b;
  }
}

TEST(SimulatorCost, IsCeresAutoDiffOfTheFunctor) {
  const Vector3d target(0.3, -0.2, 1.0);
  const SimulatorCost cost(
      std::make_shared<CurvedSimulator>(), target, VectorXd::Constant(1, 0.7));
  const ceres::AutoDiffCostFunction<CurvedResidual, 3, 2> expected(
      new CurvedResidual{target});
  const double x[] = {0.4, -1.3};
  ExpectEqual(cost, expected, {x});
}

// The context as the second parameter block: an unknown parameter of the
// physics.
struct CurvedResidualOfBoth {
  template <typename T>
  bool operator()(const T* x, const T* context, T* r) const {
    if (!Curved()(x, context, r)) return false;
    for (int i = 0; i < 3; ++i) r[i] -= target[i];
    return true;
  }
  Vector3d target;
};

TEST(SimulatorCost, TakesTheContextAsAParameterBlock) {
  const Vector3d target(0.3, -0.2, 1.0);
  const ceres::AutoDiffCostFunction<CurvedResidualOfBoth, 3, 2, 1> expected(
      new CurvedResidualOfBoth{target});
  const double x[] = {0.4, -1.3};
  const double context[] = {0.7};
  ExpectEqual(SimulatorCost(std::make_shared<CurvedSimulator>(), target),
              expected,
              {x, context});
  // Through a cost function as the simulator, and a residual behind it.
  const auto functor = std::make_shared<
      ceres::AutoDiffCostFunction<CurvedResidualOfBoth, 3, 2, 1>>(
      new CurvedResidualOfBoth{Vector3d::Zero()});
  ExpectEqual(
      SimulatorCost(std::make_shared<CostFunctionSimulator>(functor, 1),
                    std::make_shared<ceres::NormalPrior>(
                        MatrixXd(MatrixXd::Identity(3, 3)), VectorXd(target))),
      expected,
      {x, context});
}

// Only one of the two blocks is variable.
TEST(SimulatorCost, ConstantBlocksNeedNoJacobian) {
  const SimulatorCost cost(std::make_shared<CurvedSimulator>(),
                           Vector3d::Zero());
  const double x[] = {0.4, -1.3};
  const double context[] = {0.7};
  const double* const parameters[] = {x, context};
  Vector3d r;
  Eigen::Matrix<double, 3, 2, Eigen::RowMajor> of_input;
  Vector3d of_context;
  double* only_input[] = {of_input.data(), nullptr};
  double* only_context[] = {nullptr, of_context.data()};
  ASSERT_TRUE(cost.Evaluate(parameters, r.data(), only_input));
  ASSERT_TRUE(cost.Evaluate(parameters, r.data(), only_context));
  EXPECT_LE((of_input.row(0) - Eigen::RowVector2d(-0.91, 0.28)).norm(),
            kRounding);
  EXPECT_LE((of_context - Vector3d(-0.52, 0.0, 0.0)).norm(), kRounding);
}

// A functor whose context is double* has no derivatives by it.
struct ConstantContext {
  template <typename T>
  bool operator()(const T* x, const double* context, T* y) const {
    y[0] = x[0] * context[0];
    return true;
  }
};

TEST(SimulatorCost, ContextWithoutDerivativesIsNoParameterBlock) {
  const auto simulator =
      std::make_shared<AutoDiffSimulator<ConstantContext, 1, 1, 1>>();
  EXPECT_FALSE(simulator->has_context_jacobian());
  EXPECT_DEATH(SimulatorCost(simulator, VectorXd::Zero(1)),
               "give the context to the constructor");
}

// A (y - y*) by Ceres' own NormalPrior: the residual in front of the simulator.
TEST(SimulatorCost, TakesAnyResidualOfTheOutput) {
  const Vector3d target(0.3, -0.2, 1.0);
  MatrixXd A(2, 3);
  A << 1.0, 2.0, -1.0, 0.5, 0.0, 3.0;
  const auto simulator = std::make_shared<CurvedSimulator>();
  const VectorXd context = VectorXd::Constant(1, 0.7);
  const SimulatorCost plain(simulator, target, context);
  const SimulatorCost cost(
      simulator, std::make_shared<ceres::NormalPrior>(A, target), context);
  const double x[] = {0.4, -1.3};
  const double* const parameters = x;
  VectorXd r(2), y(3);
  Eigen::Matrix<double, 2, 2, Eigen::RowMajor> J;
  Eigen::Matrix<double, 3, 2, Eigen::RowMajor> J_plain;
  double* of_cost = J.data();
  double* of_plain = J_plain.data();
  ASSERT_TRUE(cost.Evaluate(&parameters, r.data(), &of_cost));
  ASSERT_TRUE(plain.Evaluate(&parameters, y.data(), &of_plain));
  EXPECT_LE((r - A * y).norm(), kRounding);
  EXPECT_LE((J - A * J_plain).norm(), kRounding);
  ASSERT_TRUE(cost.Evaluate(&parameters, r.data(), nullptr));
  EXPECT_LE((r - A * y).norm(), kRounding);
}

TEST(SimulatorCost, SizesMustFit) {
  const auto simulator = std::make_shared<CurvedSimulator>();
  EXPECT_DEATH(SimulatorCost(simulator, Vector2d(1.0, 2.0), VectorXd::Ones(1)),
               "target_.size");
  EXPECT_DEATH(SimulatorCost(simulator, Vector3d::Zero(), Vector2d::Zero()),
               "context_.size");
}

class EveryActivation : public testing::TestWithParam<Activation> {
 protected:
  EveryActivation()
      : network_(std::make_shared<DenseNetwork>(std::vector<int>{2, 4, 3},
                                                GetParam())) {
    NumpyRandom random(3);
    weights_ = network_->InitialWeights(Initialization::kPytorch, &random);
  }
  const std::shared_ptr<const DenseNetwork> network_;
  VectorXd weights_;
  const Vector2d input_{0.6, -0.4};
  const Vector3d target_{0.1, 0.2, 0.3};
};

// All weights as one block of Jets.
struct OfWeights {
  template <typename T>
  bool operator()(T const* const* weights, T* r) const {
    std::vector<T> all;
    for (std::size_t b = 0; b < sizes.size(); ++b) {
      all.insert(all.end(), weights[b], weights[b] + sizes[b]);
    }
    const T a[] = {T(input[0]), T(input[1])};
    if (!functor(all.data(), a, r)) return false;
    for (int i = 0; i < 3; ++i) r[i] -= target[i];
    return true;
  }
  NetworkFunctor functor;
  std::vector<int> sizes;
  Vector2d input;
  Vector3d target;
};

TEST_P(EveryActivation, NetworkCostIsCeresAutoDiffOfTheNetwork) {
  const NetworkCost cost(network_, input_, target_);
  ceres::DynamicAutoDiffCostFunction<OfWeights> expected(new OfWeights{
      NetworkFunctor(*network_), network_->WeightBlocks(), input_, target_});
  expected.SetNumResiduals(3);
  for (const int size : network_->WeightBlocks()) {
    expected.AddParameterBlock(size);
  }
  std::vector<const double*> parameters;
  for (double* block : WeightBlocks(*network_, weights_.data())) {
    parameters.push_back(block);
  }
  ExpectEqual(cost, expected, parameters);
}

struct OfInput {
  template <typename T>
  bool operator()(const T* input, T* r) const {
    std::vector<T> all(weights.data(), weights.data() + weights.size());
    if (!functor(all.data(), input, r)) return false;
    for (int i = 0; i < 3; ++i) r[i] -= target[i];
    return true;
  }
  NetworkFunctor functor;
  VectorXd weights;
  Vector3d target;
};

TEST_P(EveryActivation, TrainedNetworkCostIsCeresAutoDiffOfTheNetwork) {
  const TrainedNetworkCost cost(network_, weights_, target_);
  const ceres::AutoDiffCostFunction<OfInput, 3, 2> expected(
      new OfInput{NetworkFunctor(*network_), weights_, target_});
  ExpectEqual(cost, expected, {input_.data()});
}

INSTANTIATE_TEST_SUITE_P(Activations,
                         EveryActivation,
                         testing::ValuesIn(kActivations),
                         [](const auto& info) {
                           return ActivationName(info.param);
                         });

TEST(CostFunctions, PassCeresGradientChecker) {
  const auto network = std::make_shared<DenseNetwork>(std::vector<int>{2, 4, 3},
                                                      Activation::kTanh);
  NumpyRandom random(4);
  VectorXd weights = network->InitialWeights(Initialization::kPytorch, &random);
  const Vector3d target(0.3, -0.2, 1.0);
  double x[] = {0.4, -1.3};
  const auto check = [](const ceres::CostFunction& cost,
                        std::vector<double*> blocks) {
    const ceres::GradientChecker checker(
        &cost,
        static_cast<const std::vector<const ceres::Manifold*>*>(nullptr),
        ceres::NumericDiffOptions());
    ceres::GradientChecker::ProbeResults results;
    // Ridders' extrapolation reaches about 1e-10.
    EXPECT_TRUE(checker.Probe(blocks.data(), 1e-8, &results))
        << results.error_log;
  };
  check(SimulatorCost(std::make_shared<CurvedSimulator>(),
                      target,
                      VectorXd::Constant(1, 0.7)),
        {x});
  double context[] = {0.7};
  check(SimulatorCost(std::make_shared<CurvedSimulator>(), target),
        {x, context});
  check(NetworkCost(network, Vector2d(0.6, -0.4), target),
        WeightBlocks(*network, weights.data()));
  check(TrainedNetworkCost(network, weights, target), {x});
}

// r = (p0 q, p1 - c0 q, c1), of the blocks p, q and c.
struct ThreeBlocks {
  template <typename T>
  bool operator()(const T* p, const T* q, const T* c, T* r) const {
    r[0] = p[0] * q[0];
    r[1] = p[1] - c[0] * q[0];
    r[2] = c[1];
    return true;
  }
};

TEST(CostFunctionSimulator, HasTheBlocksAsInputAndContext) {
  const auto cost =
      std::make_shared<ceres::AutoDiffCostFunction<ThreeBlocks, 3, 2, 1, 2>>(
          new ThreeBlocks);
  const CostFunctionSimulator simulator(cost, /*num_context_blocks=*/1);
  EXPECT_EQ(simulator.num_inputs(), 3);
  EXPECT_EQ(simulator.num_context(), 2);
  const double x[] = {2.0, 3.0, 5.0};
  const double context[] = {7.0, 11.0};
  Vector3d y;
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> J, expected;
  ASSERT_TRUE(simulator.Evaluate(x, context, y.data(), J.data()));
  EXPECT_EQ(y, Vector3d(10.0, -32.0, 11.0));
  expected << 5.0, 0.0, 2.0, 0.0, 1.0, -7.0, 0.0, 0.0, 0.0;
  EXPECT_EQ(J, expected);
  ASSERT_TRUE(simulator.Evaluate(x, context, y.data(), nullptr));
  EXPECT_EQ(y, Vector3d(10.0, -32.0, 11.0));
}

// There and back: the same cost function again.
TEST(CostFunctionSimulator, IsTheInverseOfSimulatorCost) {
  const Vector3d target(0.3, -0.2, 1.0);
  const auto functor =
      std::make_shared<ceres::AutoDiffCostFunction<CurvedResidual, 3, 2>>(
          new CurvedResidual{target});
  const SimulatorCost cost(std::make_shared<CostFunctionSimulator>(functor),
                           Vector3d::Zero());
  const double x[] = {0.4, -1.3};
  ExpectEqual(cost, *functor, {x});
}

// --- Models in pieces ---

class ModelInPieces : public testing::TestWithParam<Reduction> {
 protected:
  ModelInPieces()
      : model_(DenseNetwork({2, 3, 2}, Activation::kTanh),
               std::make_shared<CurvedSimulator>(),
               std::make_shared<SquaredNormLoss>(3, 3.0),
               GetParam()) {
    NumpyRandom random(1);
    data_.inputs = random.Rand(2, 7);
    data_.contexts = random.Rand(1, 7);
    data_.targets = random.Rand(3, 7);
    weights_ =
        model_.network().InitialWeights(Initialization::kPytorch, &random);
  }

  Model model_;
  DataSet data_;
  VectorXd weights_;
};

TEST_P(ModelInPieces, HaveTheModelsCostAndGradient) {
  LinearizationParts parts;
  parts.gradient = true;
  Linearization at;
  std::string error;
  ASSERT_TRUE(model_.Linearize(weights_, data_, parts, &at, &error)) << error;
  for (const int samples_per_block : {1, 3, 7, 100}) {
    SCOPED_TRACE(samples_per_block);
    ceres::Problem problem;
    ModelBlockOptions options;
    options.samples_per_block = samples_per_block;
    const auto ids =
        AddModelToProblem(model_, data_, weights_.data(), &problem, options);
    EXPECT_EQ(static_cast<int>(ids.size()),
              (7 + samples_per_block - 1) / samples_per_block);
    ceres::Problem::EvaluateOptions evaluate;
    evaluate.parameter_blocks = WeightBlocks(model_.network(), weights_.data());
    double cost = 0.0;
    std::vector<double> gradient;
    ASSERT_TRUE(problem.Evaluate(evaluate, &cost, nullptr, &gradient, nullptr));
    EXPECT_NEAR(cost, at.cost, kRounding);
    EXPECT_LE(
        (Eigen::Map<VectorXd>(gradient.data(), gradient.size()) - at.gradient)
            .norm(),
        kRounding);
  }
}

// With one sample a block, an outlier has the bounded influence of its loss
// function.
TEST_P(ModelInPieces, TakeARobustLossOfEachSample) {
  data_.targets.col(2).setConstant(1e3);
  ceres::Problem problem;
  ModelBlockOptions options;
  options.samples_per_block = 1;
  options.loss_function = new ceres::CauchyLoss(1.0);
  AddModelToProblem(model_, data_, weights_.data(), &problem, options);
  double cost = 0.0;
  ASSERT_TRUE(problem.Evaluate({}, &cost, nullptr, nullptr, nullptr));
  // 1/2 log(1 + |r|^2) with |r|^2 of about 2e7.
  EXPECT_LT(cost, 20.0);
}

INSTANTIATE_TEST_SUITE_P(Reductions,
                         ModelInPieces,
                         testing::Values(Reduction::kMean, Reduction::kSum));

TEST(CostFunctions, FailWhereThereIsNoFiniteValue) {
  const auto network = std::make_shared<DenseNetwork>(std::vector<int>{1, 1},
                                                      Activation::kLinear);
  const double nan[] = {std::numeric_limits<double>::quiet_NaN(), 0.0};
  const double* const parameters[] = {nan};
  double r[3];
  EXPECT_FALSE(SimulatorCost(std::make_shared<CurvedSimulator>(),
                             Vector3d::Zero(),
                             VectorXd::Ones(1))
                   .Evaluate(parameters, r, nullptr));
  EXPECT_FALSE(NetworkCost(network, VectorXd::Ones(1), VectorXd::Zero(1))
                   .Evaluate(parameters, r, nullptr));
  EXPECT_FALSE(
      TrainedNetworkCost(network, Vector2d(1.0, 0.0), VectorXd::Zero(1))
          .Evaluate(parameters, r, nullptr));
}

}  // namespace cost_test
}  // namespace invgrad
