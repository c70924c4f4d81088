#include "invgrad/train/raced_engine.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "fmt/core.h"
#include "invgrad/core/step_cost.h"
#include "invgrad/internal/communicator.h"

namespace invgrad {
namespace {

constexpr int kMaxNumJudging = 512;
// For the choice between the last weights and their means, whose losses differ by
// less than those of slices.
constexpr int kMaxNumChoosing = 2048;

// So many samples at most, evenly spaced.
DataSet EvenlySpaced(const DataSet& data, int max_num_samples) {
  const int num_samples = std::min(max_num_samples, data.num_samples());
  std::vector<int> indices;
  indices.reserve(num_samples);
  for (int i = 0; i < num_samples; ++i) {
    indices.push_back(
        static_cast<int>(1L * i * data.num_samples() / num_samples));
  }
  return data.Select(indices);
}

}  // namespace

RacedEngine::RacedEngine(std::unique_ptr<RuleEngine> engine,
                         BatchRace race,
                         int num_judging,
                         const TrainOptions& options,
                         const Model* model,
                         const TrainingData* data)
    : Engine(engine->steps_per_epoch(),
             /*has_state=*/true,
             /*reports_best=*/true),
      engine_(std::move(engine)),
      race_(std::move(race)),
      num_judging_(num_judging),
      communicator_(options.communicator),
      model_(*model),
      data_(*data) {}

double RacedEngine::Judge(const Eigen::VectorXd& weights,
                          const DataSet& samples) {
  const double loss = MeanLoss(
      model_, engine_->Finished(weights), samples, communicator_.get());
  return std::isfinite(loss) ? loss : std::numeric_limits<double>::infinity();
}

Eigen::VectorXd RacedEngine::Finished(const Eigen::VectorXd& weights) {
  const bool is_first = race_.lane() == 0;
  const Eigen::VectorXd& last = is_first ? weights : lanes_[0].of_rule.weights;
  const WeightMeans& means = is_first ? means_ : lanes_[0].means;
  const Eigen::VectorXd* lowest = &last;
  if (means.has_means()) {
    const DataSet samples = EvenlySpaced(data_.train, kMaxNumChoosing);
    double loss = Judge(last, samples);
    // A run whose last weights have no finite loss has diverged.
    for (const Eigen::VectorXd& mean : means.means()) {
      const double of_mean = Judge(mean, samples);
      if (!std::isfinite(loss) || of_mean >= loss) continue;
      lowest = &mean;
      loss = of_mean;
    }
    // The other samples may not have a finite loss at a mean.
    if (lowest != &last && samples.num_samples() < data_.train.num_samples() &&
        !std::isfinite(Judge(*lowest, data_.train))) {
      lowest = &last;
    }
  }
  return engine_->Finished(*lowest);
}

bool RacedEngine::Undo(UndoReason reason,
                       const Eigen::VectorXd& best,
                       Eigen::VectorXd* weights) {
  if (reason == UndoReason::kNoLoss && race_.lane() > 0) {
    // The first slice, which the run reports, is over.
    Lane& first = lanes_[0];
    if (best.size() == 0 || first.of_rule.weights == best) return false;
    first.of_rule.weights = best;
    first.means = WeightMeans();
    return true;
  }
  if (!engine_->Undo(reason, best, weights)) return false;
  means_ = WeightMeans();
  return true;
}

RacedEngine::Lane RacedEngine::Save(const Eigen::VectorXd& weights) {
  return {engine_->Save(weights), means_};
}

void RacedEngine::Load(const Lane& lane, Eigen::VectorXd* weights) {
  engine_->Load(lane.of_rule, weights);
  means_ = lane.means;
}

void RacedEngine::Lane::VisitState(const std::string& name,
                                   Eigen::Index num_weights,
                                   StateArchive* archive) {
  of_rule.VisitState(name, num_weights, archive);
  means.VisitState(name + "_", num_weights, archive);
}

Engine::StepResult RacedEngine::Step(double progress,
                                     Eigen::VectorXd* weights) {
  if (race_.IsDue()) {
    const DataSet samples = engine_->TakeSamples(num_judging_, *weights);
    const double loss = Judge(*weights, samples);
    if (race_.Begin(KeepOrGoBack(loss, samples, weights))) {
      start_ = Save(*weights);
    }
  }
  engine_->set_batch_size(race_.batch_size());
  StepResult result = engine_->Step(progress, weights);
  const bool has_failed = result.outcome == StepResult::Outcome::kFailed;
  // Without a race the run would have failed, too.
  if (has_failed && race_.lane() == 0) return result;
  result.outcome = StepResult::Outcome::kStepped;
  num_samples_ += race_.batch_size();
  race_.CountStep();
  means_.Add(*weights);
  if (race_.IsSliceOver() || has_failed) EndSlice(has_failed, weights);
  return result;
}

Engine::Counts RacedEngine::counts() const {
  Counts counts = engine_->counts();
  counts.batch_size = race_.batch_size();
  counts.epochs = num_samples_ / data_.train.num_samples();
  return counts;
}

double RacedEngine::KeepOrGoBack(double loss,
                                 const DataSet& samples,
                                 Eigen::VectorXd* weights) {
  const auto of_lowest = [&]() {
    return Judge(lowest_.of_rule.weights, samples);
  };
  switch (race_.Decide(loss, of_lowest)) {
    case BatchRace::Verdict::kIsLowest:
      lowest_ = Save(*weights);
      return loss;
    case BatchRace::Verdict::kGoesBack:
      Load(lowest_, weights);
      return race_.lowest_loss();
    case BatchRace::Verdict::kGoesOn:
      break;
  }
  return loss;
}

void RacedEngine::EndSlice(bool has_failed, Eigen::VectorXd* weights) {
  lanes_.push_back(Save(*weights));
  if (has_failed) lanes_.back().of_rule.weights.resize(0);
  if (race_.BeginNextSlice()) {
    Load(start_, weights);
    return;
  }
  const DataSet samples = engine_->TakeSamples(num_judging_, *weights);
  std::vector<double> losses;
  for (const Lane& lane : lanes_) {
    const Eigen::VectorXd& last = lane.of_rule.weights;
    losses.push_back(last.size() > 0 ? Judge(last, samples)
                                     : std::numeric_limits<double>::infinity());
  }
  const int winner = race_.End(losses);
  Load(lanes_[winner], weights);
  KeepOrGoBack(losses[winner], samples, weights);
  lanes_.clear();
  start_ = Lane();
}

std::unique_ptr<Engine> MakeRacedEngine(
    std::unique_ptr<RuleEngine> engine,
    const LinearizationParts& needs,
    bool is_proxy,
    std::function<bool(int batch_size, std::string* why)> fits,
    const TrainOptions& options,
    const Model& model,
    const TrainingData& data) {
  const double num_weights = model.num_weights();
  const double num_x = model.simulator().num_inputs();
  const double num_y = model.loss().size();
  const double rows = is_proxy ? num_x : num_y;
  // A forward pass of network and simulator.
  const double pass =
      2.0 * model.num_columns() * num_weights + 2.0 * num_x * num_y;
  // A backward pass is two forward ones; `after` stands for three trials.
  double num_passes = 3.0 + (needs.after ? 3.0 : 0.0);
  if (!needs.factorization) num_passes += 4.0 * needs.num_products;
  BatchRace::Costs costs;
  costs.of_step = [=](int batch_size) {
    return StepOperations(needs, rows * batch_size, num_weights, 0.0) +
           num_passes * pass * batch_size;
  };
  const int num_samples = data.train.num_samples();
  const int num_judging = std::min(kMaxNumJudging, (num_samples + 1) / 2);
  costs.of_judgement = pass * num_judging;
  costs.fits = std::move(fits);
  BatchRace race(engine->batch_size(), num_samples, std::move(costs));
  return std::make_unique<RacedEngine>(
      std::move(engine), std::move(race), num_judging, options, &model, &data);
}

void RacedEngine::VisitState(StateArchive* archive) {
  engine_->VisitState(archive);
  race_.VisitState(archive);
  archive->Visit("num_samples", &num_samples_);
  archive->Require(num_samples_ >= 0.0 && std::isfinite(num_samples_),
                   "num_samples");
  const Eigen::Index num_weights = model_.num_weights();
  means_.VisitState("", num_weights, archive);
  if (!archive->error().empty()) return;
  if (archive->is_reading()) {
    lowest_ = Save(Eigen::VectorXd());
    start_ = lowest_;
    lanes_.assign(race_.lane(), start_);
  }
  if (std::isfinite(race_.lowest_loss())) {
    lowest_.VisitState("lowest", num_weights, archive);
  }
  if (!race_.is_racing()) return;
  start_.VisitState("race", num_weights, archive);
  for (size_t i = 0; i < lanes_.size(); ++i) {
    lanes_[i].VisitState(fmt::format("slice_{}", i), num_weights, archive);
  }
}

}  // namespace invgrad
