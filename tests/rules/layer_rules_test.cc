// The rules that treat a network layer by layer: layer_half_inverse, exact in
// each layer, and kfac_half_inverse, with Kronecker factors.

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/SVD"
#include "gtest/gtest.h"
#include "invgrad/core/layer_jacobian.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/linearization.h"
#include "invgrad/rules.h"
#include "invgrad/stored_jacobian.h"
#include "tests/rules/layers.h"
#include "tests/rules/step_of.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace layer_rules_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

const char* const kLayerRules[] = {"layer_half_inverse", "kfac_half_inverse"};

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
