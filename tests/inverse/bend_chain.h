// A small chain with a curved, invertible simulator, for tests.
#ifndef TESTS_BEND_CHAIN_H_
#define TESTS_BEND_CHAIN_H_

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/autodiff_loss.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/inverse/chain_pull_back.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/loss.h"
#include "tests/inverse/pull_one_back.h"
#include "tests/support/random_matrix.h"

namespace invgrad {

// x = (log y0, y1 - log^2 y0), refused where y0 <= 0.
inline std::optional<Eigen::VectorXd> InvertBend(
    const InverseSimulator::ConstVectorRef& y,
    const InverseSimulator::ConstVectorRef& /*x_now*/) {
  if (!(y[0] > 0.0)) return std::nullopt;
  return BendInverse(y);
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

inline std::shared_ptr<const Loss> QuarticLoss(double scale = 1.0) {
  return std::make_shared<AutoDiffLoss<Quartic, 2>>(Quartic{scale});
}

inline constexpr int kNumSamples = 5;

inline std::shared_ptr<const Simulator> BendSimulator() {
  return std::make_shared<AutoDiffSimulator<Bend, 2, 2>>();
}

inline Model MakeModel(
    std::shared_ptr<const Loss> loss,
    Reduction reduction = Reduction::kMean,
    std::shared_ptr<const Simulator> simulator = BendSimulator()) {
  return Model(DenseNetwork({3, 4, 2}, Activation::kTanh),
               std::move(simulator),
               std::move(loss),
               reduction);
}

inline DataSet RandomData(int num_samples = kNumSamples) {
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

inline Eigen::VectorXd RandomWeights(const Model& model) {
  return RandomMatrix(model.num_weights(), 1, 14);
}

inline std::shared_ptr<const InverseSimulator> BendInverse() {
  return Inverse(InvertBend);
}

inline ChainPullBack::Options Ways(LossWay loss, SimulatorWay simulator) {
  ChainPullBack::Options options;
  options.loss = loss;
  options.simulator.way = simulator;
  return options;
}

inline ChainPullBack::Options Physical() {
  return Ways(LossWay::kNewton, SimulatorWay::kInverse);
}

inline LinearizationParts AllParts() {
  LinearizationParts parts;
  parts.gradient = parts.jacobian = parts.hessian = true;
  return parts;
}

inline Linearization Linearized(ChainPullBack* chain,
                                const Eigen::VectorXd& weights,
                                const DataSet& data) {
  Linearization at;
  std::string error;
  EXPECT_TRUE(chain->Linearize(weights, data, AllParts(), &at, &error))
      << error;
  return at;
}

// x of all samples.
inline Eigen::MatrixXd NetworkOutputs(const Model& model,
                                      const Eigen::VectorXd& weights,
                                      const DataSet& data) {
  DenseNetwork::Activations activations;
  std::string error;
  EXPECT_TRUE(model.Forward(
      weights, data, Network::Derivatives::kFirst, &activations, &error));
  return activations.outputs;
}

// The d_x of every sample, from g = -scale d_x (L2).
inline Eigen::MatrixXd WeightedChange(const Model& model,
                                      const Linearization& at) {
  const int num_samples = static_cast<int>(at.loss_gradient.size()) / 2;
  return at.loss_gradient.reshaped(2, num_samples) /
         -model.BatchScale(num_samples);
}

// The gradient of a function of the weights by central differences: h^2 and
// rounding leave 1e-9.
template <typename Function>
Eigen::VectorXd Differences(const Function& function,
                            const Eigen::VectorXd& weights) {
  const double h = 1e-5;
  Eigen::VectorXd gradient(weights.size());
  for (Eigen::Index i = 0; i < weights.size(); ++i) {
    const Eigen::VectorXd e = h * Eigen::VectorXd::Unit(weights.size(), i);
    gradient[i] = (function(weights + e) - function(weights - e)) / (2.0 * h);
  }
  return gradient;
}

}  // namespace invgrad

#endif  // TESTS_BEND_CHAIN_H_
