// The rule hessian_free.

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "Eigen/Core"
#include "Eigen/LU"
#include "gtest/gtest.h"
#include "invgrad/update_rule.h"
#include "tests/rules/step_of.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace hessian_free_rule_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// J of which only products are allowed.
class ProductsAlone final : public JacobianOperator {
 public:
  explicit ProductsAlone(MatrixXd J) : J_(std::move(J)) {}
  int rows() const override { return static_cast<int>(J_.rows()); }
  int cols() const override { return static_cast<int>(J_.cols()); }
  void Times(const VectorXd& v, VectorXd* Jv) const override { *Jv = J_ * v; }
  void TransposeTimes(const VectorXd& w, VectorXd* Jtw) const override {
    *Jtw = J_.transpose() * w;
  }
  void Gram(MatrixXd*) const override { ADD_FAILURE() << "forms J J^T"; }
  void ToDense(MatrixXd*) const override { ADD_FAILURE() << "forms J"; }
  void ParameterGram(MatrixXd*) const override {
    ADD_FAILURE() << "forms J^T J";
  }

 private:
  MatrixXd J_;
};

// L = cost + 1/2 r . C r at r = g, with diagonal C.
struct Curved {
  MatrixXd J = RandomMatrix(12, 7, 1);
  VectorXd g = RandomMatrix(12, 1, 2);
  VectorXd c = VectorXd::LinSpaced(12, 0.5, 3.0);

  Linearization At() const {
    Linearization at_x;
    at_x.cost = 1.0;
    at_x.loss_gradient = g;
    at_x.jacobian = std::make_shared<ProductsAlone>(J);
    at_x.loss_hessian_times = [c = c](const VectorXd& v) -> VectorXd {
      return c.cwiseProduct(v);
    };
    return at_x;
  }
  MatrixXd GaussNewton() const { return J.transpose() * c.asDiagonal() * J; }
  VectorXd Damped(double lambda) const {
    const MatrixXd B = GaussNewton() + lambda * MatrixXd::Identity(7, 7);
    return -B.lu().solve(J.transpose() * g);
  }
};

double Damping(UpdateRule* rule) { return (*rule->MutableState()[0])[0]; }

TEST(HessianFree, ConvergedItIsTheDampedGaussNewtonStep) {
  const Curved problem;
  for (const std::string damping : {"1e-6", "0.7", "100"}) {
    const VectorXd expected = problem.Damped(std::stod(damping));
    const VectorXd step =
        StepOf("hessian_free:tolerance=0:damping=" + damping, problem.At());
    EXPECT_LE((step - expected).norm(), 1e-9 * expected.norm());
  }
}

// Minimizer along the gradient: b (b . b) / (b . B b).
TEST(HessianFree, OneIterationIsTheCauchyPoint) {
  const Curved problem;
  const VectorXd b = -problem.J.transpose() * problem.g;
  const MatrixXd B = problem.GaussNewton() + 0.5 * MatrixXd::Identity(7, 7);
  const VectorXd expected = b * (b.squaredNorm() / b.dot(B * b));
  const VectorXd step =
      StepOf("hessian_free:iterations=1:damping=0.5", problem.At());
  EXPECT_LE((step - expected).norm(), 1e-13 * expected.norm());
}

// 200 values over four decades: conjugate gradients need more than a hundred
// iterations to converge, and 5e-4 of progress in an iteration ends them early.
TEST(HessianFree, EndsByTheProgressOfTheModel) {
  const VectorXd s =
      VectorXd::LinSpaced(200, 0.0, -2.0).unaryExpr([](double e) {
        return std::pow(10.0, e);
      });
  Linearization at_x;
  at_x.loss_gradient = VectorXd::Ones(200);
  at_x.jacobian = std::make_shared<ProductsAlone>(s.asDiagonal());
  const auto iterations = [&](const std::string& settings) {
    const auto rule = MakeRule("hessian_free:damping=1e-8" + settings);
    StepOf(rule.get(), at_x);
    return std::stoi(rule->LastStepReport());
  };
  EXPECT_GT(iterations(":tolerance=0"), 100);
  EXPECT_LT(iterations(""), 100);
  EXPECT_LT(iterations(":tolerance=0.1"), iterations(""));
  EXPECT_GT(iterations(":tolerance=10"), 10);
}

TEST(HessianFree, BeginsAtTheLastStep) {
  const Curved problem;
  const std::string text = "hessian_free:tolerance=0:damping_factor=1";
  const auto warm = MakeRule(text + ":warm_start=1");
  const VectorXd first = StepOf(warm.get(), problem.At());
  // One iteration from the solution stays there, and from zero does not get
  // there.
  const auto resumed = MakeRule(text + ":warm_start=1:iterations=1");
  *resumed->MutableState()[1] = *warm->MutableState()[1];
  EXPECT_LE((StepOf(resumed.get(), problem.At()) - first).norm(),
            1e-9 * first.norm());
  EXPECT_GT((StepOf(text + ":iterations=1", problem.At()) - first).norm(),
            1e-2 * first.norm());
  // The opposite of the solution is worse than zero, and not used.
  *resumed->MutableState()[1] = -first;
  EXPECT_EQ(StepOf(resumed.get(), problem.At()),
            StepOf(text + ":iterations=1", problem.At()));
}

TEST(HessianFree, TheDampingFollowsTheGain) {
  const Curved problem;
  const auto rule = MakeRule("hessian_free:damping=2:damping_factor=1.5");
  const VectorXd step = StepOf(rule.get(), problem.At());
  const auto decrease = [&](double fraction) {
    const VectorXd d = fraction * step;
    return -problem.g.dot(problem.J * d) -
           0.5 * d.dot(problem.GaussNewton() * d);
  };
  const struct {
    double ratio;
    double fraction;
    double factor;
    bool is_kept;
  } cases[] = {{1.0, 1.0, 1.0 / 1.5, true},
               {0.76, 0.5, 1.0 / 1.5, true},
               {0.74, 1.0, 1.0, true},
               {0.26, 0.5, 1.0, true},
               {0.24, 1.0, 1.5, true},
               {-0.1, 1.0, 1.5, false},
               {std::numeric_limits<double>::quiet_NaN(), 1.0, 1.5, false}};
  for (const auto& c : cases) {
    const double before = Damping(rule.get());
    EXPECT_EQ(rule->judge()->KeepsStep(1.0 - c.ratio * decrease(c.fraction),
                                       c.fraction),
              c.is_kept)
        << c.ratio;
    EXPECT_DOUBLE_EQ(Damping(rule.get()), c.factor * before) << c.ratio;
  }
}

// An H_L with negative values: conjugate gradients end, on a descent direction.
TEST(HessianFree, NegativeCurvatureEndsOnADescentDirection) {
  Curved problem;
  for (const double lowest : {-3.0, -0.5}) {
    problem.c = VectorXd::LinSpaced(12, lowest, 1.0);
    const VectorXd step = StepOf("hessian_free:damping=1e-3", problem.At());
    EXPECT_LT(problem.g.dot(problem.J * step), 0.0);
  }
  problem.c.setConstant(-1.0);
  const VectorXd step = StepOf("hessian_free:damping=1e-3", problem.At());
  EXPECT_LT(problem.g.dot(problem.J * step), 0.0);
}

TEST(HessianFree, ReportsIterationsAndDamping) {
  const Curved problem;
  const auto rule = MakeRule("hessian_free:iterations=3:damping=0.25");
  StepOf(rule.get(), problem.At());
  EXPECT_EQ(rule->LastStepReport(), "3 iterations, damping 0.25");
}

}  // namespace hessian_free_rule_test
}  // namespace invgrad
