#include <cmath>
#include <memory>

#include "ceres/gradient_checker.h"
#include "ceres/problem.h"
#include "gtest/gtest.h"
#include "invgrad/autodiff_loss.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/ceres/model_function.h"
#include "invgrad/cost.h"
#include "invgrad/field_simulator.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/loss.h"
#include "invgrad/minimize.h"
#include "tests/support/real_infidelity.h"

namespace invgrad {
namespace point_objective_test {

// y = (x0 sin x1, x0^2 + x1, exp(x1)): more outputs than inputs.
struct Curved {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::exp;
    using std::sin;
    y[0] = x[0] * sin(x[1]);
    y[1] = x[0] * x[0] + x[1];
    y[2] = exp(x[1]);
    return true;
  }
};

PointObjective MakeObjective(double factor) {
  return PointObjective(std::make_shared<AutoDiffSimulator<Curved, 2, 3>>(),
                        std::make_shared<SquaredNormLoss>(3, factor),
                        Eigen::Vector3d(0.3, -0.2, 1.5),
                        Eigen::Vector2d(0.7, -0.4));
}

double CostAt(const PointObjective& objective, const Eigen::Vector2d& x) {
  PointObjective copy = objective;
  copy.SetState(x);
  double cost = 0.0;
  std::string error;
  EXPECT_TRUE(copy.Cost(&cost, &error)) << error;
  return cost;
}

TEST(PointObjective, GradientAndHessianAreThoseOfTheCost) {
  const PointObjective objective = MakeObjective(1.0);
  LinearizationParts parts;
  parts.gradient = parts.jacobian = parts.hessian = true;
  Linearization at_x;
  std::string error;
  ASSERT_TRUE(objective.Linearize(parts, &at_x, &error)) << error;
  const Eigen::Vector2d x = objective.State();
  EXPECT_EQ(at_x.cost, CostAt(objective, x));
  // Central differences: error h^2 for the gradient, h^2 + eps / h^2 for the
  // Hessian.
  const double h = 1e-4;
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector2d di = h * Eigen::Vector2d::Unit(i);
    EXPECT_NEAR(
        at_x.gradient[i],
        (CostAt(objective, x + di) - CostAt(objective, x - di)) / (2.0 * h),
        1e-6);
    for (int j = 0; j < 2; ++j) {
      const Eigen::Vector2d dj = h * Eigen::Vector2d::Unit(j);
      const double difference =
          (CostAt(objective, x + di + dj) - CostAt(objective, x + di - dj) -
           CostAt(objective, x - di + dj) + CostAt(objective, x - di - dj)) /
          (4.0 * h * h);
      EXPECT_NEAR(at_x.hessian(i, j), difference, 1e-6);
    }
  }
  Eigen::VectorXd Jt_g;
  at_x.jacobian->TransposeTimes(at_x.loss_gradient, &Jt_g);
  EXPECT_LT((Jt_g - at_x.gradient).norm(), 1e-14);
  const Eigen::VectorXd v = Eigen::Vector3d(1.0, 2.0, 3.0);
  EXPECT_LT((at_x.loss_hessian_times(v) - 2.0 * v).norm(), 1e-14);
}

TEST(PointObjective, HasACurveIfTheOutputsKeepTheirNorm) {
  const PointObjective squares = MakeObjective(1.0);
  const PointObjective objective(
      std::make_shared<AutoDiffSimulator<Curved, 2, 3>>(),
      std::make_shared<RealInfidelity<3>>(),
      squares.target(),
      squares.State());
  LinearizationParts parts = LinearizationParts::Jacobian();
  parts.gradient = true;
  Linearization at_x;
  std::string error;
  ASSERT_TRUE(objective.Linearize(parts, &at_x, &error)) << error;
  ASSERT_NE(at_x.loss_on_curve, nullptr);
  // A direction that keeps the norm of the outputs.
  const Eigen::VectorXd y = objective.Outputs();
  const Eigen::VectorXd t = Eigen::Vector3d(-y[1], y[0], 0.0);
  const LossOnCurve start = at_x.loss_on_curve(t, 0.0);
  EXPECT_NEAR(start.loss, at_x.cost, 1e-14);
  EXPECT_NEAR(start.slope, at_x.loss_gradient.dot(t), 1e-14);
  ASSERT_TRUE(squares.Linearize(parts, &at_x, &error)) << error;
  EXPECT_EQ(at_x.loss_on_curve, nullptr);
}

