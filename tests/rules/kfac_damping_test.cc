// The rule kfac: exact for one linear layer, damping, averages, sampled factors.

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "Eigen/Eigenvalues"
#include "Eigen/LU"
#include "gtest/gtest.h"
#include "invgrad/chain/chain_jacobian.h"
#include "invgrad/core/layer_jacobian.h"
#include "invgrad/dense_network.h"
#include "invgrad/internal/layered_jacobian.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/stored_jacobian.h"
#include "tests/rules/layers.h"
#include "tests/rules/step_of.h"
#include "tests/support/least_squares.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace kfac_damping_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// A linear layer in front of a linear simulator, and the loss
// c |y - y*|^2 / 2 with a matrix c.
struct LinearChain {
  int num_samples = 7;
  MatrixXd inputs = RandomMatrix(4, num_samples, 2);
  MatrixXd simulator = RandomMatrix(3, 5, 3);
  MatrixXd c = Positive(RandomMatrix(5, 5, 5));
  VectorXd g = RandomMatrix(5 * num_samples, 1, 4);

  static MatrixXd Positive(const MatrixXd& X) {
    return X * X.transpose() + MatrixXd::Identity(X.rows(), X.rows());
  }
  Linearization At() const {
    Linearization at_x =
        AtNetwork({4, 3}, inputs, simulator.replicate(1, num_samples), g);
    at_x.loss_hessian_times = [c = c](const VectorXd& v) -> VectorXd {
      const auto size = c.rows();
      return (c * v.reshaped(size, v.size() / size)).reshaped();
    };
    return at_x;
  }
};

// J^T H_L J and J^T g of a linearization.
MatrixXd GaussNewton(const Linearization& at_x, VectorXd* gradient) {
  MatrixXd J;
  at_x.jacobian->ToDense(&J);
  MatrixXd curved = J;
  for (int i = 0; i < J.cols(); ++i) {
    curved.col(i) = at_x.loss_hessian_times(J.col(i));
  }
  *gradient = J.transpose() * at_x.loss_gradient;
  return J.transpose() * curved;
}

TEST(Kfac, IsTheGaussNewtonStepOfALinearNetwork) {
  const Linearization at_x = LinearChain().At();
  VectorXd gradient;
  const MatrixXd G = GaussNewton(at_x, &gradient);
  const VectorXd expected = -G.lu().solve(gradient);
  ExpectNear(StepOf("kfac:step_size=1:damping=0", at_x), expected, 1e-9);
  // Which is also the minimizer along it.
  ExpectNear(StepOf("kfac:damping=0", at_x), expected, 1e-9);
  ExpectNear(StepOf("kfac:damping=0:rho=0.5", at_x), 0.5 * expected, 1e-9);
}

// -(A + pi sqrt(lambda))^-p G (D + sqrt(lambda) / pi)^-p by the Kronecker product
// itself.
TEST(Kfac, DampsBothFactors) {
  const Linearization at_x = LinearChain().At();
  VectorXd gradient;
  GaussNewton(at_x, &gradient);
  const auto blocks = ColumnBlocksOf(*at_x.jacobian);
  const auto& layer = dynamic_cast<const LayerJacobian&>(*blocks[0]);
  const LinearChain chain;
  const double lambda = 0.3;
  MatrixXd A = layer.inputs() * layer.inputs().transpose() / 7.0;
  MatrixXd D = 7.0 * chain.simulator * chain.c * chain.simulator.transpose();
  const double pi = std::sqrt((A.trace() / 5.0) / (D.trace() / 3.0));
  A += pi * std::sqrt(lambda) * MatrixXd::Identity(5, 5);
  D += std::sqrt(lambda) / pi * MatrixXd::Identity(3, 3);
  MatrixXd product(15, 15);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) product.block(5 * i, 5 * k, 5, 5) = D(i, k) * A;
  }
  const VectorXd expected = -product.lu().solve(gradient);
  ExpectNear(StepOf("kfac:step_size=1:damping=0.3", at_x), expected, 1e-11);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(product);
  const VectorXd powers = eigen.eigenvalues().array().pow(-0.75);
  ExpectNear(
      StepOf("kfac:step_size=1:damping=0.3:kappa=0.5", at_x),
      -eigen.eigenvectors() *
          powers.cwiseProduct(eigen.eigenvectors().transpose() * gradient),
      1e-11);
  // step_size=auto minimizes the damped model along this direction.
  const MatrixXd B =
      GaussNewton(at_x, &gradient) + lambda * MatrixXd::Identity(15, 15);
  const double eta = -gradient.dot(expected) / expected.dot(B * expected);
  ExpectNear(StepOf("kfac:damping=0.3", at_x), eta * expected, 1e-11);
}

