#include "invgrad/inverse/chain_pull_back.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "glog/logging.h"
#include "invgrad/chain/network_jacobian.h"
#include "invgrad/chain/parallel_samples.h"
#include "invgrad/chain/sample_error.h"
#include "invgrad/core/scratch.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The weight of a sample that does not move.
constexpr double kNoCurvature = -1.0;

}  // namespace

ChainPullBack::ChainPullBack(const Model* model,
                             std::shared_ptr<const InverseSimulator> inverse,
                             const Options& options)
    : model_(*model),
      options_(options),
      loss_pull_back_(model->shared_loss(), options.loss, options.y_step_size) {
  if (!is_supervised()) {
    simulator_pull_back_.emplace(
        model->shared_simulator(), std::move(inverse), options.simulator);
  }
  CHECK_GE(options.curvature_weight, 0.0);
  CHECK_LE(options.curvature_weight, 1.0);
  CHECK_GT(options.max_change, 0.0);
  CHECK_GE(options.data_weight, 0.0);
  CHECK_GE(options.updates_per_evaluation, 1);
  CHECK_GE(options.num_threads, 1);
  CHECK(options.updates_per_evaluation == 1 || model->feedback() == nullptr)
      << "in a closed loop an update moves the inputs of the next one";
}

bool ChainPullBack::Linearize(const VectorXd& weights,
                              const DataSet& batch,
                              const LinearizationParts& parts,
                              Linearization* linearization,
                              std::string* error) {
  if (!model_.Forward(weights, batch, parts.hessian, &activations_, error)) {
    return false;
  }
  const auto x = model_.SimulatorInputs(activations_);
  double cost = 0.0;
  if (!PullBackSamples(x, batch, &cost, error)) return false;
  if (options_.simulator.way == SimulatorWay::kAdjoint &&
      !model_.CloseLoop(weights, batch, activations_, d_x_, error)) {
    return false;
  }
  wanted_x_ = x + d_x_;
  if (!LinearizeProxy(weights, parts, linearization, error)) {
    return false;
  }
  linearization->cost = cost;
  return true;
}

bool ChainPullBack::LinearizeAgain(const VectorXd& weights,
                                   const DataSet& batch,
                                   const LinearizationParts& parts,
                                   Linearization* linearization,
                                   std::string* error) {
  CHECK_EQ(wanted_x_.cols(), batch.num_samples())
      << "LinearizeAgain follows Linearize with the same batch";
  if (!model_.Forward(weights, batch, parts.hessian, &activations_, error)) {
    return false;
  }
  d_x_ = wanted_x_ - model_.SimulatorInputs(activations_);
  return LinearizeProxy(weights, parts, linearization, error);
}

bool ChainPullBack::PullBackSamples(const MatrixXd& x,
                                    const DataSet& batch,
                                    double* cost,
                                    std::string* error) {
  const int num_samples = batch.num_samples();
  const Index num_y = model_.loss().size();
  CHECK_EQ(batch.targets.rows(), num_y);
  CHECK_EQ(batch.targets.cols(), num_samples);
  if (needs_solutions()) CHECK_EQ(batch.solutions.rows(), x.rows());
  struct Sample {
    double loss = 0.0;
    double curvature = kNoCurvature;
    SimulatorPullBack::Result result;
    std::string error;
  };
  std::vector<Sample> samples(num_samples);
  d_x_.resize(x.rows(), num_samples);
  const bool is_weighted = options_.curvature_weight > 0.0;
  ParallelSamples(num_samples, options_.num_threads, [&](int s) {
    Sample& sample = samples[s];
    Scratch<double> y(num_y);
    Scratch<double> d_y(num_y);
    const double* target = batch.targets.col(s).data();
    const auto wanted_change = [&](const double* at, double* change) {
      if (!loss_pull_back_.Step(
              at, target, &sample.loss, change, &sample.error)) {
        return false;
      }
      if (is_weighted) std::copy_n(change, num_y, d_y.data());
      return true;
    };
    const Simulator::Covector covector = std::cref(wanted_change);
    if (!PullBackSample(
            x.col(s), batch, s, covector, y.data(), &sample.result)) {
      if (sample.error.empty()) {
        sample.error = SimulatorFailure(
            model_.simulator(), x.col(s).data(), batch.Context(s).data());
      }
      return;
    }
    const double length = d_x_.col(s).norm();
    if (length > options_.max_change && !is_supervised()) {
      d_x_.col(s) *= options_.max_change / length;
    }
    if (!is_weighted || length == 0.0) return;
    Scratch<double> hessian(num_y * num_y);
    double ignored = 0.0;
    if (!model_.loss().Evaluate(
            y.data(), target, &ignored, nullptr, hessian.data())) {
      sample.error = "the Hessian of the loss has no finite value";
      return;
    }
    const Map<const VectorXd> change(d_y.data(), num_y);
    const Map<const MatrixXd> H(hessian.data(), num_y, num_y);
    sample.curvature =
        std::max(0.0, change.dot(H * change)) / (length * length);
  });

  counts_.BeginStep();
  const double scale = model_.BatchScale(num_samples);
  VectorXd curvatures(num_samples);
  *cost = 0.0;
  for (int s = 0; s < num_samples; ++s) {
    const Sample& sample = samples[s];
    if (!sample.error.empty()) return SampleError(s, sample.error, error);
    *cost += scale * sample.loss;
    curvatures[s] = sample.curvature;
    counts_.Add(sample.result, s);
  }
  SetWeights(curvatures);
  return CheckCost(*cost, error);
}

