#include "invgrad/field_simulator.h"

#include <cmath>
#include <limits>
#include <memory>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "tests/support/simulator_identities.h"

namespace invgrad {
namespace field_simulator_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// y_i = x_i x_{i+1}, i < n - 1; no value for a negative x_0.
class Neighbours final : public FieldSimulator {
 public:
  explicit Neighbours(int n) : n_(n) {}
  int num_inputs() const override { return n_; }
  int num_outputs() const override { return n_ - 1; }
  bool Value(const double* x,
             const double* /*context*/,
             double* y) const override {
    for (int i = 0; i + 1 < n_; ++i) y[i] = x[i] * x[i + 1];
    return x[0] >= 0.0 && AllFinite(y, n_ - 1);
  }
  std::unique_ptr<const JacobianOperator> Linearize(const double* x,
                                                    const double* context,
                                                    double* y) const override {
    if (!Value(x, context, y)) return nullptr;
    const VectorXd at = Eigen::Map<const VectorXd>(x, n_);
    const auto times = [at](const VectorXd& v, VectorXd* Jv) {
      const auto n = at.size() - 1;
      *Jv = at.head(n).cwiseProduct(v.tail(n)) +
            at.tail(n).cwiseProduct(v.head(n));
    };
    const auto transpose_times = [at](const VectorXd& w, VectorXd* Jtw) {
      const auto n = at.size() - 1;
      *Jtw = VectorXd::Zero(at.size());
      Jtw->head(n) += at.tail(n).cwiseProduct(w);
      Jtw->tail(n) += at.head(n).cwiseProduct(w);
    };
    return std::make_unique<FunctionJacobian>(
        n_ - 1, n_, times, transpose_times);
  }

 private:
  int n_;
};

TEST(FieldSimulatorTest, DerivativesAgree) {
  const Neighbours simulator(5);
  const VectorXd x = VectorXd::LinSpaced(5, 1.0, 3.0);
  EXPECT_FALSE(simulator.forms_jacobian());
  ExpectAdjointIdentity(simulator, x, nullptr);
  // P is quadratic: central differences are exact.
  ExpectTangentIsDifference(simulator, x, nullptr, 1e-3, 1e-12);
}

TEST(FieldSimulatorTest, EvaluatesADenseJacobianByProducts) {
  const Neighbours simulator(3);
  const VectorXd x = VectorXd::LinSpaced(3, 2.0, 4.0);
  VectorXd y(2);
  MatrixXd transposed(3, 2);
  ASSERT_TRUE(
      simulator.Evaluate(x.data(), nullptr, y.data(), transposed.data()));
  MatrixXd J(2, 3);
  J << 3.0, 2.0, 0.0, 0.0, 4.0, 3.0;
  EXPECT_EQ(transposed.transpose(), J);
  EXPECT_EQ(y, (VectorXd(2) << 6.0, 12.0).finished());
}

TEST(FieldSimulatorTest, ReportsNoFiniteValue) {
  const Neighbours simulator(3);
  VectorXd x = VectorXd::LinSpaced(3, -2.0, 4.0);
  VectorXd y(2);
  MatrixXd J(3, 2);
  VectorXd x_bar(3);
  const auto covector = [](const double*, double* w) {
    w[0] = w[1] = std::numeric_limits<double>::quiet_NaN();
    return true;
  };
  EXPECT_FALSE(simulator.Evaluate(x.data(), nullptr, y.data(), J.data()));
  EXPECT_EQ(simulator.Linearize(x.data(), nullptr, y.data()), nullptr);
  EXPECT_FALSE(
      simulator.Adjoint(x.data(), nullptr, covector, y.data(), x_bar.data()));
  x[0] = 1.0;
  EXPECT_FALSE(
      simulator.Adjoint(x.data(), nullptr, covector, y.data(), x_bar.data()));
}

}  // namespace field_simulator_test
}  // namespace invgrad
