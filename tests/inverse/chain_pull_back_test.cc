#include "invgrad/inverse/chain_pull_back.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/chain/autodiff_loss.h"
#include "invgrad/chain/autodiff_simulator.h"
#include "invgrad/chain/linear_simulator.h"
#include "invgrad/chain/parallel_samples.h"
#include "invgrad/inverse/pull_back_counts.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;
using ConstVectorRef = InverseSimulator::ConstVectorRef;
using Options = ChainPullBack::Options;

// y = (exp x0, x1 + x0^2), for x0 < 5 only.
struct Bend {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::exp;
    if (!(x[0] < T(5.0))) return false;
    y[0] = exp(x[0]);
    y[1] = x[1] + x[0] * x[0];
    return true;
  }
};

// x = (log y0, y1 - log^2 y0), refused where y0 <= 0.
std::optional<VectorXd> InvertBend(const ConstVectorRef& y,
                                   const ConstVectorRef& /*x_now*/) {
  if (!(y[0] > 0.0)) return std::nullopt;
  const double x0 = std::log(y[0]);
  return Vector2d(x0, y[1] - x0 * x0);
}

// L = scale (d0^4 / 4 + d0^2 / 2 + 3 d1^2), d = y - y*: its curvature differs
// from sample to sample.
struct Quartic {
  template <typename T>
  bool operator()(const T* y, const double* target, T* loss) const {
    const T d0 = y[0] - target[0];
    const T d1 = y[1] - target[1];
    *loss = scale * (0.25 * d0 * d0 * d0 * d0 + 0.5 * d0 * d0 + 3.0 * d1 * d1);
    return true;
  }
  double scale = 1.0;
};

std::shared_ptr<const Loss> QuarticLoss(double scale = 1.0) {
  return std::make_shared<AutoDiffLoss<Quartic, 2>>(Quartic{scale});
}

constexpr int kNumSamples = 5;

std::shared_ptr<const Simulator> BendSimulator() {
  return std::make_shared<AutoDiffSimulator<Bend, 2, 2>>();
}

Model MakeModel(std::shared_ptr<const Loss> loss,
                Reduction reduction = Reduction::kMean,
                std::shared_ptr<const Simulator> simulator = BendSimulator()) {
  return Model(DenseNetwork({3, 4, 2}, Activation::kTanh),
               std::move(simulator),
               std::move(loss),
               reduction);
}

DataSet RandomData(int num_samples = kNumSamples) {
  DataSet data;
  data.inputs = RandomMatrix(3, num_samples, 11);
  data.contexts.resize(0, num_samples);
  data.solutions = RandomMatrix(2, num_samples, 12);
  data.targets.resize(2, num_samples);
  for (int s = 0; s < num_samples; ++s) {
    Bend()(data.solutions.col(s).data(), data.targets.col(s).data());
  }
  return data;
}

VectorXd RandomWeights(const Model& model) {
  return RandomMatrix(model.num_weights(), 1, 14);
}

std::shared_ptr<const InverseSimulator> BendInverse() {
  return Inverse(InvertBend);
}

Options Ways(LossWay loss, SimulatorWay simulator) {
  Options options;
  options.loss = loss;
  options.simulator.way = simulator;
  return options;
}

Options Physical() { return Ways(LossWay::kNewton, SimulatorWay::kInverse); }

LinearizationParts AllParts() {
  LinearizationParts parts;
  parts.gradient = parts.jacobian = parts.hessian = true;
  return parts;
}

Linearization Linearized(ChainPullBack* chain,
                         const VectorXd& weights,
                         const DataSet& data) {
  Linearization at;
  std::string error;
  EXPECT_TRUE(chain->Linearize(weights, data, AllParts(), &at, &error))
      << error;
  return at;
}

// x of all samples.
MatrixXd NetworkOutputs(const Model& model,
                        const VectorXd& weights,
                        const DataSet& data) {
  DenseNetwork::Activations activations;
  std::string error;
  EXPECT_TRUE(model.Forward(weights, data, false, &activations, &error));
  return activations.outputs;
}

