#include "invgrad/inverse/chain_pull_back.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "invgrad/chain/chain_jacobian.h"
#include "invgrad/chain/network_jacobian.h"
#include "invgrad/chain/sample_error.h"
#include "invgrad/internal/communicator.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/parallel.h"
#include "invgrad/internal/scratch.h"
#include "invgrad/inverse_simulator.h"

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
  CHECK(options.updates_per_evaluation == 1 || model->feedback() == nullptr)
      << "in a closed loop an update moves the inputs of the next one";
}

bool ChainPullBack::Linearize(const VectorXd& weights,
                              const DataSet& batch,
                              const LinearizationParts& parts,
                              Linearization* linearization,
                              std::string* error) {
  std::vector<Sample> samples;
  const bool ok = Forward(weights, batch, parts, error) &&
                  PullBackSamples(batch, &samples, error);
  double cost = 0.0;
  const double scale = model_.BatchScale(batch.batch_size());
  for (const Sample& sample : samples) cost += scale * sample.loss;
  if (!GatherSamples(ok, batch, &samples, error)) return false;
  counts_.BeginStep();
  for (std::size_t s = 0; s < samples.size(); ++s) {
    counts_.Add(samples[s].result, static_cast<int>(s));
  }
  SetWeights(batch, samples);
  if (options_.simulator.way == SimulatorWay::kAdjoint &&
      !model_.CloseLoop(weights, batch, *pass_, d_x_, error)) {
    return false;
  }
  wanted_x_ = model_.SimulatorInputs(*pass_) + d_x_;
  if (!LinearizeProxy(weights, batch, parts, linearization, error)) {
    return false;
  }
  linearization->cost = cost;
  return CheckCost(cost, error);
}

bool ChainPullBack::LinearizeAgain(const VectorXd& weights,
                                   const DataSet& batch,
                                   const LinearizationParts& parts,
                                   Linearization* linearization,
                                   std::string* error) {
  CHECK_EQ(wanted_x_.cols(), batch.num_samples())
      << "LinearizeAgain follows Linearize with the same batch";
  if (!Forward(weights, batch, parts, error)) return false;
  d_x_ = wanted_x_ - model_.SimulatorInputs(*pass_);
  return LinearizeProxy(weights, batch, parts, linearization, error);
}

bool ChainPullBack::LinearizeOutputLayer(const VectorXd& weights,
                                         const DataSet& samples,
                                         OutputLayerProblem* problem,
                                         std::string* error) {
  std::vector<Sample> pulled_back;
  if (!Forward(weights, samples, LinearizationParts(), error) ||
      !PullBackSamples(samples, &pulled_back, error)) {
    return false;
  }
  // Those of the last Linearize stay, for LinearizeAgain.
  const VectorXd sample_weights = sample_weights_;
  SetWeights(samples, pulled_back);
  SetProblemInX(model_.network(),
                weights,
                *pass_,
                d_x_,
                options_.curvature_weight == 0.0 ? VectorXd() : sample_weights_,
                problem);
  sample_weights_ = sample_weights;
  return true;
}

bool ChainPullBack::Forward(const VectorXd& weights,
                            const DataSet& batch,
                            const LinearizationParts& parts,
                            std::string* error) {
  if (parts.hessian && model_.dense_network() == nullptr) {
    *error =
        "the exact Hessian of a proxy needs a DenseNetwork: choose a method "
        "that needs the gradient or the Jacobian";
    return false;
  }
  if (pass_ == nullptr) pass_ = model_.network().NewPass();
  return model_.Forward(weights,
                        batch,
                        parts.hessian ? Network::Derivatives::kSecond
                                      : Network::Derivatives::kFirst,
                        pass_.get(),
                        error);
}

