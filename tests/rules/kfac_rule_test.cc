// kfac_half_inverse: exact in each layer up to its Kronecker factors.

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/Eigenvalues"
#include "gtest/gtest.h"
#include "invgrad/core/layer_jacobian.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/linearization.h"
#include "invgrad/spectral.h"
#include "invgrad/stored_jacobian.h"
#include "tests/rules/layers.h"
#include "tests/rules/step_of.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace kfac_rule_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// f(K) grad with the eigenvalues lambda = s^2 of the Kronecker product K itself,
// f(lambda) = phi(s) / s. Both sides are those of some K + E, |E| <= 2 n eps |K|
// (products and eigenvalues of n x n matrices are backward stable). In K's
// eigenvectors that changes the step by sum_k f[i, k] E_ik grad_k, to first
// order, f[i, k] = (f_i - f_k) / (lambda_i - lambda_k) (Daleckii and Krein);
// f[i, i] = f'(lambda_i), which is at most 3/4 f_i / lambda_i.
TEST(KfacHalfInverse, IsTheFilterOfTheKroneckerProduct) {
  const Linearization at_x = AtNetwork(kWidths, kBatchSize, kOutputs);
  const auto blocks = ColumnBlocksOf(*at_x.jacobian);
  ASSERT_EQ(blocks.size(), kWidths.size() - 1);
  for (const bool clamp : {false, true}) {
    const SpectralFilter filter = [clamp] {
      SpectralFilter power = SpectralFilter::Power(0.5, 0.1);
      power.clamp = clamp;
      return power;
    }();
    VectorXd expected(at_x.jacobian->cols());
    double squared_bound = 0.0;
    int column = 0;
    for (const auto& block : blocks) {
      const auto& layer = dynamic_cast<const LayerJacobian&>(*block);
      const MatrixXd A = layer.inputs() * layer.inputs().transpose();
      const MatrixXd D = layer.deltas() * layer.deltas().transpose();
      MatrixXd product(layer.cols(), layer.cols());
      for (Eigen::Index i = 0; i < D.rows(); ++i) {
        for (Eigen::Index k = 0; k < D.rows(); ++k) {
          product.block(i * A.rows(), k * A.rows(), A.rows(), A.rows()) =
              D(i, k) / kBatchSize * A;
        }
      }
      const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(product);
      const VectorXd s = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt();
      VectorXd gradient;
      layer.TransposeTimes(at_x.loss_gradient, &gradient);
      const VectorXd g = eigen.eigenvectors().transpose() * gradient;
      const int n = layer.cols();
      VectorXd f(n);
      for (int i = 0; i < n; ++i) f[i] = filter(s[i], s.maxCoeff()) / s[i];
      expected.segment(column, n) = -eigen.eigenvectors() * f.cwiseProduct(g);
      const VectorXd lambda = s.cwiseAbs2();
      const double E = 4.0 * n * kEpsilon * lambda.maxCoeff();
      for (int i = 0; i < n; ++i) {
        double change = 0.75 * f[i] / lambda[i] * std::abs(g[i]);
        for (int k = 0; k < n; ++k) {
          if (k == i) continue;
          change += std::abs((f[i] - f[k]) / (lambda[i] - lambda[k]) * g[k]);
        }
        squared_bound += std::pow(E * change, 2);
      }
      column += n;
    }
    const VectorXd step =
        StepOf(std::string("kfac_half_inverse:truncation=0.1:clamp=") +
                   (clamp ? "true" : "false"),
               at_x);
    ASSERT_EQ(step.size(), expected.size());
    const double bound = std::sqrt(squared_bound);
    EXPECT_LE((step - expected).norm(), bound);
    EXPECT_LE(bound, 1e-8 * expected.norm()) << "The bound tests nothing.";
  }
}

TEST(KfacHalfInverse, IsExactForOneSampleWithOneOutput) {
  const Linearization at_x = AtNetwork(kWidths, 1, 1);
  for (const std::string settings : {"", ":kappa=1", ":step_size=auto"}) {
    ExpectNear(StepOf("kfac_half_inverse" + settings, at_x),
               StepOf("layer_half_inverse" + settings, at_x),
               1e-13);
  }
}