// In the second step e = min(1 - 1/2, decay): the mean of both batches, which is
// that of the batch of both.
TEST(Kfac, AveragesItsFactors) {
  LinearChain first;
  LinearChain second;
  second.inputs = RandomMatrix(4, 7, 12);
  const auto rule = MakeRule("kfac:step_size=1:damping=0");
  StepOf(rule.get(), first.At());
  const VectorXd averaged = StepOf(rule.get(), second.At());

  MatrixXd A = MatrixXd::Zero(5, 5);
  for (const LinearChain* chain : {&first, &second}) {
    MatrixXd with_bias = MatrixXd::Ones(5, 7);
    with_bias.topRows(4) = chain->inputs;
    A += with_bias * with_bias.transpose() / 14.0;
  }
  const MatrixXd D =
      7.0 * first.simulator * first.c * first.simulator.transpose();
  VectorXd gradient;
  GaussNewton(second.At(), &gradient);
  const MatrixXd expected =
      -A.lu().solve(gradient.reshaped(5, 3)) * D.inverse();
  ExpectNear(averaged, expected.reshaped(), 1e-9);
  // Without memory it is the step of the batch alone.
  const std::string text = "kfac:step_size=1:damping=0:decay=0";
  const auto forgetful = MakeRule(text);
  StepOf(forgetful.get(), first.At());
  const VectorXd alone = StepOf(forgetful.get(), second.At());
  EXPECT_EQ(alone, StepOf(text, second.At()));
  ExpectNear(alone, StepOf("kfac:step_size=1:damping=0", second.At()), 1e-12);
}

// The factors of the first step, with the gradient of the second.
TEST(Kfac, KeepsItsFactorsForAnInterval) {
  LinearChain first;
  LinearChain second;
  second.inputs = RandomMatrix(4, 7, 12);
  const auto rule = MakeRule("kfac:step_size=1:damping=0:interval=2");
  StepOf(rule.get(), first.At());
  MatrixXd with_bias = MatrixXd::Ones(5, 7);
  with_bias.topRows(4) = first.inputs;
  const MatrixXd A = with_bias * with_bias.transpose() / 7.0;
  const MatrixXd D =
      7.0 * first.simulator * first.c * first.simulator.transpose();
  VectorXd gradient;
  GaussNewton(second.At(), &gradient);
  const MatrixXd expected =
      -A.lu().solve(gradient.reshaped(5, 3)) * D.inverse();
  ExpectNear(StepOf(rule.get(), second.At()), expected.reshaped(), 1e-9);
}

// The same chain, its J given by products.
Linearization ByProducts(const LinearChain& chain) {
  const auto network =
      std::make_shared<DenseNetwork>(std::vector<int>{4, 3}, Activation::kTanh);
  const VectorXd weights = RandomMatrix(network->num_weights(), 1, 1);
  auto pass = network->NewPass();
  std::string error;
  EXPECT_TRUE(network->Forward(
      weights, chain.inputs, Network::Derivatives::kFirst, pass.get(), &error));
  std::vector<std::unique_ptr<const JacobianOperator>> simulators;
  for (int s = 0; s < chain.num_samples; ++s) {
    simulators.push_back(
        std::make_unique<DenseJacobian>(MatrixXd(chain.simulator.transpose())));
  }
  Linearization at_x = chain.At();
  at_x.jacobian = std::make_shared<ChainJacobian>(
      network, weights, std::move(pass), nullptr, std::move(simulators));
  return at_x;
}

