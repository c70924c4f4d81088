// The rule adahessian, and the products with the Hessian that loops give it.

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/loss.h"
#include "invgrad/model.h"
#include "tests/rules/step_of.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace adahessian_rule_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// A linearization with the products of H, which notes each z * (H z).
Linearization WithHessian(const VectorXd& gradient,
                          const MatrixXd& H,
                          std::vector<VectorXd>* diagonals) {
  Linearization at_x;
  at_x.gradient = gradient;
  at_x.hessian_times = [H, diagonals](const VectorXd& z, VectorXd* Hz, auto*) {
    EXPECT_EQ(z.cwiseAbs(), VectorXd(VectorXd::Ones(z.size())));
    *Hz = H * z;
    diagonals->push_back(z.cwiseProduct(*Hz));
    return true;
  };
  return at_x;
}

TEST(AdaHessian, ADiagonalHessianIsExactForAllSigns) {
  const VectorXd h = (VectorXd(4) << 1e-3, 2.0, -5.0, 1e4).finished();
  const VectorXd gradient = RandomMatrix(4, 1, 1);
  for (const int seed : {0, 1, 2, 3}) {
    std::vector<VectorXd> diagonals;
    const Linearization at_x =
        WithHessian(gradient, h.asDiagonal(), &diagonals);
    const VectorXd step = StepOf(
        "adahessian:step_size=1:epsilon=1e-2:seed=" + std::to_string(seed),
        at_x);
    EXPECT_EQ(diagonals[0], h);
    const VectorXd expected = -gradient.array() / (h.array().abs() + 1e-2);
    EXPECT_LE((step - expected).norm(), 1e-14 * expected.norm());
  }
}

// Var (z_i (H z)_i) = sum over j != i of H_ij^2.
TEST(AdaHessian, OfALinearNetworkItIsTheDiagonalInTheMean) {
  const Model model(DenseNetwork({3, 2}, Activation::kTanh),
                    std::make_shared<IdentitySimulator>(2),
                    std::make_shared<SquaredNormLoss>(2, 0.5),
                    Reduction::kMean);
  DataSet data;
  data.inputs = RandomMatrix(3, 10, 1);
  data.contexts.resize(0, 10);
  data.targets = RandomMatrix(2, 10, 2);
  LinearizationParts parts = LinearizationParts::Gradient();
  parts.hessian = true;
  Linearization exact;
  std::string error;
  ASSERT_TRUE(
      model.Linearize(RandomMatrix(8, 1, 3), data, parts, &exact, &error))
      << error;
  const MatrixXd& H = exact.hessian;
  std::vector<VectorXd> diagonals;
  const Linearization at_x = WithHessian(exact.gradient, H, &diagonals);
  const std::unique_ptr<UpdateRule> rule = MakeRule("adahessian");
  constexpr int kNumDraws = 4000;
  VectorXd mean = VectorXd::Zero(8);
  for (int k = 0; k < kNumDraws; ++k) {
    StepOf(rule.get(), at_x);
    mean += diagonals[k] / kNumDraws;
  }
  for (int i = 0; i < 8; ++i) {
    const double variance = H.col(i).squaredNorm() - H(i, i) * H(i, i);
    EXPECT_GT(variance, 0.0);
    EXPECT_NEAR(mean[i], H(i, i), 4.0 * std::sqrt(variance / kNumDraws));
  }
}

TEST(AdaHessian, MomentsAndPowerAreThePublishedOnes) {
  std::vector<VectorXd> diagonals;
  const auto at = [&](double gradient, double h) {
    return WithHessian(VectorXd::Constant(1, gradient),
                       MatrixXd::Constant(1, 1, h),
                       &diagonals);
  };
  const std::unique_ptr<UpdateRule> rule = MakeRule(
      "adahessian:step_size=0.1:beta1=0.5:beta2=0.75:epsilon=0.5:"
      "hessian_power=0.5");
  // u = 1, v = 1; corrected 2 and 4; the root of the root is sqrt(2).
  EXPECT_NEAR(StepOf(rule.get(), at(2.0, 2.0))[0],
              -0.1 * 2.0 / (std::sqrt(2.0) + 0.5),
              1e-15);
  // u = 0.5 * 1 + 0.5 * 4, v = 0.75 * 1 + 0.25 * 9; weights 3/4 and 7/16.
  EXPECT_NEAR(StepOf(rule.get(), at(4.0, -3.0))[0],
              -0.1 * (2.5 / 0.75) / (std::pow(3.0 * 16.0 / 7.0, 0.25) + 0.5),
              1e-15);
  // Without the Hessian, momentum alone.
  EXPECT_NEAR(StepOf("adahessian:hessian_power=0:epsilon=1:step_size=1",
                     at(4.0, 7.0))[0],
              -2.0,
              1e-15);
}

TEST(AdaHessian, SeedsGiveOtherSigns) {
  const MatrixXd A = RandomMatrix(20, 20, 1);
  std::vector<VectorXd> diagonals;
  const Linearization at_x =
      WithHessian(VectorXd::Ones(20), A + A.transpose(), &diagonals);
  StepOf("adahessian", at_x);
  StepOf("adahessian", at_x);
  StepOf("adahessian:seed=1", at_x);
  EXPECT_EQ(diagonals[0], diagonals[1]);
  EXPECT_NE(diagonals[0], diagonals[2]);
}

TEST(AdaHessian, RefusesALinearizationWithoutProducts) {
  Linearization at_x;
  at_x.gradient = VectorXd::Ones(2);
  VectorXd step;
  std::string error;
  EXPECT_FALSE(MakeRule("adahessian")->ComputeStep(at_x, &step, &error));
  EXPECT_EQ(error, "adahessian needs products with the Hessian");
}

}  // namespace adahessian_rule_test
}  // namespace invgrad