TEST(PointObjective, AsACeresProblemHasTheSameCostAndGradient) {
  const PointObjective objective = MakeObjective(0.7);
  Eigen::VectorXd x = objective.State();
  ceres::Problem problem;
  AddModelToProblem(objective.model(), objective.data(), x.data(), &problem);
  double cost = 0.0;
  std::vector<double> gradient;
  ASSERT_TRUE(problem.Evaluate(
      ceres::Problem::EvaluateOptions(), &cost, nullptr, &gradient, nullptr));
  LinearizationParts parts;
  parts.gradient = true;
  Linearization at_x;
  std::string error;
  ASSERT_TRUE(objective.Linearize(parts, &at_x, &error)) << error;
  EXPECT_NEAR(cost, at_x.cost, 1e-14 * cost);
  EXPECT_NEAR(gradient[0], at_x.gradient[0], 1e-13);
  EXPECT_NEAR(gradient[1], at_x.gradient[1], 1e-13);

  const ModelFunction function(&objective.model(), &objective.data());
  double function_cost = 0.0;
  Eigen::Vector2d function_gradient;
  ASSERT_TRUE(
      function.Evaluate(x.data(), &function_cost, function_gradient.data()));
  EXPECT_EQ(function_cost, at_x.cost);
  EXPECT_EQ(function_gradient, Eigen::Vector2d(at_x.gradient));
}

TEST(PointObjective, CostFunctionPassesTheGradientChecker) {
  const PointObjective objective = MakeObjective(0.7);
  const ModelCost cost_function(objective.model(), objective.data());
  const Eigen::VectorXd x = objective.State();
  const double* parameters[] = {x.data()};
  std::vector<const ceres::Manifold*>* no_manifolds = nullptr;
  ceres::GradientChecker checker(
      &cost_function, no_manifolds, ceres::NumericDiffOptions());
  ceres::GradientChecker::ProbeResults results;
  EXPECT_TRUE(checker.Probe(parameters, 1e-8, &results)) << results.error_log;
}

// Curved, and counts what it is asked for.
class CountingSimulator final : public Simulator {
 public:
  int num_inputs() const override { return 2; }
  int num_outputs() const override { return 3; }
  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override {
    num_jacobians += jacobian != nullptr ? 1 : 0;
    return simulator_.Evaluate(x, context, y, jacobian);
  }
  bool Adjoint(const double* x,
               const double* context,
               const Covector& covector,
               double* y,
               double* x_bar) const override {
    ++num_pull_backs;
    return simulator_.Adjoint(x, context, covector, y, x_bar);
  }
  mutable int num_jacobians = 0;
  mutable int num_pull_backs = 0;

 private:
  AutoDiffSimulator<Curved, 2, 3> simulator_;
};

TEST(PointObjective, AGradientAloneNeedsNoJacobian) {
  const auto simulator = std::make_shared<CountingSimulator>();
  const PointObjective objective(simulator,
                                 std::make_shared<SquaredNormLoss>(3, 0.7),
                                 Eigen::Vector3d(0.3, -0.2, 1.5),
                                 Eigen::Vector2d(0.7, -0.4));
  LinearizationParts parts;
  Linearization at_x;
  std::string error;
  ASSERT_TRUE(objective.Linearize(parts, &at_x, &error)) << error;
  EXPECT_EQ(simulator->num_pull_backs, 0);
  const double cost = at_x.cost;
  parts.gradient = true;
  ASSERT_TRUE(objective.Linearize(parts, &at_x, &error)) << error;
  EXPECT_EQ(simulator->num_pull_backs, 1);
  EXPECT_EQ(simulator->num_jacobians, 0);
  EXPECT_EQ(at_x.cost, cost);
  parts.jacobian = true;
  Linearization with_jacobian;
  ASSERT_TRUE(objective.Linearize(parts, &with_jacobian, &error)) << error;
  EXPECT_EQ(simulator->num_jacobians, 1);
  EXPECT_EQ(with_jacobian.cost, cost);
  EXPECT_LT((with_jacobian.gradient - at_x.gradient).norm(), 1e-15);
}

// c |y - y*|^2 that does not say so: its Hessian has to be written out.
class PlainSquaredNorm final : public Loss {
 public:
  explicit PlainSquaredNorm(double factor) : loss_(3, factor) {}
  int size() const override { return 3; }
  bool Evaluate(const double* y,
                const double* target,
                double* loss,
                double* gradient,
                double* hessian) const override {
    return loss_.Evaluate(y, target, loss, gradient, hessian);
  }

 private:
  SquaredNormLoss loss_;
};

TEST(PointObjective, ASquaredNormNeedsNoHessianOfTheLoss) {
  const PointObjective implied = MakeObjective(0.7);
  const PointObjective written(
      std::make_shared<AutoDiffSimulator<Curved, 2, 3>>(),
      std::make_shared<PlainSquaredNorm>(0.7),
      implied.target(),
      implied.State());
  LinearizationParts parts;
  parts.gradient = parts.jacobian = parts.hessian = true;
  Linearization a, b;
  std::string error;
  ASSERT_TRUE(implied.Linearize(parts, &a, &error)) << error;
  ASSERT_TRUE(written.Linearize(parts, &b, &error)) << error;
  EXPECT_EQ(a.cost, b.cost);
  EXPECT_EQ(a.gradient, b.gradient);
  EXPECT_LT((a.hessian - b.hessian).norm(), 1e-14);
  const Eigen::VectorXd v = Eigen::Vector3d(1.0, -2.0, 3.0);
  EXPECT_LT((a.loss_hessian_times(v) - b.loss_hessian_times(v)).norm(), 1e-14);
}