// The mean over random covectors, here 7 samples in 2000 steps, is the exact D.
TEST(Kfac, SampledFactorsTendToTheExactOnes) {
  const LinearChain chain;
  const Linearization at_x = ByProducts(chain);
  for (const std::string text :
       {"kfac:step_size=1:damping=0.3",
        "kfac_half_inverse:damping=0.3:clamp=false:truncation=0"}) {
    const auto rule = MakeRule(text + ":decay=0.99999");
    VectorXd step;
    for (int k = 0; k < 2000; ++k) step = StepOf(rule.get(), at_x);
    const VectorXd exact = StepOf(text, chain.At());
    ExpectNear(step, exact, 0.03);
    EXPECT_GT((step - exact).norm(), 1e-6 * exact.norm());
  }
}

TEST(Kfac, SampledFactorsResumeBitForBit) {
  for (const std::string text : {"kfac", "kfac:interval=3:seed=5"}) {
    LinearChain chain;
    const auto whole = MakeRule(text);
    const auto resumed = MakeRule(text);
    for (int k = 0; k < 6; ++k) {
      chain.inputs = RandomMatrix(4, 7, 20 + k);
      if (k == 2) {
        for (std::size_t i = 0; i < whole->MutableState().size(); ++i) {
          *resumed->MutableState()[i] = *whole->MutableState()[i];
        }
      }
      const VectorXd step = StepOf(whole.get(), ByProducts(chain));
      if (k < 2) continue;
      EXPECT_EQ(StepOf(resumed.get(), ByProducts(chain)), step);
    }
  }
  // The seed decides on the covectors.
  EXPECT_NE(StepOf("kfac", ByProducts({})),
            StepOf("kfac:seed=1", ByProducts({})));
}

// docs/conventions.md, section 3: the damping is in units of the Hessian.
TEST(Kfac, TheUnitOfTheLossIsThatOfTheDamping) {
  LinearChain chain;
  const VectorXd step = StepOf("kfac:step_size=1:damping=0.25", chain.At());
  chain.c *= 16.0;
  chain.g *= 16.0;
  ExpectNear(StepOf("kfac:step_size=1:damping=4", chain.At()), step, 1e-12);
  EXPECT_GT((StepOf("kfac:step_size=1:damping=0.25", chain.At()) - step).norm(),
            1e-3 * step.norm());
}

// A layer with T calls a sample, as in a closed loop.
class LoopJacobian final : public JacobianOperator, public LayeredJacobian {
 public:
  LoopJacobian(MatrixXd inputs, MatrixXd deltas, int num_calls)
      : inputs_(std::move(inputs)),
        deltas_(std::move(deltas)),
        layer_(&inputs_, &deltas_, num_calls) {}
  int rows() const override { return layer_.rows(); }
  int cols() const override { return layer_.cols(); }
  void Times(const VectorXd& v, VectorXd* Jv) const override {
    layer_.Times(v, Jv);
  }
  void TransposeTimes(const VectorXd& w, VectorXd* Jtw) const override {
    layer_.TransposeTimes(w, Jtw);
  }
  std::vector<std::unique_ptr<const JacobianOperator>> ColumnBlocks()
      const override {
    std::vector<std::unique_ptr<const JacobianOperator>> blocks;
    blocks.push_back(std::make_unique<LayerJacobian>(
        &inputs_, &deltas_, layer_.num_calls()));
    return blocks;
  }

 private:
  const MatrixXd inputs_;
  const MatrixXd deltas_;
  const LayerJacobian layer_;
};