// J_l^T J_l = D (x) sum_s a_s a_s^T where the simulator is linear.
TEST(KfacHalfInverse, IsExactForALinearLayerAndALinearSimulator) {
  constexpr int kNumSamples = 7;
  const MatrixXd inputs = RandomMatrix(4, kNumSamples, 2);
  const MatrixXd simulator = RandomMatrix(3, 5, 3);
  const VectorXd g = RandomMatrix(5 * kNumSamples, 1, 4);
  const Linearization at_x =
      AtNetwork({4, 3}, inputs, simulator.replicate(1, kNumSamples), g);
  for (const std::string settings : {":kappa=0.5:truncation=1e-6:clamp=false",
                                     ":kappa=1:truncation=1e-6:clamp=false"}) {
    ExpectNear(StepOf("kfac_half_inverse" + settings, at_x),
               StepOf("power" + settings, at_x),
               1e-10);
  }
  // And not where its Jacobian differs from sample to sample.
  const Linearization curved =
      AtNetwork({4, 3}, inputs, RandomMatrix(3, 5 * kNumSamples, 3), g);
  const VectorXd joint = StepOf("half_inverse", curved);
  EXPECT_GT((StepOf("kfac_half_inverse", curved) - joint).norm(),
            0.01 * joint.norm());
}

// One rule with two sets of defaults.
TEST(KfacHalfInverse, IsKfacWithOtherSettings) {
  const Linearization at_x = AtNetwork(kWidths, kBatchSize, kOutputs);
  EXPECT_EQ(StepOf("kfac:step_size=1:kappa=0.5:truncation=1e-3:clamp=true:"
                   "damping=0:metric=identity:decay=0",
                   at_x),
            StepOf("kfac_half_inverse", at_x));
}

// [1] of kfac_rule.cc, section 10: an affine change of a layer's inputs, which
// its weights undo, does not change what a step of kappa = 1 does to the
// network's outputs. That of another kappa it does.
TEST(KfacHalfInverse, FullStepsDoNotDependOnTheBasisOfTheInputs) {
  constexpr int kNumSamples = 9;
  const MatrixXd inputs = RandomMatrix(3, kNumSamples, 2);
  const MatrixXd simulator = RandomMatrix(2, 2 * kNumSamples, 3);
  const VectorXd g = RandomMatrix(2 * kNumSamples, 1, 4);
  const MatrixXd mixed =
      (RandomMatrix(3, 3, 5) * inputs).colwise() + RandomMatrix(3, 1, 6).col(0);
  const Linearization at_x = AtNetwork({3, 2}, inputs, simulator, g);
  const Linearization at_mixed = AtNetwork({3, 2}, mixed, simulator, g);
  const auto change = [](const std::string& text, const Linearization& at) {
    VectorXd Jd;
    at.jacobian->Times(StepOf(text, at), &Jd);
    return Jd;
  };
  const std::string full = "kfac_half_inverse:kappa=1:truncation=1e-6";
  ExpectNear(change(full, at_mixed), change(full, at_x), 1e-10);
  const std::string half = "kfac_half_inverse";
  EXPECT_GT((change(half, at_mixed) - change(half, at_x)).norm(),
            0.01 * change(half, at_x).norm());
}

// Squares of the factors over- and underflow; the step does not.
TEST(KfacHalfInverse, FactorsOfAnySizeWillDo) {
  const int m = kBatchSize * kOutputs;
  const MatrixXd inputs = RandomMatrix(kWidths.front(), kBatchSize, 2);
  const MatrixXd simulator = RandomMatrix(kWidths.back(), m, 3);
  const VectorXd g = RandomMatrix(m, 1, 4);
  const std::string text = "kfac_half_inverse:kappa=1:truncation=1e-3";
  const VectorXd step = StepOf(text, AtNetwork(kWidths, inputs, simulator, g));
  for (const double c : {0x1p-600, 0x1p+600}) {
    ExpectNear(c * StepOf(text, AtNetwork(kWidths, inputs, c * simulator, g)),
               step,
               1e-12);
  }
}

TEST(KfacHalfInverse, RefusesAJacobianWithoutLayers) {
  Linearization at_x;
  at_x.loss_gradient = VectorXd::Ones(3);
  at_x.jacobian = std::make_shared<DenseJacobian>(MatrixXd::Ones(3, 4));
  const std::string error = ErrorOf("kfac_half_inverse", at_x);
  EXPECT_EQ(
      error,
      "K-FAC needs the Jacobian of a network's layers, which this problem "
      "does not have; half_inverse and layer_half_inverse work with any "
      "Jacobian");
  // Parameter blocks are not layers.
  at_x.jacobian = std::make_shared<DenseJacobian>(MatrixXd::Ones(3, 4),
                                                  std::vector<int>{2, 2});
  EXPECT_EQ(ErrorOf("kfac_half_inverse", at_x), error);
}

}  // namespace kfac_rule_test
}  // namespace invgrad
