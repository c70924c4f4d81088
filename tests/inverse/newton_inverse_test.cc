#include "invgrad/inverse/newton_inverse.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "Eigen/Core"
#include "Eigen/Eigenvalues"
#include "gtest/gtest.h"
#include "tests/support/make_simulator.h"
#include "tests/support/without_hessian.h"

namespace invgrad {
namespace newton_inverse_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// y = scale (sin(u0) / xi, xi u1), u = R_phi x.
struct Sine {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::sin;
    const T u0 = std::cos(phi) * x[0] - std::sin(phi) * x[1];
    const T u1 = std::sin(phi) * x[0] + std::cos(phi) * x[1];
    y[0] = scale / xi * sin(u0);
    y[1] = scale * xi * u1;
    return true;
  }
  double xi = 4.0;
  double phi = 0.0;
  double scale = 1.0;
};

// y = (x, x^2).
struct Parabola {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    y[0] = x[0];
    y[1] = x[0] * x[0];
    return true;
  }
};

// y = (x0 + x1 x2, x1^2 - x0 x2, sin(x2) + x0^2).
struct Curved {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::sin;
    y[0] = x[0] + x[1] * x[2];
    y[1] = x[1] * x[1] - x[0] * x[2];
    y[2] = sin(x[2]) + x[0] * x[0];
    return true;
  }
};

// y = (x0, x1^2).
struct Squared {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    y[0] = x[0];
    y[1] = x[1] * x[1];
    return true;
  }
};

NewtonInverse::Options MakeOptions(double max_loss_change,
                                   double damping = 0.0,
                                   int num_steps = 1) {
  return {num_steps, max_loss_change, damping};
}

// x; fails the test if there is none.
VectorXd Inverted(const std::shared_ptr<const Simulator>& simulator,
                  const NewtonInverse::Options& options,
                  const VectorXd& y,
                  const VectorXd& x0) {
  VectorXd x;
  std::string why = "untouched";
  EXPECT_TRUE(
      NewtonInverse(simulator, options).Invert(y, x0, VectorXd(), &x, &why));
  EXPECT_EQ(why, "untouched");
  return x;
}

// g and H of F = 1/2 |P - y|^2, by central differences of F.
void Differences(const Simulator& simulator,
                 const VectorXd& y,
                 const VectorXd& x,
                 VectorXd* g,
                 MatrixXd* H) {
  const Eigen::Index n = x.size();
  const double h = 1e-4;
  const auto F = [&](const VectorXd& at) {
    VectorXd value(y.size());
    EXPECT_TRUE(simulator.Evaluate(at.data(), nullptr, value.data(), nullptr));
    return 0.5 * (value - y).squaredNorm();
  };
  g->resize(n);
  H->resize(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const VectorXd e = h * VectorXd::Unit(n, i);
    (*g)[i] = (F(x + e) - F(x - e)) / (2.0 * h);
    for (Eigen::Index k = 0; k < n; ++k) {
      const VectorXd f = h * VectorXd::Unit(n, k);
      (*H)(i, k) = (F(x + e + f) - F(x + e - f) - F(x - e + f) + F(x - e - f)) /
                   (4.0 * h * h);
    }
  }
}

// The header's formula.
VectorXd ExpectedStep(const VectorXd& g,
                      const MatrixXd& H,
                      double max_loss_change,
                      double damping) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(H);
  const VectorXd& lambda = eigen.eigenvalues();
  const MatrixXd& Q = eigen.eigenvectors();
  const double mean = std::pow(lambda.cwiseAbs().prod(), 1.0 / g.size());
  VectorXd d = Q.transpose() * g;
  for (Eigen::Index i = 0; i < d.size(); ++i) {
    const double slope = std::abs(d[i]);
    double length = slope / (std::abs(lambda[i]) + damping);
    if (lambda[i] <= mean) length = std::min(length, max_loss_change / slope);
    d[i] = std::copysign(length, d[i]);
  }
  return -Q * d;
}

struct Case {
  std::shared_ptr<const Simulator> simulator;
  VectorXd y;
  VectorXd x;
};