// The d_x of every sample, from g = -scale d_x (L2).
MatrixXd WeightedChange(const Model& model, const Linearization& at) {
  const int num_samples = static_cast<int>(at.loss_gradient.size()) / 2;
  return at.loss_gradient.reshaped(2, num_samples) /
         -model.BatchScale(num_samples);
}

// The gradient of a function of the weights by central differences: h^2 and
// rounding leave 1e-9.
template <typename Function>
VectorXd Differences(const Function& function, const VectorXd& weights) {
  const double h = 1e-5;
  VectorXd gradient(weights.size());
  for (Eigen::Index i = 0; i < weights.size(); ++i) {
    const VectorXd e = h * VectorXd::Unit(weights.size(), i);
    gradient[i] = (function(weights + e) - function(weights - e)) / (2.0 * h);
  }
  return gradient;
}

// --- The adjoint ---

TEST(ChainPullBackTest, GradientAndAdjointAreTheModelsGradient) {
  const DataSet data = RandomData();
  for (const Reduction reduction : {Reduction::kMean, Reduction::kSum}) {
    for (const auto& loss : {QuarticLoss(),
                             std::shared_ptr<const Loss>(
                                 std::make_shared<SquaredNormLoss>(2, 1.5))}) {
      const Model model = MakeModel(loss, reduction);
      const VectorXd weights = RandomWeights(model);
      Linearization expected;
      std::string error;
      ASSERT_TRUE(
          model.Linearize(weights, data, AllParts(), &expected, &error));
      for (const double eta : {1.0, 0.3}) {
        Options options = Ways(LossWay::kGradient, SimulatorWay::kAdjoint);
        options.y_step_size = eta;
        ChainPullBack chain(&model, nullptr, options);
        const Linearization at = Linearized(&chain, weights, data);
        EXPECT_NEAR(at.cost, expected.cost, 1e-13 * expected.cost);
        EXPECT_LT((at.gradient - eta * expected.gradient).norm(),
                  1e-13 * expected.gradient.norm());
        EXPECT_EQ(chain.counts().of(PullBackSource::kDerivative), kNumSamples);
        EXPECT_EQ(chain.counts().Report(), "");
      }
    }
  }
}

// --- The proxy ---

class ProxyTest : public testing::TestWithParam<ChainPullBack::Proxy> {};