bool ChainPullBack::PullBackSample(const InverseSimulator::ConstVectorRef& x,
                                   const DataSet& batch,
                                   int sample,
                                   const Simulator::Covector& wanted_change,
                                   double* y,
                                   SimulatorPullBack::Result* result) {
  auto d_x = d_x_.col(sample);
  if (is_supervised()) {
    // Needed only for the loss, because x~ does not depend on y.
    Scratch<double> ignored(model_.loss().size());
    d_x = batch.solutions.col(sample) - x;
    return model_.simulator().Evaluate(
               x.data(), batch.Context(sample).data(), y, nullptr) &&
           wanted_change(y, ignored.data());
  }
  if (!(*simulator_pull_back_)(
          x, batch.Context(sample), wanted_change, y, d_x, result)) {
    return false;
  }
  if (options_.data_weight > 0.0) {
    d_x += options_.data_weight * (batch.solutions.col(sample) - x);
  }
  return true;
}

void ChainPullBack::SetWeights(const VectorXd& curvatures) {
  sample_weights_ = VectorXd::Ones(curvatures.size());
  if (options_.curvature_weight == 0.0) return;
  const auto moves = curvatures.array() != kNoCurvature;
  const VectorXd powers =
      moves.select(curvatures.array().pow(options_.curvature_weight), 0.0);
  const double mean = powers.sum() / static_cast<double>(moves.count());
  if (!(mean > 0.0) || !std::isfinite(mean)) return;
  sample_weights_ = moves.select(powers / mean, sample_weights_);
}

bool ChainPullBack::LinearizeProxy(const VectorXd& weights,
                                   const LinearizationParts& parts,
                                   Linearization* linearization,
                                   std::string* error) {
  const DenseNetwork& network = model_.network();
  const Index num_x = d_x_.rows();
  const Index num_samples = d_x_.cols();
  const bool is_l2 = options_.proxy == Proxy::kL2;
  const VectorXd scales = model_.BatchScale(num_samples) * sample_weights_;
  // The proxy's gradient in x.
  MatrixXd g = -d_x_;
  if (!is_l2) g = g.array().sign();
  g *= scales.asDiagonal();

  linearization->cost = is_l2 ? 0.5 * d_x_.colwise().squaredNorm().dot(scales)
                              : d_x_.cwiseAbs().colwise().sum().dot(scales);
  linearization->gradient.resize(0);
  linearization->loss_gradient.resize(0);
  linearization->jacobian.reset();
  linearization->loss_hessian_times = nullptr;
  linearization->hessian.resize(0, 0);
  // The number of outputs of one call of the network.
  const Index width = network.num_outputs() * activations_.num_channels;
  const Index num_calls = g.size() / width;
  // One column per call, or per channel of its jet.
  const MatrixXd covectors =
      g.reshaped(network.num_outputs(), activations_.batch_size());
  if (parts.gradient) {
    network.Backward(
        weights, activations_, covectors, &linearization->gradient);
  }
  const VectorXd curvature =
      is_l2 ? VectorXd(scales.transpose().replicate(num_x, 1).reshaped())
            : VectorXd::Zero(g.size());
  if (parts.hessian) {
    std::vector<MatrixXd> x_hessians;
    for (Index i = 0; i < curvature.size(); i += width) {
      x_hessians.emplace_back(curvature.segment(i, width).asDiagonal());
    }
    network.Hessian(
        weights, activations_, covectors, x_hessians, &linearization->hessian);
  }
  if (!CheckDerivatives(
          linearization->gradient, linearization->hessian, error)) {
    return false;
  }
  if (!parts.jacobian) return true;
  linearization->loss_gradient = g.reshaped();
  linearization->loss_hessian_times =
      [curvature](const VectorXd& v) -> VectorXd {
    return curvature.cwiseProduct(v);
  };
  linearization->jacobian = std::make_shared<NetworkJacobian>(
      network,
      weights,
      std::move(activations_),
      MatrixXd::Identity(width, width).replicate(1, num_calls));
  return true;
}

}  // namespace invgrad
