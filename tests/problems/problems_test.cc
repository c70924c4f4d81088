// What every row of the table of problems promises, and what each one adds.

#include "problems/problems.h"

#include <cmath>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/core/specification.h"
#include "invgrad/minimize.h"
#include "invgrad/random.h"
#include "invgrad/rules.h"
#include "tests/support/simulator_identities.h"

namespace invgrad {
namespace problems_test {

using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

PhysicsProblem Create(const std::string& specification) {
  PhysicsProblem problem;
  std::string error;
  EXPECT_TRUE(CreateProblem(specification, nullptr, &problem, &error)) << error;
  return problem;
}

// The problem's physics at one typical point.
struct Probe {
  const Simulator* simulator;
  const Loss* loss;
  Eigen::VectorXd x;
  Eigen::VectorXd context;
  Eigen::VectorXd target;

  explicit Probe(const PhysicsProblem& problem) {
    NumpyRandom random(5);
    if (problem.point.has_value()) {
      simulator = problem.point->simulator.get();
      loss = problem.point->loss.get();
      target = problem.point->target;
    } else {
      simulator = &problem.learning->model->simulator();
      loss = &problem.learning->model->loss();
      context = problem.learning->train.contexts.col(0);
      target = problem.learning->train.targets.col(0);
    }
    x.resize(simulator->num_inputs());
    for (double& value : x) value = random.Uniform(-1.0, 1.0);
  }