TEST_P(ProxyTest, DerivativesAreThoseWithTheWantedInputHeld) {
  const bool is_l2 = GetParam() == ChainPullBack::Proxy::kL2;
  const DataSet data = RandomData();
  for (const Reduction reduction : {Reduction::kMean, Reduction::kSum}) {
    const Model model = MakeModel(QuarticLoss(), reduction);
    const double scale = model.BatchScale(kNumSamples);
    const VectorXd weights = RandomWeights(model);
    Options options = Physical();
    options.proxy = GetParam();
    options.y_step_size = 0.4;
    ChainPullBack chain(&model, BendInverse(), options);
    const Linearization at = Linearized(&chain, weights, data);
    ASSERT_EQ(chain.counts().of(PullBackSource::kInverse), kNumSamples);

    // x~ = P^-1(y - eta H_L^-1 g), by hand.
    const MatrixXd x = NetworkOutputs(model, weights, data);
    MatrixXd wanted(2, kNumSamples);
    for (int s = 0; s < kNumSamples; ++s) {
      Vector2d y = Vector2d::Zero();
      Bend()(x.col(s).data(), y.data());
      const Vector2d d = y - data.targets.col(s);
      y[0] -= 0.4 * (d[0] * d[0] * d[0] + d[0]) / (3.0 * d[0] * d[0] + 1.0);
      y[1] -= 0.4 * d[1];
      VectorXd solution;
      std::string why;
      ASSERT_TRUE(InvertBend(y, x.col(s), VectorXd(), &solution, &why)) << why;
      wanted.col(s) = solution;
    }
    // The kinks of the L1 proxy are far.
    ASSERT_GT((wanted - x).cwiseAbs().minCoeff(), 1e-3);

    const auto proxy = [&](const VectorXd& theta) {
      const MatrixXd d = NetworkOutputs(model, theta, data) - wanted;
      return scale * (is_l2 ? 0.5 * d.squaredNorm() : d.cwiseAbs().sum());
    };
    EXPECT_LT((at.gradient - Differences(proxy, weights)).norm(), 1e-8);

    // J, g and H_L of what comes after x.
    MatrixXd J;
    at.jacobian->ToDense(&J);
    ASSERT_EQ(J.rows(), 2 * kNumSamples);
    for (int row = 0; row < J.rows(); ++row) {
      const auto output = [&](const VectorXd& theta) {
        return NetworkOutputs(model, theta, data).reshaped()[row];
      };
      EXPECT_LT((J.row(row).transpose() - Differences(output, weights)).norm(),
                1e-8);
    }
    EXPECT_LT((J.transpose() * at.loss_gradient - at.gradient).norm(), 1e-14);
    const MatrixXd d = x - wanted;
    const VectorXd g =
        scale * (is_l2 ? d : MatrixXd(d.array().sign())).reshaped();
    EXPECT_LT((at.loss_gradient - g).norm(), 1e-14);
    const VectorXd v = RandomMatrix(2 * kNumSamples, 1, 15);
    const VectorXd Hv = at.loss_hessian_times(v);
    EXPECT_EQ(Hv, (is_l2 ? scale : 0.0) * v);

    // The exact Hessian: differences of the gradients of later linearizations
    // towards the same x~.
    options.updates_per_evaluation = 2;
    ChainPullBack again(&model, BendInverse(), options);
    Linearized(&again, weights, data);
    const double h = 1e-5;
    for (int i = 0; i < weights.size(); ++i) {
      const VectorXd e = h * VectorXd::Unit(weights.size(), i);
      Linearization above;
      Linearization below;
      std::string error;
      ASSERT_TRUE(
          again.LinearizeAgain(weights + e, data, AllParts(), &above, &error));
      ASSERT_TRUE(
          again.LinearizeAgain(weights - e, data, AllParts(), &below, &error));
      const VectorXd column = (above.gradient - below.gradient) / (2.0 * h);
      EXPECT_LT((at.hessian.col(i) - column).norm(), 1e-8);
    }
  }
}

TEST_P(ProxyTest, LaterUpdatesMoveTowardsTheSameInput) {
  const bool is_l2 = GetParam() == ChainPullBack::Proxy::kL2;
  const DataSet data = RandomData();
  const Model model = MakeModel(QuarticLoss());
  const VectorXd weights = RandomWeights(model);
  Options options = Physical();
  options.proxy = GetParam();
  options.updates_per_evaluation = 3;
  options.curvature_weight = 0.5;
  ChainPullBack chain(&model, BendInverse(), options);
  EXPECT_EQ(chain.updates_per_evaluation(), 3);
  const Linearization first = Linearized(&chain, weights, data);
  double loss = 0.0;
  std::string error;
  ASSERT_TRUE(model.Cost(weights, data, &loss, &error));
  EXPECT_NEAR(first.cost, loss, 1e-14);

  // At the same weights all is as before, but for the cost.
  Linearization again;
  ASSERT_TRUE(chain.LinearizeAgain(weights, data, AllParts(), &again, &error));
  EXPECT_LT((again.gradient - first.gradient).norm(), 1e-14);
  EXPECT_LT((again.hessian - first.hessian).norm(), 1e-13);
  EXPECT_GT(std::abs(again.cost - loss), 1e-3);

  // Elsewhere it is the value, and the gradient, of the same proxy.
  const VectorXd elsewhere = weights + 0.1 * RandomMatrix(weights.size(), 1, 3);
  const auto proxy = [&](const VectorXd& theta) {
    Linearization at;
    EXPECT_TRUE(
        chain.LinearizeAgain(theta, data, LinearizationParts(), &at, &error));
    return at.cost;
  };
  ASSERT_TRUE(
      chain.LinearizeAgain(elsewhere, data, AllParts(), &again, &error));
  EXPECT_LT((again.gradient - Differences(proxy, elsewhere)).norm(), 1e-8);
  EXPECT_GT((again.gradient - first.gradient).norm(), 1e-3);
  // The network alone was evaluated.
  EXPECT_EQ(chain.counts().of(PullBackSource::kInverse), kNumSamples);
  if (is_l2) {
    EXPECT_GT(again.loss_hessian_times(VectorXd::Ones(10)).minCoeff(), 0.0);
  }
}

