#include "invgrad/equations/equation_simulator.h"

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/equation.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace equation_simulator_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr int kNumSamples = 7;
constexpr double kRounding = 1e-13;

TrialFunction Trial(bool has_conditions) {
  TrialFunction trial;
  trial.derivatives = std::make_shared<DerivativeSet>(
      "tx", std::vector<std::string>{"t", "xx"});
  trial.num_functions = 2;
  if (has_conditions) {
    trial.boundary_values = [](const InputJet* a, InputJet* g) {
      g[0] = g[1] = sin(M_PI * a[1]);
    };
    trial.distance = [](const InputJet* a, InputJet* d) {
      d[0] = a[0];
      d[1] = a[0] * a[0];
    };
  }
  return trial;
}

// Two equations of u and v with a coefficient p and a constant c.
struct System {
  template <typename T, typename C>
  bool operator()(const T* u, const C* c, T* y) const {
    // (u, v, u_t, v_t, u_xx, v_xx, p)
    y[0] = u[2] + u[0] * u[5] - c[0] * u[4];
    y[1] = u[3] - u[6] * u[6] * u[1] * u[1] * u[0];
    return true;
  }
};

// Samples of both terms, in turn.
class EquationSimulatorTest : public testing::TestWithParam<bool> {
 protected:
  EquationSimulatorTest() : trial_(Trial(GetParam())) {
    simulator_ = std::make_unique<EquationSimulator>(
        trial_,
        std::vector<EquationResidual>{
            {"system", std::make_shared<AutoDiffSimulator<System, 7, 2, 1>>()},
            {"values", std::make_shared<ValueResidual>(trial_, 1)}},
        1);
    layout_ = simulator_->context_layout();
    points_ = RandomMatrix(2, kNumSamples, 5);
    MatrixXd conditions;
    std::string error;
    EXPECT_TRUE(trial_.Conditions(points_, &conditions, &error)) << error;
    contexts_ = RandomMatrix(layout_.size, kNumSamples, 6);
    contexts_.topRows(conditions.rows()) = conditions;
    contexts_.middleRows(layout_.point, 2) = points_;
    contexts_.row(layout_.coefficients).setConstant(1.7);
    for (int s = 0; s < kNumSamples; ++s) {
      contexts_(layout_.term, s) = s % 3 == 1 ? 1 : 0;
    }
    x_ = RandomMatrix(simulator_->num_inputs(), kNumSamples, 7);
  }

  MatrixXd Values(const MatrixXd& contexts) const {
    MatrixXd y(2, kNumSamples);
    EXPECT_EQ(simulator_->EvaluateBatch(
                  kNumSamples, x_.data(), contexts.data(), y.data(), nullptr),
              kNumSamples);
    return y;
  }

  TrialFunction trial_;
  std::unique_ptr<EquationSimulator> simulator_;
  EquationContext layout_;
  MatrixXd points_;
  MatrixXd contexts_;
  MatrixXd x_;
};

TEST_P(EquationSimulatorTest, IsTheResidualOfTheTrialFunction) {
  ASSERT_EQ(simulator_->num_context(), contexts_.rows());
  const MatrixXd u = trial_.Values(x_, contexts_);
  EXPECT_EQ(u == x_, !GetParam());
  MatrixXd expected = MatrixXd::Zero(2, kNumSamples);
  for (int s = 0; s < kNumSamples; ++s) {
    const double c = contexts_(layout_.of_residual, s);
    if (contexts_(layout_.term, s) == 0) {
      VectorXd inputs(7);
      inputs << u.col(s).head(6), 1.7;
      System()(inputs.data(), &c, expected.col(s).data());
    } else {
      expected(0, s) = u(0, s) - c;
    }
    expected.col(s) *= contexts_(layout_.weight, s);
  }
  EXPECT_LT((Values(contexts_) - expected).norm(), kRounding);
}

