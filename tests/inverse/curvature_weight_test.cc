// The curvature weights of chain_pull_back.h.
#include <cmath>
#include <memory>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/linear_simulator.h"
#include "tests/inverse/bend_chain.h"

namespace invgrad {
namespace curvature_weight_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;
using Options = ChainPullBack::Options;

// w_s, from the curvatures of the proxy.
VectorXd SampleWeights(const Model& model, const Linearization& at) {
  const int num_samples = static_cast<int>(at.loss_gradient.size()) / 2;
  const VectorXd curvature =
      at.loss_hessian_times(VectorXd::Ones(2 * num_samples));
  const MatrixXd by_sample = curvature.reshaped(2, num_samples);
  EXPECT_EQ(by_sample.row(0), by_sample.row(1));
  return by_sample.row(0).transpose() / model.BatchScale(num_samples);
}

TEST(CurvatureWeightTest, IsTheFormula) {
  const DataSet data = RandomData();
  const Model model = MakeModel(QuarticLoss());
  const VectorXd weights = RandomWeights(model);
  const MatrixXd x = NetworkOutputs(model, weights, data);
  ChainPullBack unweighted(&model, BendInverse(), Physical());
  const MatrixXd d_x =
      WeightedChange(model, Linearized(&unweighted, weights, data));
  for (const double gamma : {0.25, 0.5, 1.0}) {
    VectorXd powers(kNumSamples);
    for (int s = 0; s < kNumSamples; ++s) {
      Vector2d y = Vector2d::Zero();
      Bend()(x.col(s).data(), y.data());
      const Vector2d d = y - data.targets.col(s);
      const double H_00 = 3.0 * d[0] * d[0] + 1.0;
      const double d_y0 = -(d[0] * d[0] * d[0] + d[0]) / H_00;
      const double curvature =
          (H_00 * d_y0 * d_y0 + 6.0 * d[1] * d[1]) / d_x.col(s).squaredNorm();
      powers[s] = std::pow(curvature, gamma);
    }
    const VectorXd expected = powers / powers.mean();
    ASSERT_GT(expected.maxCoeff() / expected.minCoeff(), 1.2);
    Options options = Physical();
    options.curvature_weight = gamma;
    ChainPullBack chain(&model, BendInverse(), options);
    const Linearization at = Linearized(&chain, weights, data);
    const VectorXd w = SampleWeights(model, at);
    EXPECT_LT((w - expected).norm(), 1e-12);
    EXPECT_NEAR(w.mean(), 1.0, 1e-14);
    EXPECT_LT((WeightedChange(model, at) - d_x * expected.asDiagonal()).norm(),
              1e-12);
  }
}

TEST(CurvatureWeightTest, ZeroIsThePublishedMethodToTheBit) {
  const DataSet data = RandomData();
  const Model model = MakeModel(QuarticLoss());
  const VectorXd weights = RandomWeights(model);
  Options options = Physical();
  ChainPullBack plain(&model, BendInverse(), options);
  options.curvature_weight = 0.0;
  ChainPullBack zero(&model, BendInverse(), options);
  const Linearization a = Linearized(&plain, weights, data);
  const Linearization b = Linearized(&zero, weights, data);
  EXPECT_EQ(a.gradient, b.gradient);
  EXPECT_EQ(SampleWeights(model, b), VectorXd::Ones(kNumSamples));
}

// For a linear P and a quadratic L, and up to the common factor mean(c), the
// weighted proxy |d_x|^2 / 2 is the second-order change of L along d_x.
TEST(CurvatureWeightTest, OneMakesTheProxyFollowTheLoss) {
  MatrixXd A(2, 2);
  A << 3.0, 1.0, -0.5, 0.2;
  const auto linear = std::make_shared<LinearSimulator>(
      LinearSimulator::Matrix(A.sparseView()), Vector2d(0.3, -1.0));
  const Model model = MakeModel(QuarticLoss(), Reduction::kMean, linear);
  const DataSet data = RandomData();
  const VectorXd weights = RandomWeights(model);
  Options options = Physical();
  options.simulator.round_trip = 1e-10;
  options.curvature_weight = 1.0;
  ChainPullBack chain(&model, nullptr, options);
  const Linearization at = Linearized(&chain, weights, data);
  ASSERT_EQ(chain.counts().of(PullBackSource::kNumericalInverse), kNumSamples);
  const VectorXd w = SampleWeights(model, at);
  const MatrixXd d_x =
      WeightedChange(model, at) * w.cwiseInverse().asDiagonal();
  const MatrixXd x = NetworkOutputs(model, weights, data);
  VectorXd ratio(kNumSamples);
  for (int s = 0; s < kNumSamples; ++s) {
    const Vector2d y = A * x.col(s) + Vector2d(0.3, -1.0);
    double loss = 0.0;
    Eigen::Matrix2d H;
    ASSERT_TRUE(model.loss().Evaluate(
        y.data(), data.targets.col(s).data(), &loss, nullptr, H.data()));
    const Vector2d d_y = A * d_x.col(s);
    ratio[s] = w[s] * d_x.col(s).squaredNorm() / d_y.dot(H * d_y);
  }
  EXPECT_LT(ratio.maxCoeff() / ratio.minCoeff() - 1.0, 1e-8);
  EXPECT_GT(w.maxCoeff() / w.minCoeff(), 1.2);
}

// c_s has the unit of L, w_s has none; a sample at its target has no c_s.
TEST(CurvatureWeightTest, DoesNotDependOnTheUnitOfTheLoss) {
  DataSet data = RandomData();
  const Model model = MakeModel(QuarticLoss());
  const VectorXd weights = RandomWeights(model);
  Options options = Physical();
  options.curvature_weight = 0.5;
  for (const bool one_is_done : {false, true}) {
    if (one_is_done) {
      const MatrixXd x = NetworkOutputs(model, weights, data);
      Bend()(x.col(2).data(), data.targets.col(2).data());
    }
    ChainPullBack chain(&model, BendInverse(), options);
    const Linearization at = Linearized(&chain, weights, data);
    const VectorXd w = SampleWeights(model, at);
    EXPECT_NEAR(w.mean(), 1.0, 1e-14);
    if (one_is_done) {
      EXPECT_EQ(w[2], 1.0);
    }
    for (const double unit : {1e-6, 1e6}) {
      const Model scaled = MakeModel(QuarticLoss(unit));
      ChainPullBack other(&scaled, BendInverse(), options);
      const Linearization in_units = Linearized(&other, weights, data);
      EXPECT_LT((SampleWeights(scaled, in_units) - w).norm(), 1e-12);
      EXPECT_LT((in_units.gradient - at.gradient).norm(), 1e-12);
    }
  }
}

// The curvature is that along d_x; a cut does not turn d_x.
TEST(CurvatureWeightTest, DoesNotDependOnTheCut) {
  const DataSet data = RandomData();
  const Model model = MakeModel(QuarticLoss());
  const VectorXd weights = RandomWeights(model);
  Options options = Physical();
  options.curvature_weight = 1.0;
  ChainPullBack whole(&model, BendInverse(), options);
  const VectorXd w = SampleWeights(model, Linearized(&whole, weights, data));
  options.max_change = 0.1;
  ChainPullBack cut(&model, BendInverse(), options);
  EXPECT_LT((SampleWeights(model, Linearized(&cut, weights, data)) - w).norm(),
            1e-12);
}

}  // namespace curvature_weight_test
}  // namespace invgrad