INSTANTIATE_TEST_SUITE_P(Proxies,
                         ProxyTest,
                         testing::Values(ChainPullBack::Proxy::kL2,
                                         ChainPullBack::Proxy::kL1));

// --- Curvature weights ---

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

// --- Other terms of d_x ---

TEST(ChainPullBackTest, ChangesAreCutToTheirMaximum) {
  const DataSet data = RandomData();
  const Model model = MakeModel(QuarticLoss());
  const VectorXd weights = RandomWeights(model);
  Options options = Physical();
  ChainPullBack whole(&model, BendInverse(), options);
  const MatrixXd d_x = WeightedChange(model, Linearized(&whole, weights, data));
  const VectorXd lengths = d_x.colwise().norm();
  options.max_change = 0.5 * (lengths.minCoeff() + lengths.maxCoeff());
  ChainPullBack cut(&model, BendInverse(), options);
  const MatrixXd shortened =
      WeightedChange(model, Linearized(&cut, weights, data));
  for (int s = 0; s < kNumSamples; ++s) {
    const double factor = std::min(1.0, options.max_change / lengths[s]);
    EXPECT_LT((shortened.col(s) - factor * d_x.col(s)).norm(), 1e-14);
  }
}

// The gradient of L + w / 2 |x - x*|^2.
TEST(ChainPullBackTest, DataWeightAddsTheDistanceToTheSolutions) {
  const DataSet data = RandomData();
  for (const Reduction reduction : {Reduction::kMean, Reduction::kSum}) {
    const Model model = MakeModel(QuarticLoss(), reduction);
    const VectorXd weights = RandomWeights(model);
    Options options = Ways(LossWay::kGradient, SimulatorWay::kAdjoint);
    options.data_weight = 0.7;
    ChainPullBack chain(&model, nullptr, options);
    EXPECT_TRUE(chain.needs_solutions());
    const Linearization at = Linearized(&chain, weights, data);
    const auto loss = [&](const VectorXd& theta) {
      double cost = 0.0;
      std::string error;
      EXPECT_TRUE(model.Cost(theta, data, &cost, &error));
      const MatrixXd d = NetworkOutputs(model, theta, data) - data.solutions;
      return cost + model.BatchScale(kNumSamples) * 0.5 * 0.7 * d.squaredNorm();
    };
    EXPECT_LT((at.gradient - Differences(loss, weights)).norm(), 1e-7);
  }
}

TEST(ChainPullBackTest, SupervisedTrainingSeesTheSolutionsOnly) {
  DataSet data = RandomData();
  const Model model = MakeModel(QuarticLoss());
  const VectorXd weights = RandomWeights(model);
  Options options = Physical();
  options.simulator.way = SimulatorWay::kData;
  ChainPullBack chain(&model, BendInverse(), options);
  EXPECT_TRUE(chain.needs_solutions());
  const Linearization at = Linearized(&chain, weights, data);
  const MatrixXd d_x = data.solutions - NetworkOutputs(model, weights, data);
  EXPECT_LT((WeightedChange(model, at) - d_x).norm(), 1e-14);
  double cost = 0.0;
  std::string error;
  ASSERT_TRUE(model.Cost(weights, data, &cost, &error));
  EXPECT_NEAR(at.cost, cost, 1e-14);  // L, for the record
  EXPECT_EQ(chain.counts().Report(), "");
  // Nor do targets matter to the step.
  data.targets.setZero();
  EXPECT_EQ(Linearized(&chain, weights, data).gradient, at.gradient);
  EXPECT_FALSE(
      ChainPullBack(&model, BendInverse(), Physical()).needs_solutions());
}

