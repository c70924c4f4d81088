#include "invgrad/simulator.h"

#include <cmath>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/internal/scratch.h"
#include "invgrad/linear_simulator.h"
#include "tests/support/without_hessian.h"

namespace invgrad {
namespace simulator_test {

using Eigen::Matrix2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// y = (x0 x1, sin x0, x1^3), for x0 > 0 only.
struct Curved {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::sin;
    if (!(x[0] > T(0.0))) return false;
    y[0] = x[0] * x[1];
    y[1] = sin(x[0]);
    y[2] = x[1] * x[1] * x[1];
    return true;
  }
};

// Of a constant covector.
void ExpectAdjointIsTransposedJacobian(const Simulator& simulator,
                                       const VectorXd& x) {
  const int rows = simulator.num_outputs();
  const int cols = simulator.num_inputs();
  RowMajorMatrix J(rows, cols);
  VectorXd y(rows);
  ASSERT_TRUE(simulator.Evaluate(x.data(), nullptr, y.data(), J.data()));
  VectorXd value(rows);
  ASSERT_TRUE(simulator.Evaluate(x.data(), nullptr, value.data(), nullptr));
  EXPECT_EQ(value, y);

  VectorXd w = VectorXd::LinSpaced(rows, -1.0, 2.0);
  VectorXd pulled(cols);
  VectorXd seen;
  const auto covector = [&](const double* at, double* out) {
    seen = Eigen::Map<const VectorXd>(at, rows);
    Eigen::Map<VectorXd>(out, rows) = w;
    return true;
  };
  ASSERT_TRUE(simulator.Adjoint(
      x.data(), nullptr, covector, value.data(), pulled.data()));
  EXPECT_EQ(value, y);
  EXPECT_EQ(seen, y);
  // Sums of at most three terms of order one.
  EXPECT_LT((pulled - J.transpose() * w).norm(), 1e-14);

  const auto refuse = [](const double*, double*) { return false; };
  EXPECT_FALSE(simulator.Adjoint(
      x.data(), nullptr, refuse, value.data(), pulled.data()));
}

TEST(IdentitySimulatorTest, IsTheIdentity) {
  const IdentitySimulator simulator(3);
  const Vector3d x(1.0, -2.0, 3.0);
  Vector3d y;
  RowMajorMatrix J(3, 3);
  ASSERT_TRUE(simulator.Evaluate(x.data(), nullptr, y.data(), J.data()));
  EXPECT_EQ(y, x);
  EXPECT_EQ(J, MatrixXd::Identity(3, 3));
  ExpectAdjointIsTransposedJacobian(simulator, x);
  MatrixXd H = MatrixXd::Ones(3, 3);
  ASSERT_TRUE(simulator.WeightedHessian(x.data(), nullptr, y.data(), H.data()));
  EXPECT_EQ(H, MatrixXd::Zero(3, 3));
}

TEST(LinearSimulatorTest, IsItsMatrix) {
  RowMajorMatrix A(2, 3);
  A << 1, 0, 2, 0, -3, 0;
  const Vector2d b(0.5, -0.25);
  const LinearSimulator simulator(A.sparseView(), b);
  const Vector3d x(1.0, -2.0, 3.0);
  Vector2d y;
  RowMajorMatrix J = RowMajorMatrix::Ones(2, 3);
  ASSERT_TRUE(simulator.Evaluate(x.data(), nullptr, y.data(), J.data()));
  EXPECT_EQ(y, Vector2d(7.5, 5.75));
  EXPECT_EQ(J, A);
  ExpectAdjointIsTransposedJacobian(simulator, x);
  MatrixXd H = MatrixXd::Ones(3, 3);
  ASSERT_TRUE(simulator.WeightedHessian(x.data(), nullptr, y.data(), H.data()));
  EXPECT_EQ(H, MatrixXd::Zero(3, 3));
}

TEST(AutoDiffSimulatorTest, IsTheClosedForm) {
  const AutoDiffSimulator<Curved, 2, 3> simulator;
  const Vector2d x(0.7, -1.3);
  Vector3d y;
  RowMajorMatrix J(3, 2);
  ASSERT_TRUE(simulator.Evaluate(x.data(), nullptr, y.data(), J.data()));
  RowMajorMatrix expected(3, 2);
  expected << -1.3, 0.7, std::cos(0.7), 0.0, 0.0, 3.0 * 1.3 * 1.3;
  EXPECT_LT((J - expected).norm(), 1e-15);
  ExpectAdjointIsTransposedJacobian(simulator, x);

  const Vector3d w(2.0, -1.0, 0.5);
  Matrix2d H;
  ASSERT_TRUE(simulator.WeightedHessian(x.data(), nullptr, w.data(), H.data()));
  Matrix2d expected_hessian;
  expected_hessian << std::sin(0.7), 2.0, 2.0, 0.5 * 6.0 * -1.3;
  EXPECT_LT((H - expected_hessian).norm(), 1e-14);
}

// y = c_0 x_0^2 + c_1 x_1.
struct WithContext {
  template <typename T>
  bool operator()(const T* x, const double* c, T* y) const {
    y[0] = c[0] * x[0] * x[0] + c[1] * x[1];
    return true;
  }
};

TEST(AutoDiffSimulatorTest, GivesTheFunctorItsContext) {
  const AutoDiffSimulator<WithContext, 2, 1, 2> simulator;
  EXPECT_EQ(simulator.num_context(), 2);
  const Vector2d x(3.0, 5.0);
  for (const Vector2d& c : {Vector2d(2.0, -1.0), Vector2d(0.5, 4.0)}) {
    double y = 0.0, value = 0.0;
    Eigen::RowVector2d J;
    Matrix2d H;
    const double w = -2.0;
    ASSERT_TRUE(simulator.Evaluate(x.data(), c.data(), &y, J.data()));
    ASSERT_TRUE(simulator.Evaluate(x.data(), c.data(), &value, nullptr));
    ASSERT_TRUE(simulator.WeightedHessian(x.data(), c.data(), &w, H.data()));
    EXPECT_EQ(y, 9.0 * c[0] + 5.0 * c[1]);
    EXPECT_EQ(value, y);
    EXPECT_EQ(J, Eigen::RowVector2d(6.0 * c[0], c[1]));
    EXPECT_EQ(H, Matrix2d(Vector2d(-4.0 * c[0], 0.0).asDiagonal()));
  }
}

TEST(AutoDiffSimulatorTest, FailsWithTheFunctorOrAnInfinity) {
  const AutoDiffSimulator<Curved, 2, 3> simulator;
  Vector3d y;
  RowMajorMatrix J(3, 2);
  Matrix2d H;
  const Vector3d w = Vector3d::Ones();
  for (const Vector2d& x : {Vector2d(-1.0, 1.0), Vector2d(1.0, 1e200)}) {
    EXPECT_FALSE(simulator.Evaluate(x.data(), nullptr, y.data(), nullptr));
    EXPECT_FALSE(simulator.Evaluate(x.data(), nullptr, y.data(), J.data()));
  }
  const Vector2d refused(-1.0, 1.0);
  EXPECT_FALSE(
      simulator.WeightedHessian(refused.data(), nullptr, w.data(), H.data()));
}

TEST(SimulatorTest, NeedsSizesAndJacobianOnly) {
  const FirstOrderSimulator simulator;
  ExpectAdjointIsTransposedJacobian(simulator, VectorXd::Constant(1, 3.0));
  std::string error;
  EXPECT_FALSE(CheckHasHessian(simulator, &error));
  EXPECT_NE(error.find("no second derivatives"), std::string::npos) << error;
  EXPECT_TRUE(CheckHasHessian(IdentitySimulator(2), &error));
  EXPECT_TRUE(CheckHasHessian(AutoDiffSimulator<Curved, 2, 3>(), &error));
}

TEST(AllFiniteTest, SeesEveryEntry) {
  EXPECT_TRUE(AllFinite(nullptr, 0));
  for (const double bad : {HUGE_VAL, -HUGE_VAL, std::nan("")}) {
    for (int i = 0; i < 3; ++i) {
      Vector3d values(1.0, -1e308, 0.0);
      EXPECT_TRUE(AllFinite(values.data(), 3));
      values[i] = bad;
      EXPECT_FALSE(AllFinite(values.data(), 3));
    }
  }
}

TEST(ScratchTest, KeepsItsMemoryAndNests) {
  const double* first;
  {
    Scratch<double> scratch(100);
    first = scratch.data();
    Scratch<double> nested(50);
    EXPECT_NE(nested.data(), first);
  }
  Scratch<double> again(80);
  EXPECT_EQ(again.size(), 80u);
  Scratch<double> other(50);
  EXPECT_NE(other.data(), again.data());
  EXPECT_TRUE(again.data() == first || other.data() == first);
}

}  // namespace simulator_test
}  // namespace invgrad