TEST_P(EquationSimulatorTest, CoefficientJacobiansAreDifferences) {
  MatrixXd J(2, kNumSamples);
  ASSERT_EQ(simulator_->CoefficientJacobians(
                kNumSamples, x_.data(), contexts_.data(), J.data()),
            kNumSamples);
  constexpr double h = 1e-5;
  MatrixXd above = contexts_, below = contexts_;
  above.row(layout_.coefficients).array() += h;
  below.row(layout_.coefficients).array() -= h;
  // Exact for a polynomial of degree two, up to rounding.
  EXPECT_LT((J - (Values(above) - Values(below)) / (2 * h)).norm(), 1e-9);
  EXPECT_GT(J.norm(), 0.1);
}

TEST_P(EquationSimulatorTest, DerivativesAreDifferences) {
  constexpr double h = 1e-5;
  const int size = simulator_->num_inputs();
  const Vector2d w(0.7, -1.3);
  for (int s = 0; s < kNumSamples; ++s) {
    const double* c = contexts_.col(s).data();
    const auto jacobian = [&](const VectorXd& x) {
      MatrixXd J_transposed(size, 2);
      Vector2d y;
      EXPECT_TRUE(
          simulator_->Evaluate(x.data(), c, y.data(), J_transposed.data()));
      return J_transposed;
    };
    const auto value = [&](const VectorXd& x) {
      Vector2d y;
      EXPECT_TRUE(simulator_->Evaluate(x.data(), c, y.data(), nullptr));
      return y;
    };
    MatrixXd H(size, size);
    ASSERT_TRUE(
        simulator_->WeightedHessian(x_.col(s).data(), c, w.data(), H.data()));
    const MatrixXd J_transposed = jacobian(x_.col(s));
    for (int i = 0; i < size; ++i) {
      const VectorXd above = x_.col(s) + h * VectorXd::Unit(size, i);
      const VectorXd below = x_.col(s) - h * VectorXd::Unit(size, i);
      const Vector2d row = (value(above) - value(below)) / (2 * h);
      EXPECT_LT((J_transposed.row(i).transpose() - row).norm(), 1e-7);
      const VectorXd column = (jacobian(above) - jacobian(below)) * w / (2 * h);
      EXPECT_LT((H.col(i) - column).norm(), 1e-7);
    }
  }
}

TEST_P(EquationSimulatorTest, NamesTermPointAndInputs) {
  x_(2, 4) = std::numeric_limits<double>::quiet_NaN();  // N_t of u
  MatrixXd y(2, kNumSamples);
  // Sample 4 is of the values, which do not read u_t; sample 3 is not.
  EXPECT_EQ(simulator_->EvaluateBatch(
                kNumSamples, x_.data(), contexts_.data(), y.data(), nullptr),
            kNumSamples);
  x_(2, 3) = x_(2, 4);
  EXPECT_EQ(simulator_->EvaluateBatch(
                kNumSamples, x_.data(), contexts_.data(), y.data(), nullptr),
            3);
  const std::string what =
      simulator_->DescribeFailure(x_.col(3).data(), contexts_.col(3).data());
  EXPECT_EQ(what.rfind("system at the point (", 0), 0u) << what;
  EXPECT_NE(what.find("u0_t = nan"), std::string::npos) << what;
  EXPECT_NE(what.find("u1_xx = "), std::string::npos) << what;
}

INSTANTIATE_TEST_SUITE_P(Conditions,
                         EquationSimulatorTest,
                         testing::Bool(),
                         [](const auto& info) {
                           return info.param ? "Hard" : "None";
                         });

TEST(EquationSimulatorDeathTest, TheEquationTakesTheStatedDerivatives) {
  EXPECT_DEATH(
      EquationSimulator(
          Trial(false),
          {{"system", std::make_shared<AutoDiffSimulator<System, 7, 2, 1>>()}}),
      "system: the inputs are the functions, their stated derivatives");
}

}  // namespace equation_simulator_test
}  // namespace invgrad