// --- Threads, failures and counts ---

// An inverse that refuses where y0 <= 0 and is wrong where y0 > 2.
std::shared_ptr<const InverseSimulator> UnreliableInverse() {
  return Inverse([](const auto& y, const auto& x_now) {
    std::optional<VectorXd> x = InvertBend(y, x_now);
    if (x.has_value() && y[0] > 2.0) *x = x_now;
    return x;
  });
}

TEST(ChainPullBackTest, ThreadsDoNotChangeABit) {
  constexpr int kMany = 40;
  DataSet data = RandomData(kMany);
  data.targets.row(0).array() -= 1.0;  // some are out of range
  const Model model = MakeModel(QuarticLoss());
  const VectorXd weights = 1.5 * RandomWeights(model);
  Options options = Physical();
  options.curvature_weight = 0.5;
  ChainPullBack alone(&model, UnreliableInverse(), options);
  const Linearization expected = Linearized(&alone, weights, data);
  const PullBackCounts& counts = alone.counts();
  EXPECT_GT(counts.of(PullBackSource::kInverse), 0);
  EXPECT_GT(counts.of(PullBackSource::kNumericalInverse), 0);
  EXPECT_LT(counts.of(PullBackSource::kInverse), kMany);
  EXPECT_NE(counts.Report().find("(first at step 1, sample "),
            std::string::npos)
      << counts.Report();
  for (const int num_threads : {2, 3, 64}) {
    options.num_threads = num_threads;
    ChainPullBack shared(&model, UnreliableInverse(), options);
    for (int repeat = 0; repeat < 3; ++repeat) {
      const Linearization at = Linearized(&shared, weights, data);
      EXPECT_EQ(at.cost, expected.cost);
      EXPECT_EQ(at.gradient, expected.gradient);
      EXPECT_EQ(at.hessian, expected.hessian);
      if (repeat == 0) {
        EXPECT_EQ(shared.counts().State(), counts.State());
        EXPECT_EQ(shared.counts().Report(), counts.Report());
      }
    }
  }
}

TEST(ChainPullBackTest, ErrorsNameTheSample) {
  const Model model = MakeModel(QuarticLoss());
  const VectorXd weights = RandomWeights(model);
  const auto expect_error = [&](const VectorXd& theta,
                                const DataSet& data,
                                const std::string& expected) {
    for (const SimulatorWay way :
         {SimulatorWay::kAdjoint, SimulatorWay::kInverse}) {
      for (const int num_threads : {1, 3}) {
        Options options = Ways(LossWay::kNewton, way);
        options.num_threads = num_threads;
        ChainPullBack chain(&model, BendInverse(), options);
        Linearization at;
        std::string error;
        EXPECT_FALSE(chain.Linearize(theta, data, AllParts(), &at, &error));
        EXPECT_EQ(error, expected);
      }
    }
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  DataSet data = RandomData();
  data.inputs(1, 3) = nan;
  expect_error(weights, data, "sample 3: the network's output is not finite");
  data = RandomData();
  data.targets(1, 3) = 1e200;
  expect_error(weights, data, "sample 3: the loss has no finite value");
  VectorXd outside = weights;
  // The bias of x0, the first unit of the last layer.
  outside[model.network().offset(1) + 4] = 100.0;
  expect_error(
      outside, RandomData(), "sample 0: the simulator has no finite value");
  // Three finite losses whose sum is not.
  data = RandomData(3);
  data.targets.row(1).setConstant(6e153);
  const Model sum = MakeModel(QuarticLoss(), Reduction::kSum);
  ChainPullBack chain(
      &sum, nullptr, Ways(LossWay::kGradient, SimulatorWay::kAdjoint));
  Linearization at;
  std::string error;
  EXPECT_FALSE(chain.Linearize(weights, data, AllParts(), &at, &error));
  EXPECT_EQ(error, "the cost of the batch is not finite");
}

TEST(ChainPullBackTest, ASampleThatCannotBePulledBackDoesNotMove) {
  // Where A is zero, nothing helps.
  const auto zero = std::make_shared<LinearSimulator>(
      LinearSimulator::Matrix(2, 2), Vector2d::Zero());
  const Model model = MakeModel(QuarticLoss(), Reduction::kMean, zero);
  const DataSet data = RandomData();
  for (const double gamma : {0.0, 1.0}) {
    Options options = Physical();
    options.curvature_weight = gamma;
    ChainPullBack chain(&model, nullptr, options);
    const VectorXd weights = RandomWeights(model);
    EXPECT_EQ(Linearized(&chain, weights, data).gradient,
              VectorXd::Zero(weights.size()));
    EXPECT_EQ(chain.counts().of(PullBackSource::kNone), kNumSamples);
    EXPECT_EQ(chain.counts().Report().rfind(
                  "5 not moved (first at step 1, sample 0: ", 0),
              0u)
        << chain.counts().Report();
  }
}

TEST(ChainPullBackDeathTest, LaterUpdatesNeedAFirst) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const Model model = MakeModel(QuarticLoss());
  ChainPullBack::Options options = Physical();
  options.updates_per_evaluation = 2;
  ChainPullBack chain(&model, BendInverse(), options);
  Linearization at;
  std::string error;
  EXPECT_DEATH(chain.LinearizeAgain(
                   RandomWeights(model), RandomData(), AllParts(), &at, &error),
               "LinearizeAgain follows Linearize");
}