// In one, two (Jacobi's rotation) and three dimensions, convex and not.
TEST(NewtonInverseTest, OneStepIsTheFormula) {
  const Case cases[] = {
      {MakeSimulator<1, 2>(Parabola()),
       Vector2d(1.0, -1.0),
       VectorXd::Constant(1, 0.3)},
      {MakeSimulator<1, 2>(Parabola()),
       Vector2d(0.0, 2.0),
       VectorXd::Constant(1, 0.2)},
      {MakeSimulator<2, 2>(Sine{2.0, 0.4}),
       Vector2d(0.3, -0.5),
       Vector2d(0.2, 0.7)},
      {MakeSimulator<2, 2>(Sine{2.0, -0.8}),
       Vector2d(-0.3, -0.5),
       Vector2d(2.5, 0.7)},
      {MakeSimulator<2, 2>(Squared()), Vector2d(0.5, 1.0), Vector2d(0.2, 0.1)},
      {MakeSimulator<3, 3>(Curved()),
       Vector3d(0.3, -0.2, 0.5),
       Vector3d(0.1, 0.4, -0.6)},
      {MakeSimulator<3, 3>(Curved()),
       Vector3d(0.3, 2.0, 0.5),
       Vector3d(0.7, -0.4, 1.6)}};
  bool seen_bound = false;
  bool seen_newton = false;
  bool seen_concave = false;
  for (const Case& c : cases) {
    VectorXd g;
    MatrixXd H;
    Differences(*c.simulator, c.y, c.x, &g, &H);
    seen_concave |=
        Eigen::SelfAdjointEigenSolver<MatrixXd>(H).eigenvalues()[0] < -0.01;
    const VectorXd newton = ExpectedStep(g, H, kInfinity, 0.0);
    for (const double max_loss_change : {1e-3, 0.2, 1e9}) {
      for (const double damping : {0.0, 0.3}) {
        const VectorXd expected = ExpectedStep(g, H, max_loss_change, damping);
        const VectorXd step =
            Inverted(
                c.simulator, MakeOptions(max_loss_change, damping), c.y, c.x) -
            c.x;
        // The differences are exact to 1e-6, the eigenvalues above 0.01.
        EXPECT_LT((step - expected).norm(), 1e-4 * (1.0 + expected.norm()))
            << c.x.transpose() << ": " << step.transpose() << ", expected "
            << expected.transpose();
        if (damping == 0.0) {
          const bool is_bounded = (expected - newton).norm() > 1e-2;
          (is_bounded ? seen_bound : seen_newton) = true;
        }
      }
    }
  }
  EXPECT_TRUE(seen_bound && seen_newton && seen_concave);
}

// Without rotation H is diagonal: xi^2 for x1, and for x0
//   lambda = (cos^2 x0 - sin x0 (sin x0 - xi y0)) / xi^2.
TEST(NewtonInverseTest, OfTheSineIsTheClosedForm) {
  const double xi = 8.0;
  const auto simulator = MakeSimulator<2, 2>(Sine{xi});
  const Vector2d y(0.1, -0.5);
  const double damping = 0.01;
  const double max_loss_change = 1e-3;
  for (const double x0 : {0.3, 1.2, 1.9, -1.3}) {
    const double s = std::sin(x0);
    const double c = std::cos(x0);
    const double lambda = (c * c - s * (s - xi * y[0])) / (xi * xi);
    const double slope = (s - xi * y[0]) * c / (xi * xi);
    const double length =
        std::min(std::abs(slope) / (std::abs(lambda) + damping),
                 max_loss_change / std::abs(slope));
    const Vector2d x = Inverted(
        simulator, MakeOptions(max_loss_change, damping), y, Vector2d(x0, 0.7));
    EXPECT_NEAR(x[0], x0 - std::copysign(length, slope), 1e-13);
    // The steep direction is not bounded.
    const double change = xi * (xi * 0.7 - y[1]) / (xi * xi + damping);
    EXPECT_NEAR(x[1], 0.7 - change, 1e-14);
  }
}