bool ChainPullBack::PullBackSamples(const DataSet& batch,
                                    std::vector<Sample>* samples,
                                    std::string* error) {
  const auto x = model_.SimulatorInputs(*pass_);
  const int num_samples = batch.num_samples();
  CHECK_EQ(batch.targets.rows(), model_.loss().size());
  CHECK_EQ(batch.targets.cols(), num_samples);
  if (is_supervised() || options_.data_weight > 0.0) {
    CHECK_EQ(batch.solutions.rows(), x.rows());
  }
  d_x_.resize(x.rows(), num_samples);
  samples->resize(num_samples);
  ForShares(
      num_samples,
      model_.num_threads(),
      [&](int begin, int end) {
        for (int s = begin; s < end; ++s) {
          (*samples)[s] = PullBackSample(x.col(s), batch, s);
        }
        return end;
      },
      /*grain=*/1);
  for (int s = 0; s < num_samples; ++s) {
    const std::string& why = (*samples)[s].error;
    if (!why.empty()) return SampleError(batch, s, why, error);
  }
  return true;
}

bool ChainPullBack::GatherSamples(bool ok,
                                  const DataSet& batch,
                                  std::vector<Sample>* samples,
                                  std::string* error) const {
  const Communicator* const communicator = options_.communicator;
  if (communicator == nullptr) return ok;
  if (!communicator->Agree(ok, error)) return false;
  MatrixXd own(3, samples->size());
  std::string why;  // of the rank's first sample whose first choice failed
  for (Index s = 0; s < own.cols(); ++s) {
    const Sample& sample = (*samples)[s];
    const bool is_first = why.empty() && !sample.result.why.empty();
    if (is_first) why = sample.result.why;
    own.col(s) << sample.curvature, static_cast<double>(sample.result.source),
        is_first ? 1.0 : 0.0;
  }
  const MatrixXd all = communicator->GatherColumns(own, batch.batch_size(), 1);
  std::vector<std::string> reasons;
  if ((all.row(2).array() > 0.0).any())
    reasons = communicator->GatherTexts(why);
  reasons.erase(std::remove(reasons.begin(), reasons.end(), ""), reasons.end());
  samples->assign(all.cols(), Sample());
  auto reason = reasons.begin();
  for (Index s = 0; s < all.cols(); ++s) {
    Sample& sample = (*samples)[s];
    sample.curvature = all(0, s);
    sample.result.source = static_cast<PullBackSource>(all(1, s));
    if (all(2, s) > 0.0) sample.result.why = *reason++;
  }
  return true;
}

ChainPullBack::Sample ChainPullBack::PullBackSample(
    const InverseSimulator::ConstVectorRef& x, const DataSet& batch, int s) {
  const Index num_y = model_.loss().size();
  const auto context = batch.Context(s);
  const double* target = batch.targets.col(s).data();
  auto d_x = d_x_.col(s);
  Sample sample;
  sample.curvature = kNoCurvature;
  Scratch<double> y(num_y);
  Scratch<double> d_y(num_y);
  const auto wanted_change = [&](const double* at, double* change) {
    if (!loss_pull_back_.Step(
            at, target, &sample.loss, d_y.data(), &sample.error)) {
      return false;
    }
    std::copy_n(d_y.data(), num_y, change);
    return true;
  };
  bool has_value = false;
  if (is_supervised()) {
    // P and d_y only serve the loss, because x~ does not depend on y.
    d_x = batch.solutions.col(s) - x;
    Scratch<double> ignored(num_y);
    has_value = model_.simulator().Evaluate(
                    x.data(), context.data(), y.data(), nullptr) &&
                wanted_change(y.data(), ignored.data());
  } else {
    const Simulator::Covector covector = std::cref(wanted_change);
    has_value = (*simulator_pull_back_)(x,
                                        context,
                                        covector,
                                        y.data(),
                                        d_x,
                                        &sample.result,
                                        loss_pull_back_.Lowered(target));
    if (options_.data_weight > 0.0) {
      d_x += options_.data_weight * (batch.solutions.col(s) - x);
    }
  }
  if (!has_value) {
    if (sample.error.empty()) {
      sample.error =
          SimulatorFailure(model_.simulator(), x.data(), context.data());
    }
    return sample;
  }
  const double length = d_x.norm();
  if (length > options_.max_change && !is_supervised()) {
    d_x *= options_.max_change / length;
  }
  if (options_.curvature_weight == 0.0 || length == 0.0) return sample;
  const Map<const VectorXd> change(d_y.data(), num_y);
  const double curvature =
      change.dot(model_.loss().HessianTimes(y.data(), target, change));
  if (!std::isfinite(curvature)) {
    sample.error = "the Hessian of the loss has no finite value";
    return sample;
  }
  sample.curvature = std::max(0.0, curvature) / (length * length);
  return sample;
}

