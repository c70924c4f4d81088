#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "Eigen/Cholesky"
#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/internal/qr.h"
#include "invgrad/linearization.h"
#include "invgrad/rules.h"
#include "tests/rules/step_of.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace ssbroyden_rule_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// The loss f of a point, with its gradient.
template <typename Function>
Linearization At(const Function& f, const VectorXd& x) {
  Linearization at_x;
  at_x.cost = f(x, &at_x.gradient);
  at_x.after = [f, x](const VectorXd& step,
                      const LinearizationParts&,
                      Linearization* after,
                      std::string*) {
    after->cost = f(x + step, &after->gradient);
    return std::isfinite(after->cost);
  };
  return at_x;
}

// 1/2 x . A x with eigenvalues 1 .. 10^(n - 1).
struct Bowl {
  explicit Bowl(int n) {
    const MatrixXd Q = Orthonormalized(RandomMatrix(n, n, 3));
    const VectorXd powers = VectorXd::LinSpaced(n, 0.0, n - 1.0);
    A = Q * VectorXd(Eigen::pow(10.0, powers.array())).asDiagonal() *
        Q.transpose();
  }
  double operator()(const VectorXd& x, VectorXd* gradient) const {
    *gradient = A * x;
    return 0.5 * x.dot(*gradient);
  }
  MatrixXd A;
};

// sum_i 100 (x_{i+1} - x_i^2)^2 + (1 - x_i)^2, times a factor.
struct Rosenbrock {
  double factor = 1.0;
  double operator()(const VectorXd& x, VectorXd* gradient) const {
    gradient->setZero(x.size());
    double sum = 0.0;
    for (int i = 0; i + 1 < x.size(); ++i) {
      const double u = x[i + 1] - x[i] * x[i];
      const double v = 1.0 - x[i];
      sum += 100.0 * u * u + v * v;
      (*gradient)[i + 1] += factor * 200.0 * u;
      (*gradient)[i] -= factor * (400.0 * u * x[i] + 2.0 * v);
    }
    return factor * sum;
  }
};

// H of a rule that has taken a step.
MatrixXd InverseHessian(UpdateRule* rule, int n) {
  const Eigen::Map<const MatrixXd> H(rule->MutableState()[0]->data(), n, n);
  return H.selfadjointView<Eigen::Lower>();
}

constexpr const char* kUpdates[] = {"ssbroyden", "ssbfgs", "bfgs"};

std::string RuleOf(const std::string& update) {
  return "ssbroyden:update=" + update;
}

TEST(SsBroydenRule, InverseHessiansAreSecantAndPositiveDefinite) {
  constexpr int kSize = 5;
  const Rosenbrock f;
  for (const std::string update : kUpdates) {
    SCOPED_TRACE(update);
    const auto rule = MakeRule(RuleOf(update));
    VectorXd x = VectorXd::LinSpaced(kSize, -1.5, 1.0);
    for (int k = 0; k < 20; ++k) {
      const Linearization before = At(f, x);
      const VectorXd s = StepOf(rule.get(), before);
      x += s;
      const VectorXd y = At(f, x).gradient - before.gradient;
      const MatrixXd H = InverseHessian(rule.get(), kSize);
      EXPECT_LT((H * y - s).norm(), 1e-9 * s.norm());
      EXPECT_EQ(H.llt().info(), Eigen::Success);
    }
  }
}

TEST(SsBroydenRule, BfgsIsTheTextbookFormula) {
  constexpr int kSize = 4;
  const Rosenbrock f;
  const auto rule = MakeRule("ssbroyden:update=bfgs");
  VectorXd x = VectorXd::LinSpaced(kSize, -1.5, 1.0);
  const MatrixXd I = MatrixXd::Identity(kSize, kSize);
  MatrixXd H = I;
  for (int k = 0; k < 10; ++k) {
    const Linearization before = At(f, x);
    const VectorXd s = StepOf(rule.get(), before);
    // The step is along -H g.
    const VectorXd d = -H * before.gradient;
    EXPECT_NEAR(s.normalized().dot(d.normalized()), 1.0, 1e-12);
    x += s;
    const VectorXd y = At(f, x).gradient - before.gradient;
    const double ys = y.dot(s);
    if (k == 0) H = ys / y.squaredNorm() * I;
    H = ((I - s * y.transpose() / ys) * H * (I - y * s.transpose() / ys) +
         s * s.transpose() / ys)
            .eval();
    EXPECT_LT((InverseHessian(rule.get(), kSize) - H).norm(), 1e-9 * H.norm());
  }
}