// Whether the target is in range or not, the error is squared by a step.
TEST(NewtonInverseTest, UnboundedItConvergesQuadratically) {
  const Case cases[] = {
      {MakeSimulator<1, 2>(Parabola()),
       Vector2d(1.0, -1.0),
       VectorXd::Constant(1, 0.6)},
      {MakeSimulator<3, 3>(Curved()),
       Vector3d(0.3, 0.4, 0.2),
       Vector3d(0.35, 0.7, 0.1)},
      {MakeSimulator<2, 2>(Squared()), Vector2d(0.5, 1.0), Vector2d(0.2, 1.2)}};
  for (const Case& c : cases) {
    const auto after = [&](int num_steps) {
      return Inverted(c.simulator, MakeOptions(1e9, 0.0, num_steps), c.y, c.x);
    };
    const VectorXd limit = after(12);
    VectorXd g;
    MatrixXd H;
    Differences(*c.simulator, c.y, limit, &g, &H);
    EXPECT_LT(g.norm(), 1e-7);  // h^2
    EXPECT_EQ(after(13), limit);
    double errors[5];
    for (int k = 0; k < 5; ++k) {
      errors[k] = k == 0 ? (c.x - limit).norm() : (after(k) - limit).norm();
    }
    // The order is seen where errors are small and not yet rounding.
    int seen = 0;
    for (int k = 1; k < 4; ++k) {
      if (errors[k - 1] > 0.1 || errors[k + 1] < 1e-12) continue;
      const double order = std::log(errors[k + 1] / errors[k]) /
                           std::log(errors[k] / errors[k - 1]);
      EXPECT_GT(order, 1.7);
      ++seen;
    }
    EXPECT_GE(seen, 1);
  }
}

// F of (x0, x1^2) has a saddle at (y0, 0), with the pre-images on both sides.
TEST(NewtonInverseTest, MovesAwayFromASaddle) {
  const auto simulator = MakeSimulator<2, 2>(Squared());
  const Vector2d y(0.5, 1.0);
  for (const double side : {-1.0, 1.0}) {
    const Vector2d x0(0.4, 0.05 * side);
    const Vector2d x = Inverted(simulator, MakeOptions(0.2), y, x0);
    EXPECT_GT(side * x[1], 0.09);
    EXPECT_NEAR(x[0], 0.5, 0.11);
    const VectorXd end = Inverted(simulator, MakeOptions(0.2, 0.0, 20), y, x0);
    EXPECT_LT((end - Vector2d(0.5, side)).norm(), 1e-12);
  }
}

// Along each direction that is not steep, |d_i| |Q^T g|_i <= max_loss_change.
TEST(NewtonInverseTest, TheBoundHolds) {
  const auto simulator = MakeSimulator<2, 2>(Sine());
  const Vector2d y(0.2, -0.5);
  for (const double max_loss_change : {1e-6, 1e-4, 1e-2}) {
    for (double x0 = -3.0; x0 < 3.0; x0 += 0.1) {
      const Vector2d start(x0, 0.3);
      const Vector2d x =
          Inverted(simulator, MakeOptions(max_loss_change), y, start);
      const double slope = (std::sin(x0) / 4.0 - y[0]) * std::cos(x0) / 4.0;
      EXPECT_LE(std::abs((x - start)[0] * slope),
                max_loss_change * (1.0 + 1e-9));
    }
  }
}

// All eigenvalues are the geometric mean, so none is above it.
TEST(NewtonInverseTest, TheBoundHoldsWhereAllEigenvaluesAreEqual) {
  for (const int n : {1, 2, 3}) {
    for (double a = 0.1; a < 10.0; a *= 1.07) {
      const auto simulator = MakeLinear(a * MatrixXd::Identity(n, n));
      const VectorXd step = Inverted(simulator,
                                     MakeOptions(1e-3 * a * a),
                                     VectorXd::Zero(n),
                                     VectorXd::Ones(n)) -
                            VectorXd::Ones(n);
      EXPECT_LT((step + 1e-3 * VectorXd::Ones(n)).norm(), 1e-12)
          << "n = " << n << ", a = " << a << ": " << step.transpose();
    }
  }
}

// Where P does not depend on a direction it has no slope but rounding's, and no
// curvature: it must not be moved along.
TEST(NewtonInverseTest, DoesNotMoveAlongDirectionsThatDoNotMatter) {
  for (const int n : {2, 3}) {
    for (double angle = 0.05; angle < 3.0; angle += 0.1) {
      MatrixXd row(1, n);
      row.setConstant(0.7);
      row(0, 0) = std::cos(angle);
      row(0, 1) = std::sin(angle);
      const VectorXd x0 = VectorXd::LinSpaced(n, 0.3, 1.1);
      const VectorXd y = VectorXd::Constant(1, -2.0);
      const VectorXd step =
          Inverted(MakeLinear(row), MakeOptions(0.2), y, x0) - x0;
      const VectorXd shortest =
          row.transpose() * (y - row * x0) / row.squaredNorm();
      EXPECT_LT((step - shortest).norm(), 1e-12)
          << "n = " << n << ", angle " << angle << ": " << step.transpose();
    }
  }
}

