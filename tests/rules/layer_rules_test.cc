// The rules that treat a network layer by layer: layer_half_inverse, exact in
// each layer, and kfac_half_inverse, with Kronecker factors.
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "Eigen/Eigenvalues"
#include "Eigen/SVD"
#include "gtest/gtest.h"
#include "invgrad/chain/network_jacobian.h"
#include "invgrad/core/layer_jacobian.h"
#include "invgrad/rules/rules.h"
#include "invgrad/spectral/spectral_filter.h"

namespace invgrad {
namespace layer_rules_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

MatrixXd RandomMatrix(int rows, int cols, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  return MatrixXd::NullaryExpr(
      rows, cols, [&](Eigen::Index) { return uniform(generator); });
}

// A network at random weights in front of simulators with the given Jacobians.
Linearization AtNetwork(const std::vector<int>& widths,
                        const MatrixXd& inputs,
                        MatrixXd simulator_jacobians,
                        VectorXd g) {
  const DenseNetwork network(widths, Activation::kTanh);
  const VectorXd weights = RandomMatrix(network.num_weights(), 1, 1);
  DenseNetwork::Activations activations;
  network.Forward(weights, inputs, false, &activations);
  Linearization at_x;
  at_x.loss_gradient = std::move(g);
  at_x.jacobian = std::make_shared<NetworkJacobian>(
      network, weights, activations, std::move(simulator_jacobians));
  return at_x;
}

Linearization AtNetwork(const std::vector<int>& widths,
                        int batch_size,
                        int outputs_per_sample) {
  const int m = batch_size * outputs_per_sample;
  return AtNetwork(widths,
                   RandomMatrix(widths.front(), batch_size, 2),
                   RandomMatrix(widths.back(), m, 3),
                   RandomMatrix(m, 1, 4));
}

VectorXd StepOf(const std::string& text, const Linearization& at_x) {
  VectorXd step;
  std::string error;
  EXPECT_TRUE(MakeRule(text)->ComputeStep(at_x, &step, &error)) << error;
  return step;
}

std::string ErrorOf(const std::string& text, const Linearization& at_x) {
  VectorXd step;
  std::string error;
  EXPECT_FALSE(MakeRule(text)->ComputeStep(at_x, &step, &error));
  return error;
}

void ExpectNear(const VectorXd& actual,
                const VectorXd& expected,
                double tolerance) {
  ASSERT_EQ(actual.size(), expected.size());
  EXPECT_LE((actual - expected).norm(), tolerance * expected.norm());
}

const char* const kLayerRules[] = {"layer_half_inverse", "kfac_half_inverse"};

// Layers with fewer and with more weights than J has rows: 12, 20 and 15
// against 16.
const std::vector<int> kWidths = {2, 4, 4, 3};
constexpr int kBatchSize = 8;
constexpr int kOutputs = 2;

// -V s^-kappa U^T g of each layer's columns, s > tau s_max.
TEST(LayerHalfInverse, IsTheFilteredSvdOfEachLayersColumns) {
  const Linearization at_x = AtNetwork(kWidths, kBatchSize, kOutputs);
  MatrixXd J;
  at_x.jacobian->ToDense(&J);
  for (const double kappa : {0.5, 0.75}) {
    const double tau = 0.05;
    VectorXd expected(J.cols());
    int column = 0;
    int num_dropped = 0;
    for (std::size_t l = 0; l + 1 < kWidths.size(); ++l) {
      const int size = (kWidths[l] + 1) * kWidths[l + 1];
      const Eigen::JacobiSVD<MatrixXd> svd(
          J.middleCols(column, size),
          Eigen::ComputeThinU | Eigen::ComputeThinV);
      VectorXd filtered = svd.matrixU().transpose() * at_x.loss_gradient;
      for (Eigen::Index i = 0; i < filtered.size(); ++i) {
        const double s = svd.singularValues()[i];
        const bool keeps = s > tau * svd.singularValues()[0];
        num_dropped += keeps ? 0 : 1;
        filtered[i] *= keeps ? std::pow(s, -kappa) : 0.0;
      }
      expected.segment(column, size) = -svd.matrixV() * filtered;
      column += size;
    }
    EXPECT_GT(num_dropped, 0) << "The truncation was not put to the test.";
    // The Gram routes are good to epsilon / tau^2.
    ExpectNear(StepOf("layer_half_inverse:truncation=0.05:kappa=" +
                          std::to_string(kappa),
                      at_x),
               expected,
               1e-12);
  }
}

TEST(LayerHalfInverse, IsTheJointStepOfANetworkOfOneLayer) {
  for (const int batch_size : {3, 12}) {
    const Linearization at_x = AtNetwork({4, 3}, batch_size, 2);
    for (const std::string settings :
         {":truncation=1e-3", ":truncation=1e-3:step_size=auto"}) {
      EXPECT_EQ(StepOf("layer_half_inverse:route=svd" + settings, at_x),
                StepOf("half_inverse:route=svd" + settings, at_x));
      ExpectNear(StepOf("layer_half_inverse" + settings, at_x),
                 StepOf("half_inverse" + settings, at_x),
                 1e-10);
    }
  }
}

// Of a matrix without blocks, and of a matrix whose blocks are orthogonal to
// each other, which no layer can tell from a joint one but by s_max.
TEST(LayerHalfInverse, IsTheJointStepWhereNothingCouplesTheBlocks) {
  Linearization at_x;
  at_x.loss_gradient = RandomMatrix(6, 1, 4);
  const MatrixXd J = RandomMatrix(6, 5, 3);
  at_x.jacobian = std::make_shared<DenseJacobian>(J);
  const VectorXd joint = StepOf("half_inverse", at_x);
  EXPECT_EQ(StepOf("layer_half_inverse", at_x), joint);

  MatrixXd diagonal = MatrixXd::Zero(6, 5);
  diagonal.topLeftCorner(2, 2) = J.topLeftCorner(2, 2);
  diagonal.bottomRightCorner(4, 3) = J.bottomRightCorner(4, 3);
  // A block without columns is a parameter block that cannot move.
  at_x.jacobian =
      std::make_shared<DenseJacobian>(diagonal, std::vector<int>{2, 0, 3});
  ExpectNear(
      StepOf("layer_half_inverse", at_x), StepOf("half_inverse", at_x), 1e-12);
  at_x.jacobian = std::make_shared<SparseJacobian>(diagonal.sparseView(),
                                                   std::vector<int>{2, 0, 3});
  ExpectNear(
      StepOf("layer_half_inverse", at_x), StepOf("half_inverse", at_x), 1e-12);
  // Coupled blocks do not give the joint step.
  at_x.jacobian = std::make_shared<DenseJacobian>(J, std::vector<int>{2, 3});
  EXPECT_GT((StepOf("layer_half_inverse", at_x) - joint).norm(),
            0.1 * joint.norm());
}

// f(K) grad with the eigenvalues lambda = s^2 of the Kronecker product K itself,
// f(lambda) = phi(s) / s. Both sides are those of some K + E, |E| <= 2 n eps |K|
// (products and eigenvalues of n x n matrices are backward stable). In K's
// eigenvectors that changes the step by sum_k f[i, k] E_ik grad_k, to first
// order, f[i, k] = (f_i - f_k) / (lambda_i - lambda_k) (Daleckii and Krein);
// f[i, i] = f'(lambda_i), which is at most 3/4 f_i / lambda_i.
TEST(KfacHalfInverse, IsTheFilterOfTheKroneckerProduct) {
  const Linearization at_x = AtNetwork(kWidths, kBatchSize, kOutputs);
  const auto blocks = at_x.jacobian->ColumnBlocks();
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

// [1] of kfac_rule.h, section 10: an affine change of a layer's inputs, which
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

TEST(LayerRules, KappaMinusOneIsGradientDescent) {
  const Linearization at_x = AtNetwork(kWidths, kBatchSize, kOutputs);
  VectorXd gradient;
  at_x.jacobian->TransposeTimes(at_x.loss_gradient, &gradient);
  for (const std::string name : kLayerRules) {
    ExpectNear(StepOf(name + ":kappa=-1:truncation=0:step_size=0.1", at_x),
               -0.1 * gradient,
               1e-14);
  }
  // phi(s) / s = 1: also through the factorizations, where nothing is dropped
  // but directions that the gradient has no part in.
  ExpectNear(
      StepOf("kfac_half_inverse:kappa=-1:truncation=1e-7:clamp=false", at_x),
      -gradient,
      1e-7);
}

// (g, J) -> c (g, J) multiplies the step by c^(1 - kappa), and an orthogonal
// change of each sample's outputs does nothing.
TEST(LayerRules, ChangesOfTheOutputs) {
  const double c = 7.0;
  const int m = kBatchSize * kOutputs;
  const MatrixXd inputs = RandomMatrix(kWidths.front(), kBatchSize, 2);
  const MatrixXd simulator = RandomMatrix(kWidths.back(), m, 3);
  const VectorXd g = RandomMatrix(m, 1, 4);
  const Linearization at_x = AtNetwork(kWidths, inputs, simulator, g);
  const Linearization scaled = AtNetwork(kWidths, inputs, c * simulator, c * g);
  MatrixXd turned_simulator(simulator.rows(), m);
  VectorXd turned_g(m);
  for (int s = 0; s < kBatchSize; ++s) {
    Eigen::Matrix2d turn;
    turn << std::cos(s), std::sin(s), -std::sin(s), std::cos(s);
    turned_simulator.middleCols<2>(2 * s) =
        simulator.middleCols<2>(2 * s) * turn.transpose();
    turned_g.segment<2>(2 * s) = turn * g.segment<2>(2 * s);
  }
  const Linearization turned =
      AtNetwork(kWidths, inputs, turned_simulator, turned_g);
  for (const std::string name : kLayerRules) {
    for (const double kappa : {0.5, 1.0}) {
      SCOPED_TRACE(name + " " + std::to_string(kappa));
      const std::string text =
          name + ":truncation=1e-2:kappa=" + std::to_string(kappa);
      const VectorXd step = StepOf(text, at_x);
      ExpectNear(StepOf(text, scaled), std::pow(c, 1.0 - kappa) * step, 1e-11);
      ExpectNear(StepOf(text, turned), step, 1e-11);
      const std::string automatic = text + ":step_size=auto";
      ExpectNear(StepOf(automatic, scaled), StepOf(automatic, at_x), 1e-11);
    }
  }
}

// A layer that cannot move the outputs stays where it is.
TEST(LayerRules, DeadLayersStandStill) {
  Linearization at_x = AtNetwork({2, 3}, kBatchSize, kOutputs);
  const int m = at_x.jacobian->rows();
  const Linearization dead = AtNetwork({2, 3},
                                       RandomMatrix(2, kBatchSize, 2),
                                       MatrixXd::Zero(3, m),
                                       at_x.loss_gradient);
  for (const std::string name : kLayerRules) {
    EXPECT_TRUE(StepOf(name, dead).isZero(0.0)) << name;
  }
}

TEST(LayerRules, JacobiansThatAreNotFiniteAreRefused) {
  const int m = kBatchSize * kOutputs;
  MatrixXd simulator = RandomMatrix(kWidths.back(), m, 3);
  simulator(1, 2) = kNaN;
  const Linearization at_x =
      AtNetwork(kWidths,
                RandomMatrix(kWidths.front(), kBatchSize, 2),
                simulator,
                RandomMatrix(m, 1, 4));
  EXPECT_EQ(ErrorOf("kfac_half_inverse", at_x),
            "J^T g is not finite: entry 0 is nan");
  EXPECT_NE(ErrorOf("layer_half_inverse", at_x).find("columns from 0: "),
            std::string::npos);
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

TEST(LayerRules, StepsAreDeterministic) {
  const Linearization at_x = AtNetwork(kWidths, kBatchSize, kOutputs);
  for (const std::string name : kLayerRules) {
    const std::unique_ptr<UpdateRule> rule = MakeRule(name);
    VectorXd first;
    VectorXd second;
    std::string error;
    ASSERT_TRUE(rule->ComputeStep(at_x, &first, &error)) << error;
    ASSERT_TRUE(rule->ComputeStep(at_x, &second, &error)) << error;
    EXPECT_EQ(first, second) << name;
    EXPECT_EQ(first, StepOf(name, at_x)) << name;
  }
}

TEST(LayerRules, ReportsSayWhatWasDone) {
  const Linearization at_x = AtNetwork(kWidths, kBatchSize, kOutputs);
  const auto report = [&](const std::string& text) {
    const std::unique_ptr<UpdateRule> rule = MakeRule(text);
    VectorXd step;
    std::string error;
    EXPECT_TRUE(rule->ComputeStep(at_x, &step, &error)) << error;
    return rule->LastStepReport();
  };
  EXPECT_EQ(report("layer_half_inverse:truncation=1e-3"),
            "route gram 3, rank 40 of 43");
  EXPECT_EQ(report("kfac_half_inverse:truncation=1e-3"),
            "3 layers, rank 47 of 47");
  EXPECT_EQ(report("kfac_half_inverse:kappa=-1:truncation=0"), "3 layers");
}

}  // namespace layer_rules_test
}  // namespace invgrad