// Equations 13 to 23 of arXiv 2405.04230 as they stand there, with b from H^-1.
TEST(SsBroydenRule, SelfScaledUpdatesAreThePublishedFormulas) {
  constexpr int kSize = 4;
  const Rosenbrock f;
  for (const std::string update : {"ssbroyden", "ssbfgs"}) {
    SCOPED_TRACE(update);
    const auto rule = MakeRule(RuleOf(update));
    VectorXd x = VectorXd::LinSpaced(kSize, -1.5, 1.0);
    x += StepOf(rule.get(), At(f, x));
    int num_scaled = 0;
    for (int k = 1; k < 12; ++k) {
      const MatrixXd H = InverseHessian(rule.get(), kSize);
      const VectorXd g = At(f, x).gradient;
      const VectorXd s = StepOf(rule.get(), At(f, x));
      x += s;
      const VectorXd y = At(f, x).gradient - g;
      const double ys = y.dot(s);
      const VectorXd Hy = H * y;
      const double b = s.dot(H.llt().solve(s)) / ys;
      const double h = y.dot(Hy) / ys;
      const double a = b * h - 1.0;
      const double c = std::sqrt(a / (a + 1.0));
      const double rho_minus = std::min(1.0, h * (1.0 - c));
      const double theta =
          update == "ssbfgs"
              ? 0.0
              : std::max((rho_minus - 1.0) / a,
                         std::min(1.0 / rho_minus, (1.0 - b) / b));
      const double sigma = 1.0 + a * theta;
      const double root = std::pow(sigma, 1.0 / (1.0 - kSize));
      const double rho = std::min(1.0, 1.0 / b);
      const double tau = theta > 0.0 ? rho * std::min(root, 1.0 / theta)
                                     : std::min(rho * root, sigma);
      const double phi = (1.0 - theta) / sigma;
      const VectorXd v = std::sqrt(y.dot(Hy)) * (s / ys - Hy / y.dot(Hy));
      const MatrixXd expected =
          (H - Hy * Hy.transpose() / y.dot(Hy) + phi * v * v.transpose()) /
              tau +
          s * s.transpose() / ys;
      EXPECT_LT((InverseHessian(rule.get(), kSize) - expected).norm(),
                1e-8 * expected.norm());
      if (tau < 1.0) ++num_scaled;
    }
    EXPECT_GT(num_scaled, 0);
  }
}

// With exact line searches, methods of the Broyden family have conjugate
// directions, also if H is scaled.
TEST(SsBroydenRule, AQuadraticOfNUnknownsIsMinimizedInNExactSteps) {
  constexpr int kSize = 4;
  const Bowl f(kSize);
  for (const std::string update : kUpdates) {
    SCOPED_TRACE(update);
    const auto rule = MakeRule(RuleOf(update) + ":curvature=1e-11");
    VectorXd x = RandomMatrix(kSize, 1, 5);
    VectorXd gradient;
    const double cost = f(x, &gradient);
    for (int k = 0; k < kSize; ++k) x += StepOf(rule.get(), At(f, x));
    EXPECT_LT(f(x, &gradient), 1e-15 * cost);
    // H is then the inverse of A, if it was not scaled.
    const MatrixXd H = InverseHessian(rule.get(), kSize);
    if (update == "bfgs") {
      EXPECT_LT((H * f.A - MatrixXd::Identity(kSize, kSize)).norm(), 1e-4);
    }
  }
}