// P has no value for x0 > 1.
struct Bounded {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::sqrt;
    y[0] = sqrt(1.0 - x[0]);
    return true;
  }
};

TEST(PointObjective, ReportsWhereThePhysicsHasNoValue) {
  PointObjective objective(std::make_shared<AutoDiffSimulator<Bounded, 1, 1>>(),
                           std::make_shared<SquaredNormLoss>(1, 1.0),
                           Eigen::VectorXd::Zero(1),
                           Eigen::VectorXd::Constant(1, 2.0));
  double cost = 0.0;
  std::string error;
  EXPECT_FALSE(objective.Cost(&cost, &error));
  EXPECT_EQ(error, "the simulator has no finite value");
  Linearization at_x;
  for (const bool jacobian : {false, true}) {
    LinearizationParts parts;
    parts.gradient = true;
    parts.jacobian = jacobian;
    error.clear();
    EXPECT_FALSE(objective.Linearize(parts, &at_x, &error));
    EXPECT_EQ(error, "the simulator has no finite value");
  }
  EXPECT_FALSE(objective.Linearize(LinearizationParts(), &at_x, &error));
  EXPECT_EQ(objective.Outputs().size(), 0);
}

// No loss below y = 0.
struct LogLoss {
  template <typename T>
  bool operator()(const T* y, const double*, T* loss) const {
    using std::log;
    *loss = log(y[0]);
    return true;
  }
};

TEST(PointObjective, ReportsWhereTheLossHasNoValue) {
  const PointObjective objective(std::make_shared<IdentitySimulator>(1),
                                 std::make_shared<AutoDiffLoss<LogLoss, 1>>(),
                                 Eigen::VectorXd::Zero(1),
                                 Eigen::VectorXd::Constant(1, -1.0));
  for (const bool jacobian : {false, true}) {
    LinearizationParts parts;
    parts.gradient = true;
    parts.jacobian = jacobian;
    Linearization at_x;
    std::string error;
    EXPECT_FALSE(objective.Linearize(parts, &at_x, &error));
    EXPECT_EQ(error, "the loss has no finite value");
  }
}

TEST(PointObjective, RefusesAStepThatIsNotFinite) {
  PointObjective objective = MakeObjective(1.0);
  const Eigen::VectorXd before = objective.State();
  EXPECT_FALSE(objective.Plus(Eigen::Vector2d(NAN, 1.0)));
  EXPECT_EQ(objective.State(), before);
}

// y_i = x_i x_{i+1}, whose J is applied and never formed.
class Products final : public FieldSimulator {
 public:
  int num_inputs() const override { return 3; }
  int num_outputs() const override { return 2; }
  bool Value(const double* x, const double*, double* y) const override {
    y[0] = x[0] * x[1];
    y[1] = x[1] * x[2];
    return AllFinite(y, 2);
  }
  std::unique_ptr<const JacobianOperator> Linearize(const double* x,
                                                    const double* context,
                                                    double* y) const override {
    if (!Value(x, context, y)) return nullptr;
    Eigen::MatrixXd J(2, 3);
    J << x[1], x[0], 0.0, 0.0, x[2], x[1];
    const auto times = [J](const Eigen::VectorXd& v, Eigen::VectorXd* Jv) {
      *Jv = J * v;
    };
    const auto transpose_times = [J](const Eigen::VectorXd& w,
                                     Eigen::VectorXd* Jtw) {
      *Jtw = J.transpose() * w;
    };
    return std::make_unique<FunctionJacobian>(2, 3, times, transpose_times);
  }
};

TEST(PointObjective, AFieldSimulatorGivesItsProductsAndNoMatrix) {
  PointObjective objective(std::make_shared<Products>(),
                           std::make_shared<SquaredNormLoss>(2, 0.5),
                           Eigen::Vector2d(1.0, -1.0),
                           Eigen::Vector3d(2.0, 3.0, 4.0));
  LinearizationParts parts;
  parts.gradient = parts.jacobian = true;
  Linearization at_x;
  std::string error;
  ASSERT_TRUE(objective.Linearize(parts, &at_x, &error)) << error;
  EXPECT_NE(dynamic_cast<const FunctionJacobian*>(at_x.jacobian.get()),
            nullptr);
  const Eigen::Vector2d g(5.0, 13.0);
  EXPECT_EQ(at_x.cost, 0.5 * g.squaredNorm());
  EXPECT_EQ(at_x.loss_gradient, g);
  EXPECT_EQ(at_x.gradient, Eigen::Vector3d(15.0, 10.0 + 52.0, 39.0));

  objective.SetState(Eigen::Vector3d(1e200, 1e200, 1.0));
  EXPECT_FALSE(objective.Linearize(parts, &at_x, &error));
  EXPECT_EQ(error, "the simulator has no finite value");
}

}  // namespace point_objective_test
}  // namespace invgrad