  Eigen::VectorXd Outputs(const Eigen::VectorXd& at) const {
    Eigen::VectorXd y(simulator->num_outputs());
    EXPECT_TRUE(
        simulator->Evaluate(at.data(), context.data(), y.data(), nullptr));
    return y;
  }
  RowMajorMatrix Jacobian(const Eigen::VectorXd& at) const {
    Eigen::VectorXd y(simulator->num_outputs());
    RowMajorMatrix J(simulator->num_outputs(), simulator->num_inputs());
    EXPECT_TRUE(
        simulator->Evaluate(at.data(), context.data(), y.data(), J.data()));
    return J;
  }
};

class EveryProblem : public ::testing::TestWithParam<std::string> {
 protected:
  const PhysicsProblem problem_ = Create(GetParam());
  // Central differences of functions of order one with h = 1e-5: h^2 and
  // eps / h.
  static constexpr double kStep = 1e-5;
  static constexpr double kTolerance = 1e-7;
};

TEST_P(EveryProblem, IsEitherAPointOrALearningProblem) {
  EXPECT_NE(problem_.point.has_value(), problem_.learning.has_value());
  EXPECT_FALSE(problem_.least_squares.has_value());
}

TEST_P(EveryProblem, SimulatorJacobianIsThatOfItsOutputs) {
  const Probe probe(problem_);
  if (!probe.simulator->forms_jacobian()) {
    GTEST_SKIP() << "a field has kinks near any rough state: its own test";
  }
  const RowMajorMatrix J = probe.Jacobian(probe.x);
  const double scale = std::max(1.0, J.cwiseAbs().maxCoeff());
  for (int i = 0; i < probe.x.size(); ++i) {
    const Eigen::VectorXd h = kStep * Eigen::VectorXd::Unit(probe.x.size(), i);
    const Eigen::VectorXd difference =
        (probe.Outputs(probe.x + h) - probe.Outputs(probe.x - h)) /
        (2.0 * kStep);
    EXPECT_LT((J.col(i) - difference).cwiseAbs().maxCoeff(), kTolerance * scale)
        << "input " << i;
  }
}

TEST_P(EveryProblem, PullBackIsTheTransposedJacobian) {
  const Probe probe(problem_);
  ExpectAdjointIdentity(*probe.simulator, probe.x, probe.context.data());
  if (!probe.simulator->forms_jacobian()) return;
  const Eigen::VectorXd w =
      Eigen::VectorXd::LinSpaced(probe.simulator->num_outputs(), 1.0, 2.0);
  Eigen::VectorXd y(w.size()), x_bar(probe.x.size());
  ASSERT_TRUE(probe.simulator->Adjoint(
      probe.x.data(),
      probe.context.data(),
      [&w](const double*, double* covector) {
        Eigen::Map<Eigen::VectorXd>(covector, w.size()) = w;
        return true;
      },
      y.data(),
      x_bar.data()));
  const RowMajorMatrix J = probe.Jacobian(probe.x);
  EXPECT_EQ(y, probe.Outputs(probe.x));
  EXPECT_LT((x_bar - J.transpose() * w).norm(), 1e-12 * (1.0 + J.norm()));
}

TEST_P(EveryProblem, WeightedHessianIsTheDerivativeOfThePulledBackCovector) {
  const Probe probe(problem_);
  if (!probe.simulator->has_weighted_hessian()) {
    // Fields only: their J is piecewise smooth.
    EXPECT_FALSE(probe.simulator->forms_jacobian());
    GTEST_SKIP() << "no second derivatives";
  }
  const int n = static_cast<int>(probe.x.size());
  const Eigen::VectorXd w =
      Eigen::VectorXd::LinSpaced(probe.simulator->num_outputs(), 1.0, 2.0);
  Eigen::MatrixXd H(n, n);
  ASSERT_TRUE(probe.simulator->WeightedHessian(
      probe.x.data(), probe.context.data(), w.data(), H.data()));
  const double scale = std::max(1.0, H.cwiseAbs().maxCoeff());
  EXPECT_LT((H - H.transpose()).cwiseAbs().maxCoeff(), 1e-12 * scale);
  for (int i = 0; i < n; ++i) {
    const Eigen::VectorXd h = kStep * Eigen::VectorXd::Unit(n, i);
    const Eigen::VectorXd difference =
        (probe.Jacobian(probe.x + h) - probe.Jacobian(probe.x - h))
            .transpose() *
        w / (2.0 * kStep);
    EXPECT_LT((H.col(i) - difference).cwiseAbs().maxCoeff(), kTolerance * scale)
        << "input " << i;
  }
}

TEST_P(EveryProblem, LossDerivativesAreThoseOfTheLoss) {
  const Probe probe(problem_);
  const int m = probe.loss->size();
  const Eigen::VectorXd y = probe.Outputs(probe.x);
  const double* target = probe.target.data();
  double loss = 0.0;
  Eigen::VectorXd gradient(m), above(m), below(m);
  const bool forms_hessian = probe.loss->forms_hessian();
  Eigen::MatrixXd hessian(forms_hessian ? m : 0, m);
  ASSERT_TRUE(probe.loss->Evaluate(y.data(),
                                   target,
                                   &loss,
                                   gradient.data(),
                                   forms_hessian ? hessian.data() : nullptr));
  for (int i = 0; i < m; ++i) {
    const Eigen::VectorXd h = kStep * Eigen::VectorXd::Unit(m, i);
    const Eigen::VectorXd y_above = y + h, y_below = y - h;
    double loss_above = 0.0, loss_below = 0.0;
    ASSERT_TRUE(probe.loss->Evaluate(
        y_above.data(), target, &loss_above, above.data(), nullptr));
    ASSERT_TRUE(probe.loss->Evaluate(
        y_below.data(), target, &loss_below, below.data(), nullptr));
    const double scale = 1.0 + std::abs(loss);
    EXPECT_NEAR(gradient[i],
                (loss_above - loss_below) / (2.0 * kStep),
                kTolerance * scale);
    const Eigen::VectorXd column =
        forms_hessian ? Eigen::VectorXd(hessian.col(i))
                      : probe.loss->HessianTimes(
                            y.data(), target, Eigen::VectorXd::Unit(m, i));
    EXPECT_LT(((above - below) / (2.0 * kStep) - column).norm(),
              kTolerance * scale);
  }
}

TEST_P(EveryProblem, KnownOptimumIsOne) {
  if (!problem_.point.has_value() || !problem_.point->minimizer.has_value()) {
    GTEST_SKIP() << "no minimizer is known";
  }
  PointObjective objective = problem_.point->MakeObjective();
  objective.SetState(*problem_.point->minimizer);
  LinearizationParts parts;
  parts.gradient = true;
  Linearization at_optimum;
  std::string error;
  ASSERT_TRUE(objective.Linearize(parts, &at_optimum, &error)) << error;
  EXPECT_NEAR(at_optimum.gradient.norm(), 0.0, 1e-12);
  ASSERT_TRUE(problem_.point->minimum.has_value());
  EXPECT_NEAR(at_optimum.cost, *problem_.point->minimum, 1e-12);
}

TEST_P(EveryProblem, DataAreFiniteAndFitTheModel) {
  if (!problem_.learning.has_value()) GTEST_SKIP() << "a point problem";
  const LearningProblem& learning = *problem_.learning;
  std::string error;
  EXPECT_TRUE(learning.train.IsFinite(&error)) << error;
  EXPECT_TRUE(learning.test.IsFinite(&error)) << error;
  EXPECT_EQ(learning.train.inputs.rows(), learning.model->num_inputs());
  EXPECT_EQ(learning.train.contexts.rows(),
            learning.model->simulator().num_context());
  EXPECT_EQ(learning.train.targets.rows(), learning.model->loss().size());
  EXPECT_LE(learning.batch_size, learning.train.num_samples());

  // The data that the problem shows make the same problem again.
  const ProblemRow* row =
      FindProblem(std::string(GetParam()).substr(0, GetParam().find(':')));
  ASSERT_NE(row, nullptr);
  PhysicsProblem again;
  const std::string settings_of = GetParam();
  ASSERT_TRUE(CreateProblem(settings_of, &learning.data, &again, &error))
      << error;
  EXPECT_EQ(again.learning->train.inputs, learning.train.inputs);
  EXPECT_EQ(again.learning->test.targets, learning.test.targets);
}

TEST_P(EveryProblem, DataOfAnotherShapeAreRefused) {
  if (!problem_.learning.has_value()) GTEST_SKIP() << "a point problem";
  const Eigen::MatrixXd& data = problem_.learning->data;
  Eigen::MatrixXd wider = Eigen::MatrixXd::Zero(10, data.cols() + 1);
  PhysicsProblem problem;
  std::string error;
  EXPECT_FALSE(CreateProblem(GetParam(), &wider, &problem, &error));
  const std::string found =
      "found (10, " + std::to_string(data.cols() + 1) + ")";
  EXPECT_NE(error.find(found), std::string::npos) << error;
}

TEST_P(EveryProblem, UnknownOptionIsRefusedByName) {
  PhysicsProblem problem;
  std::string error;
  const std::string name = GetParam().substr(0, GetParam().find(':'));
  EXPECT_FALSE(
      CreateProblem(name + ":no_such_option=1", nullptr, &problem, &error));
  EXPECT_NE(error.find("no_such_option"), std::string::npos) << error;
  EXPECT_NE(error.find(name), std::string::npos) << error;
}

// Every row with its defaults, and the settings that change the physics.
std::vector<std::string> Specifications() {
  std::vector<std::string> specifications;
  for (const ProblemRow& row : Problems()) {
    if (row.name != "more_garbow_hillstrom") specifications.push_back(row.name);
  }
  specifications.insert(specifications.end(),
                        {"burgers_initial:target=simulated",
                         "toy_network:lambda=0.01",
                         "oscillator_chain:coupling=cubic",
                         "oscillator_chain:num_oscillators=3:num_samples=8",
                         "oscillator_chain:num_oscillators=5:coupling=cubic",
                         "oscillator_tracking:coupling=cubic:num_samples=8",
                         "oscillator_tracking:end_weight=10:num_samples=8",
                         "oscillator_tracking:num_oscillators=3:horizon=7",
                         "oscillator_correction:num_oscillators=3:horizon=6"});
  return specifications;
}

INSTANTIATE_TEST_SUITE_P(Problems,
                         EveryProblem,
                         ::testing::ValuesIn(Specifications()),
                         [](const auto& info) {
                           std::string name = info.param;
                           for (char& c : name) {
                             if (std::isalnum(c) == 0) c = '_';
                           }
                           return name;
                         });

TEST(Problems, UnknownNameSuggestsTheNearest) {
  PhysicsProblem problem;
  std::string error;
  EXPECT_FALSE(CreateProblem("oscilator_chain", nullptr, &problem, &error));
  EXPECT_NE(error.find("oscillator_chain"), std::string::npos) << error;
}

TEST(LinearScale, StepsScaleAsItsHeaderSays) {
  const double c = 3.0;
  const double u[] = {2.0, 50.0};
  const PhysicsProblem problem = Create("linear_scale:c=3:unit_0=2:unit_1=50");
  const auto step_of = [&](const std::string& name, const Settings& settings) {
    PointObjective objective = problem.point->MakeObjective();
    std::string error;
    const auto rule = MakeRule(Specification{"", name, settings}, &error);
    EXPECT_NE(rule, nullptr) << error;
    Linearization at_x;
    EXPECT_TRUE(objective.Linearize(rule->Needs(), &at_x, &error)) << error;
    Eigen::VectorXd step;
    EXPECT_TRUE(rule->ComputeStep(at_x, &step, &error)) << error;
    return step;
  };
  const double eta = 0.25;
  const Settings settings = {{"step_size", "0.25"}};
  const Eigen::VectorXd gradient = step_of("gradient_descent", settings);
  const Eigen::VectorXd half = step_of("half_inverse", settings);
  const Eigen::VectorXd full = step_of("gauss_newton", settings);
  const Eigen::VectorXd newton =
      step_of("newton", {{"step_size", "1"}, {"fallback_step_size", "0.25"}});
  const Eigen::VectorXd adam = step_of("adam", settings);
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(gradient[i], -eta * c * u[i], 1e-12 * c * u[i]);
    EXPECT_NEAR(half[i], -eta * c / std::sqrt(u[i]), 1e-12);
    EXPECT_NEAR(full[i], -eta * c / u[i], 1e-12);
    // The Hessian is zero: Newton falls back to gradient descent.
    EXPECT_NEAR(newton[i], gradient[i], 1e-12 * c * u[i]);
    // The first step of Adam is eta whatever the units, but for its epsilon.
    EXPECT_NEAR(adam[i], -eta, 1e-6);
  }
}

TEST(ToyNetwork, LambdaScalesTheOutputAndNotTheTarget) {
  const PhysicsProblem good = Create("toy_network:lambda=1");
  const PhysicsProblem bad = Create("toy_network:lambda=0.01");
  EXPECT_EQ(good.learning->train.targets, bad.learning->train.targets);
  EXPECT_EQ(good.learning->model->num_weights(), 30);
  const Probe probe(bad);
  EXPECT_EQ(probe.Jacobian(probe.x)(1, 1), 0.01);
  EXPECT_EQ(probe.Jacobian(probe.x)(0, 0), 1.0);
}

}  // namespace problems_test
}  // namespace invgrad