TEST(NewtonInverseTest, WithoutASlopeThereIsNoStep) {
  const auto simulator = MakeSimulator<2, 2>(Squared());
  const Vector2d y(0.5, 1.0);
  // Two pre-images and the saddle between them.
  for (const double x1 : {-1.0, 0.0, 1.0}) {
    const Vector2d x0(0.5, x1);
    EXPECT_EQ(Inverted(simulator, MakeOptions(0.2, 0.0, 5), y, x0), x0);
  }
}

TEST(NewtonInverseTest, StepsAreRepeated) {
  const auto simulator = MakeSimulator<3, 3>(Curved());
  const Vector3d y(0.3, -0.2, 0.5);
  VectorXd x = Vector3d(0.1, 0.4, -0.6);
  const VectorXd at_once = Inverted(simulator, MakeOptions(0.2, 0.1, 4), y, x);
  for (int k = 0; k < 4; ++k) {
    x = Inverted(simulator, MakeOptions(0.2, 0.1), y, x);
  }
  EXPECT_EQ(at_once, x);
}

// The options' units: another unit of y does not change the step.
TEST(NewtonInverseTest, OptionsScaleAsTheSquareOfTheOutput) {
  const Vector2d y(0.3, -0.5);
  const Vector2d x0(2.5, 0.7);
  const VectorXd x = Inverted(
      MakeSimulator<2, 2>(Sine{2.0, 0.4}), MakeOptions(1e-2, 0.05), y, x0);
  for (const double unit : {1e-3, 1e5}) {
    const VectorXd in_units =
        Inverted(MakeSimulator<2, 2>(Sine{2.0, 0.4, unit}),
                 MakeOptions(1e-2 * unit * unit, 0.05 * unit * unit),
                 unit * y,
                 x0);
    EXPECT_LT((in_units - x).norm(), 1e-13);
  }
}

TEST(NewtonInverseTest, FailsWithoutDerivatives) {
  const auto why = [](std::shared_ptr<const Simulator> simulator,
                      const VectorXd& y,
                      const VectorXd& x0) {
    VectorXd x;
    std::string text;
    EXPECT_FALSE(NewtonInverse(std::move(simulator), MakeOptions(0.2))
                     .Invert(y, x0, VectorXd(), &x, &text));
    return text;
  };
  const auto squared = MakeSimulator<2, 2>(Squared());
  EXPECT_EQ(why(squared, Vector2d(0.0, 1.0), Vector2d(0.0, 1e200)),
            "the simulator has no finite value");
  EXPECT_EQ(why(std::make_shared<WithoutHessian>(),
                Vector2d(0.0, 1.0),
                Vector2d(0.0, 0.0)),
            "the simulator has no finite second derivative");
  for (const double bad : {kInfinity, std::nan("")}) {
    EXPECT_NE(why(squared, Vector2d(bad, 1.0), Vector2d(0.0, 1.0)), "");
  }
}

TEST(NewtonInverseDeathTest, RefusesWhatMakesNoSense) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const auto simulator = MakeSimulator<2, 2>(Squared());
  EXPECT_DEATH(NewtonInverse(simulator, MakeOptions(0.0)), "max_loss_change");
  EXPECT_DEATH(NewtonInverse(simulator, MakeOptions(0.2, -1.0)), "damping");
  EXPECT_DEATH(NewtonInverse(simulator, MakeOptions(0.2, 0.0, 0)), "num_steps");
  EXPECT_DEATH(NewtonInverse(nullptr, MakeOptions(0.2)), "simulator");
  EXPECT_DEATH(
      NewtonInverse(std::make_shared<FirstOrderSimulator>(), MakeOptions(0.2)),
      "no second derivatives");
}

}  // namespace newton_inverse_test
}  // namespace invgrad