TEST(PullBackCountsTest, ReportsSourcesAndTheFirstFailure) {
  PullBackCounts counts;
  EXPECT_EQ(counts.Report(), "");
  SimulatorPullBack::Result result;
  result.source = PullBackSource::kInverse;
  counts.BeginStep();
  counts.Add(result, 0);
  counts.Add(result, 1);
  EXPECT_EQ(counts.Report(), "2 inverse");
  counts.BeginStep();
  result.source = PullBackSource::kNumericalInverse;
  result.why = "y_0 <= 0";
  counts.Add(result, 17);
  result.source = PullBackSource::kNone;
  result.why = "another";
  counts.Add(result, 18);
  EXPECT_EQ(counts.Report(),
            "2 inverse, 1 numerical inverse, 1 not moved "
            "(first at step 2, sample 17: y_0 <= 0)");
  EXPECT_EQ(counts.of(PullBackSource::kInverse), 2);
  EXPECT_EQ(counts.of(PullBackSource::kInverseGradient), 0);
}

TEST(PullBackCountsTest, GoOnFromTheirState) {
  PullBackCounts counts;
  SimulatorPullBack::Result result;
  for (int i = 0; i < 3; ++i) {
    counts.BeginStep();
    for (int source = 1; source < kNumPullBackSources; ++source) {
      result.source = static_cast<PullBackSource>(source);
      for (int k = 0; k < source; ++k) counts.Add(result, k);
    }
  }
  PullBackCounts restored;
  ASSERT_TRUE(restored.SetState(counts.State()));
  EXPECT_EQ(restored.State(), counts.State());
  EXPECT_EQ(restored.Report(), counts.Report());
  result.why = "late";
  for (PullBackCounts* of : {&counts, &restored}) {
    of->BeginStep();
    of->Add(result, 5);
  }
  EXPECT_EQ(restored.Report(), counts.Report());
  EXPECT_NE(restored.Report().find("first at step 4, sample 5: late"),
            std::string::npos);

  const VectorXd before = restored.State();
  EXPECT_FALSE(restored.SetState(VectorXd::Ones(before.size() + 1)));
  EXPECT_FALSE(restored.SetState(VectorXd()));
  EXPECT_EQ(restored.State(), before);
}

TEST(ParallelSamplesTest, CallsEverySampleOnce) {
  for (const int count : {0, 1, 2, 7, 100}) {
    for (const int num_threads : {1, 2, 3, 8}) {
      std::vector<int> calls(count, 0);
      ParallelSamples(count, num_threads, [&](int s) { ++calls[s]; });
      EXPECT_EQ(calls, std::vector<int>(count, 1));
    }
  }
}

}  // namespace
}  // namespace invgrad