// D = sum over calls t of Delta_t H_L Delta_t^T, A the mean over samples and
// calls.
TEST(Kfac, SumsOverTheCallsOfAClosedLoop) {
  constexpr int kSamples = 6;
  constexpr int kCalls = 3;
  constexpr int kRows = 2 * kSamples;
  const MatrixXd inputs = RandomMatrix(4, kSamples * kCalls, 1);
  const MatrixXd deltas = RandomMatrix(3, kRows * kCalls, 2);
  const MatrixXd H = LinearChain::Positive(RandomMatrix(kRows, kRows, 3));
  Linearization at_x;
  at_x.jacobian = std::make_shared<LoopJacobian>(inputs, deltas, kCalls);
  at_x.loss_gradient = RandomMatrix(kRows, 1, 4);
  at_x.loss_hessian_times = [H](const VectorXd& v) -> VectorXd {
    return H * v;
  };
  MatrixXd D = MatrixXd::Zero(3, 3);
  for (int t = 0; t < kCalls; ++t) {
    MatrixXd of_call(3, kRows);
    for (int row = 0; row < kRows; ++row) {
      of_call.col(row) = deltas.col(row * kCalls + t);
    }
    D += of_call * H * of_call.transpose();
  }
  const MatrixXd A = inputs * inputs.transpose() / (kSamples * kCalls);
  VectorXd gradient;
  at_x.jacobian->TransposeTimes(at_x.loss_gradient, &gradient);
  const MatrixXd expected =
      -A.lu().solve(gradient.reshaped(4, 3)) * D.inverse();
  ExpectNear(
      StepOf("kfac:step_size=1:damping=0", at_x), expected.reshaped(), 1e-10);
}

TEST(Kfac, IsADescentDirectionOfEveryNetwork) {
  const Linearization at_x = AtNetwork(kWidths, kBatchSize, kOutputs);
  VectorXd Jd;
  const auto rule = MakeRule("kfac");
  at_x.jacobian->Times(StepOf(rule.get(), at_x), &Jd);
  EXPECT_LT(at_x.loss_gradient.dot(Jd), 0.0);
  EXPECT_EQ(rule->LastStepReport().find("3 layers, rank 47 of 47, step size "),
            0u)
      << rule->LastStepReport();
}

TEST(Kfac, SaysWhatItNeeds) {
  Linearization at_x;
  at_x.loss_gradient = VectorXd::Ones(3);
  at_x.jacobian = std::make_shared<DenseJacobian>(MatrixXd::Ones(3, 4));
  EXPECT_EQ(ErrorOf("kfac", at_x),
            "K-FAC needs the Jacobian of a network's layers, which this "
            "problem does not have; half_inverse and layer_half_inverse work "
            "with any Jacobian");
}

// With fewer samples than inputs A is singular.
TEST(Kfac, WithoutDampingLeavesOutWhatHasNoCurvature) {
  constexpr int kSamples = 2;
  MatrixXd with_bias = MatrixXd::Ones(5, kSamples);
  with_bias.topRows(4) = RandomMatrix(4, kSamples, 2);
  const Linearization at_x = AtNetwork({4, 3},
                                       with_bias.topRows(4),
                                       RandomMatrix(3, 4 * kSamples, 3),
                                       RandomMatrix(4 * kSamples, 1, 4));
  VectorXd gradient;
  at_x.jacobian->TransposeTimes(at_x.loss_gradient, &gradient);
  const auto blocks = ColumnBlocksOf(*at_x.jacobian);
  const auto& layer = dynamic_cast<const LayerJacobian&>(*blocks[0]);
  const MatrixXd D = layer.deltas() * layer.deltas().transpose();
  const MatrixXd A = with_bias * with_bias.transpose() / kSamples;
  const MatrixXd expected =
      -LeastSquares(A, gradient.reshaped(5, 3)) * D.inverse();
  ExpectNear(
      StepOf("kfac:step_size=1:damping=0", at_x), expected.reshaped(), 1e-9);
}

}  // namespace kfac_damping_test
}  // namespace invgrad
