#include "bin/fresh_samples/probe.h"

#include <cmath>
#include <limits>
#include <utility>

#include "fmt/core.h"
#include "invgrad/io/numpy_random.h"
#include "invgrad/train/train.h"

namespace invgrad {
namespace {

// The batches that a run makes of its training samples (train/engine.h).
class EpochBatches final : public DataSource {
 public:
  EpochBatches(const DataSet& train, bool shuffles, int seed)
      : train_(train), shuffles_(shuffles), seed_(seed) {}

  DataSet Batch(long step,
                int batch_size,
                const Model& /*model*/,
                const Eigen::VectorXd& /*weights*/) const override {
    const long steps_per_epoch = train_.num_samples() / batch_size;
    const int first = static_cast<int>(step % steps_per_epoch) * batch_size;
    if (!shuffles_) return train_.Range(first, batch_size);
    const std::vector<int>& order = Order(step / steps_per_epoch);
    const auto begin = order.begin() + first;
    return train_.Select(std::vector<int>(begin, begin + batch_size));
  }

  std::string Name() const override { return "batches of an epoch's order"; }

 private:
  const std::vector<int>& Order(long epoch) const {
    if (epoch == epoch_) return order_;
    NumpyRandom random(static_cast<std::uint32_t>(seed_));
    for (epoch_ = -1; epoch_ < epoch; ++epoch_) {
      order_ = random.Permutation(train_.num_samples());
    }
    return order_;
  }

  const DataSet& train_;
  const bool shuffles_;
  const int seed_;
  mutable long epoch_ = -1;
  mutable std::vector<int> order_;
};

// The damped power that leave_one_out.h can judge in place of a filter.
SpectralFilter WithoutNoise(SpectralFilter filter) {
  if (filter.noise > 0.0) {
    filter.relative_damping +=
        std::pow(filter.noise, 1.0 / filter.signal_exponent);
    filter.noise = 0.0;
  }
  return filter;
}

}  // namespace

FreshProbe::FreshProbe(const LearningProblem& problem,
                       int batch_size,
                       int num_fresh_batches,
                       bool shuffles,
                       int seed)
    : problem_(problem),
      batch_size_(batch_size),
      num_fresh_batches_(num_fresh_batches),
      batches_(problem.source) {
  if (batches_ == nullptr) {
    batches_ = std::make_shared<EpochBatches>(problem.train, shuffles, seed);
  }
}

bool FreshProbe::IsValid(std::string* error) const {
  const int num_others = problem_.train.num_samples() / batch_size_ - 1;
  if (problem_.source != nullptr || num_fresh_batches_ <= num_others) {
    return true;
  }
  *error = fmt::format(
      "{} fresh batches, but an epoch of {} samples in batches of {} has {} "
      "others than the step's own",
      num_fresh_batches_,
      problem_.train.num_samples(),
      batch_size_,
      num_others);
  return false;
}

bool FreshProbe::Begin(long step,
                       const Eigen::VectorXd& weights,
                       std::string* error) {
  const DataSet batch =
      batches_->Batch(step, batch_size_, *problem_.model, weights);
  // Within the epoch of the step, so that no sample is in two batches.
  long first = 0, length = std::numeric_limits<long>::max();
  if (problem_.source == nullptr) {
    length = problem_.train.num_samples() / batch_size_;
    first = step - step % length;
  }
  const auto linearize = [&](const DataSet& samples, Linearization* result) {
    return problem_.model->Linearize(
        weights, samples, LinearizationParts::Jacobian(), result, error);
  };
  weights_ = weights;
  test_loss_ = TestLoss(weights);
  fresh_.clear();
  fresh_at_weights_.clear();
  fresh_loss_ = 0.0;
  for (int i = 1; i <= num_fresh_batches_; ++i) {
    fresh_.push_back(batches_->Batch(first + (step - first + i) % length,
                                     batch_size_,
                                     *problem_.model,
                                     weights));
    if (!linearize(fresh_.back(), &fresh_at_weights_.emplace_back())) {
      return false;
    }
    fresh_loss_ += fresh_at_weights_.back().cost;
  }
  if (!linearize(batch, &at_weights_)) return false;
  LeaveOneOutOptions options;
  options.loss_hessian_times = at_weights_.loss_hessian_times;
  const Eigen::VectorXd& g = at_weights_.loss_gradient;
  const int num_samples = batch.num_samples();
  return leave_one_out_.Factorize(
      *at_weights_.jacobian,
      g,
      std::vector<int>(num_samples, static_cast<int>(g.size()) / num_samples),
      options,
      error);
}

bool FreshProbe::Score(std::vector<SpectralFilter> filters,
                       std::vector<LeaveOneOutSummary>* summaries,
                       std::string* error) const {
  for (SpectralFilter& filter : filters) filter = WithoutNoise(filter);
  Eigen::MatrixXd changes;
  if (leave_one_out_.Evaluate(filters, &changes, summaries)) return true;
  for (const LeaveOneOutSummary& summary : *summaries) {
    if (!summary.message.empty()) *error = summary.message;
  }
  return false;
}

bool FreshProbe::Measure(const SpectralFilter& filter,
                         const LeaveOneOutSummary& summary,
                         double step_size,
                         FreshDecrease* decrease,
                         std::string* error) {
  SpectralFilter judged = SpectralFilter::Power(filter.kappa, 0.0);
  judged.damping = summary.damping;
  Eigen::VectorXd d;
  SpectralStepSummary step_summary;
  if (!SpectralStep(*at_weights_.jacobian,
                    at_weights_.loss_gradient,
                    judged,
                    SpectralStepOptions::ForTraining(),
                    &workspace_,
                    &d,
                    &step_summary)) {
    *error = step_summary.message;
    return false;
  }
  const Eigen::VectorXd step = -step_size * d;
  const Eigen::VectorXd after = weights_ + step;
  const LeaveOneOutScore& score = summary.score;
  decrease->step_size = step_size;
  decrease->predicted = step_size *
                        (score.g_c - 0.5 * step_size * score.c_H_c) /
                        at_weights_.cost;
  decrease->linear = LinearDecrease(step);
  decrease->measured = 1.0 - FreshLoss(after) / fresh_loss_;
  decrease->measured_test = 1.0 - TestLoss(after) / test_loss_;
  return true;
}

double FreshProbe::FreshLoss(const Eigen::VectorXd& weights) const {
  double sum = 0.0;
  for (const DataSet& batch : fresh_) {
    double cost = 0.0;
    std::string ignored;
    if (!problem_.model->Cost(weights, batch, &cost, &ignored)) {
      return std::numeric_limits<double>::quiet_NaN();
    }
    sum += cost;
  }
  return sum;
}

double FreshProbe::LinearDecrease(const Eigen::VectorXd& step) const {
  double decrease = 0.0;
  Eigen::VectorXd t;
  for (const Linearization& fresh : fresh_at_weights_) {
    fresh.jacobian->Times(step, &t);
    decrease -=
        fresh.loss_gradient.dot(t) +
        0.5 * t.dot(fresh.loss_hessian_times ? fresh.loss_hessian_times(t) : t);
  }
  return decrease / fresh_loss_;
}

double FreshProbe::TestLoss(const Eigen::VectorXd& weights) const {
  if (problem_.test.num_samples() == 0) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  return MeanLoss(*problem_.model, weights, problem_.test);
}

}  // namespace invgrad
