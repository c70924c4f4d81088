#include "invgrad/chain/weights_network.h"

#include <cmath>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/model.h"
#include "tests/support/random_matrix.h"
#include "tests/support/real_infidelity.h"

namespace invgrad {
namespace weights_network_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// y = (x0 sin(c x1), x0^2 + x1, exp(x1)), with one context c.
struct Curved {
  template <typename T>
  bool operator()(const T* x, const double* c, T* y) const {
    using std::exp;
    using std::sin;
    y[0] = x[0] * sin(c[0] * x[1]);
    y[1] = x[0] * x[0] + x[1];
    y[2] = exp(x[1]);
    return true;
  }
};

constexpr int kNumSamples = 4;

DataSet Samples() {
  DataSet samples;
  samples.inputs.resize(0, kNumSamples);
  samples.contexts = RandomMatrix(1, kNumSamples, 1);
  samples.targets = RandomMatrix(3, kNumSamples, 2);
  samples.solutions.resize(0, kNumSamples);
  return samples;
}

Model MakeModel(std::shared_ptr<const Loss> loss) {
  return Model(std::make_shared<WeightsNetwork>(2),
               std::make_shared<AutoDiffSimulator<Curved, 2, 3, 1>>(),
               std::move(loss),
               Reduction::kMean);
}

Linearization At(const Model& model,
                 const VectorXd& x,
                 const LinearizationParts& parts) {
  Linearization at_x;
  std::string error;
  EXPECT_TRUE(model.Linearize(x, Samples(), parts, &at_x, &error)) << error;
  return at_x;
}

// A sum over samples that share x, for a squared norm and for a loss that forms
// its Hessian.
TEST(WeightsNetwork, GradientAndHessianAreThoseOfTheCost) {
  for (const std::shared_ptr<const Loss>& loss :
       {std::shared_ptr<const Loss>(std::make_shared<SquaredNormLoss>(3, 0.7)),
        std::shared_ptr<const Loss>(std::make_shared<RealInfidelity<3>>())}) {
    const Model model = MakeModel(loss);
    const Eigen::Vector2d x(0.7, -0.4);
    LinearizationParts all;
    all.gradient = all.jacobian = all.hessian = true;
    const Linearization at_x = At(model, x, all);
    constexpr double kStep = 1e-5;
    for (int i = 0; i < 2; ++i) {
      const VectorXd step = kStep * VectorXd::Unit(2, i);
      const Linearization above =
          At(model, x + step, LinearizationParts::Gradient());
      const Linearization below =
          At(model, x - step, LinearizationParts::Gradient());
      EXPECT_NEAR(
          at_x.gradient[i], (above.cost - below.cost) / (2.0 * kStep), 1e-8);
      EXPECT_LT((at_x.hessian.col(i) -
                 (above.gradient - below.gradient) / (2.0 * kStep))
                    .norm(),
                1e-8);
    }
    VectorXd Jtg;
    at_x.jacobian->TransposeTimes(at_x.loss_gradient, &Jtg);
    EXPECT_LT((Jtg - at_x.gradient).norm(), 1e-14);
    EXPECT_LT(
        (At(model, x, LinearizationParts::Gradient()).gradient - at_x.gradient)
            .norm(),
        1e-14);
  }
}

TEST(WeightsNetwork, BackwardIsTheTransposeOfTangent) {
  const WeightsNetwork network(3);
  const auto pass = network.NewPass();
  const VectorXd weights = RandomMatrix(3, 1, 3);
  std::string error;
  ASSERT_TRUE(network.Forward(weights,
                              MatrixXd(0, 5),
                              Network::Derivatives::kFirst,
                              pass.get(),
                              &error));
  EXPECT_EQ(pass->outputs, weights.replicate(1, 5));
  const VectorXd v = RandomMatrix(3, 1, 4);
  const MatrixXd w = RandomMatrix(3, 5, 5);
  MatrixXd Jv;
  VectorXd Jtw;
  network.Tangent(weights, *pass, v, &Jv);
  network.Backward(weights, *pass, w, &Jtw);
  EXPECT_NEAR(Jtw.dot(v), w.cwiseProduct(Jv).sum(), 1e-14);
}

}  // namespace weights_network_test
}  // namespace invgrad