void ChainPullBack::SetWeights(const DataSet& batch,
                               const std::vector<Sample>& samples) {
  sample_weights_ = VectorXd::Ones(batch.num_samples());
  if (options_.curvature_weight == 0.0) return;
  VectorXd curvatures(samples.size());
  for (std::size_t s = 0; s < samples.size(); ++s) {
    curvatures[s] = samples[s].curvature;
  }
  const auto moves = curvatures.array() != kNoCurvature;
  const VectorXd powers =
      moves.select(curvatures.array().pow(options_.curvature_weight), 0.0);
  const double mean = powers.sum() / static_cast<double>(moves.count());
  if (!(mean > 0.0) || !std::isfinite(mean)) return;
  const VectorXd weights =
      moves.select(powers / mean, VectorXd::Ones(curvatures.size()));
  sample_weights_ = weights.segment(batch.first_in_batch, batch.num_samples());
}

bool ChainPullBack::LinearizeProxy(const VectorXd& weights,
                                   const DataSet& batch,
                                   const LinearizationParts& parts,
                                   Linearization* linearization,
                                   std::string* error) {
  const Network& network = model_.network();
  const Index num_x = d_x_.rows();
  const bool is_l2 = options_.proxy == Proxy::kL2;
  const VectorXd scales =
      model_.BatchScale(batch.batch_size()) * sample_weights_;
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
  linearization->loss_on_curve = nullptr;
  linearization->hessian.resize(0, 0);
  // The number of outputs of one call of the network.
  const Index width = network.num_outputs() * pass_->num_channels;
  const Index num_calls = g.size() / width;
  // One column per call, or per channel of its jet.
  const MatrixXd covectors =
      g.reshaped(network.num_outputs(), pass_->num_columns());
  if (parts.gradient) {
    network.Backward(weights, *pass_, covectors, &linearization->gradient);
  }
  const VectorXd curvature =
      is_l2 ? VectorXd(scales.transpose().replicate(num_x, 1).reshaped())
            : VectorXd::Zero(g.size());
  if (parts.hessian) {
    std::vector<MatrixXd> x_hessians;
    for (Index i = 0; i < curvature.size(); i += width) {
      x_hessians.emplace_back(curvature.segment(i, width).asDiagonal());
    }
    model_.dense_network()->Hessian(
        weights, Activations(), covectors, x_hessians, &linearization->hessian);
  }
  if (!CheckDerivatives(
          linearization->gradient, linearization->hessian, error)) {
    return false;
  }
  if (parts.jacobian || parts.loss_gradient) {
    linearization->loss_gradient = g.reshaped();
  }
  if (!parts.jacobian) return true;
  linearization->loss_hessian_times =
      [curvature](const VectorXd& v) -> VectorXd {
    return curvature.cwiseProduct(v);
  };
  if (model_.dense_network() == nullptr) {
    linearization->jacobian = std::make_shared<ChainJacobian>(
        model_.shared_network(),
        weights,
        std::move(pass_),
        /*simulator=*/nullptr,
        std::vector<std::unique_ptr<const JacobianOperator>>());
    return true;
  }
  linearization->jacobian = std::make_shared<NetworkJacobian>(
      *model_.dense_network(),
      weights,
      std::move(Activations()),
      MatrixXd::Identity(width, width).replicate(1, num_calls));
  return true;
}

}  // namespace invgrad