TEST(SsBroydenRule, StepsSatisfyTheStrongWolfeConditions) {
  const Rosenbrock f;
  for (const double curvature : {0.9, 0.1}) {
    const auto rule =
        MakeRule("ssbroyden:curvature=" + std::to_string(curvature));
    VectorXd x = VectorXd::LinSpaced(6, -1.5, 1.0);
    for (int k = 0; k < 30; ++k) {
      const Linearization before = At(f, x);
      const VectorXd s = StepOf(rule.get(), before);
      x += s;
      const Linearization after = At(f, x);
      const double slope = before.gradient.dot(s);
      EXPECT_LE(after.cost, before.cost + 1e-4 * slope);
      EXPECT_LE(std::abs(after.gradient.dot(s)), -curvature * slope);
    }
  }
}

TEST(SsBroydenRule, FindsTheMinimumOfACurvedValley) {
  const Rosenbrock f;
  for (const std::string update : kUpdates) {
    const auto rule = MakeRule(RuleOf(update));
    VectorXd x = Eigen::Vector2d(-1.2, 1.0);
    for (int k = 0; k < 100; ++k) x += StepOf(rule.get(), At(f, x));
    EXPECT_LT((x - VectorXd::Ones(2)).norm(), 1e-8) << update;
  }
}

// If the first step has length one in both, and the factor is a power of two,
// bit for bit. Of ssbroyden, theta in the first update depends on the unit.
TEST(SsBroydenRule, BfgsStepsDoNotDependOnTheUnitOfTheLoss) {
  for (const std::string update : {"bfgs", "ssbfgs"}) {
    const auto rule = MakeRule(RuleOf(update));
    const auto scaled_rule = MakeRule(RuleOf(update));
    VectorXd x = VectorXd::LinSpaced(4, -1.5, 1.0);
    VectorXd scaled_x = x;
    for (int k = 0; k < 15; ++k) {
      x += StepOf(rule.get(), At(Rosenbrock(), x));
      scaled_x += StepOf(scaled_rule.get(), At(Rosenbrock{1024.0}, scaled_x));
      EXPECT_TRUE(x == scaled_x) << update << ", step " << k;
    }
  }
}

TEST(SsBroydenRule, LongAndInvalidTrialsAreShortened) {
  // 1/2 |x|^2, defined only within 0.1 of the start.
  const VectorXd start = VectorXd::Constant(3, 2.0);
  const auto f = [start](const VectorXd& x, VectorXd* gradient) {
    *gradient = x;
    return (x - start).norm() < 0.1 ? 0.5 * x.squaredNorm()
                                    : std::numeric_limits<double>::quiet_NaN();
  };
  const auto rule = MakeRule("ssbroyden");
  const VectorXd step = StepOf(rule.get(), At(f, start));
  EXPECT_GT(step.norm(), 0.01);
  EXPECT_LT(step.norm(), 0.1);
}

TEST(SsBroydenRule, WithoutALowerPointThereIsNoStep) {
  const auto rule = MakeRule("ssbroyden");
  const Bowl f(3);
  VectorXd x = VectorXd::Ones(3);
  x += StepOf(rule.get(), At(f, x));
  EXPECT_EQ(rule->MutableState()[0]->size(), 9);
  Linearization at_x = At(f, x);
  at_x.after = [](const auto&, const auto&, auto*, auto*) { return false; };
  EXPECT_TRUE(StepOf(rule.get(), at_x).isZero(0.0));
  EXPECT_EQ(rule->LastStepReport(), "no step lowers the loss");
  // H = 1 again.
  EXPECT_EQ(rule->MutableState()[0]->size(), 0);
}

TEST(SsBroydenRule, RefusesTooManyUnknownsAndLoopsWithoutTrials) {
  const Rosenbrock f;
  const auto rule = MakeRule("ssbroyden");
  VectorXd step;
  std::string error;
  Linearization at_x = At(f, VectorXd::Zero(20001));
  EXPECT_FALSE(rule->ComputeStep(at_x, &step, &error));
  EXPECT_EQ(error,
            "ssbroyden keeps n^2 numbers; n is 20001, allowed: up to 20000");
  at_x.after = nullptr;
  EXPECT_FALSE(rule->ComputeStep(at_x, &step, &error));
  EXPECT_EQ(error, "this loop cannot evaluate the loss at other points");
}

}  // namespace ssbroyden_rule_test
}  // namespace invgrad
