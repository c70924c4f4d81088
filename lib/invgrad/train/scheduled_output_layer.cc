#include "invgrad/train/scheduled_output_layer.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "invgrad/output_layer/share.h"

namespace invgrad {

using Eigen::VectorXd;

ScheduledOutputLayer::ScheduledOutputLayer(
    std::unique_ptr<BatchObjective> whole,
    const OutputLayerSchedule& schedule,
    const Model* model,
    const TrainingData* data)
    : ReducedObjective(std::move(whole),
                       model,
                       schedule.after_each_step ? nullptr : &data->train),
      schedule_(schedule),
      model_(*model),
      data_(*data),
      fall_(schedule.after_each_step ? SteadyFall::kLeastCountOfAll
                                     : SteadyFall::kLeastCountOfShares) {}

bool ScheduledOutputLayer::Prepare(long k,
                                   double spent,
                                   const DataSet& batch,
                                   VectorXd* weights,
                                   std::string* error) {
  spent_ = spent;
  return of_batch() ? PrepareBatch(k, batch, weights, error)
                    : PrepareShare(k, batch, weights, error);
}

bool ScheduledOutputLayer::PrepareBatch(long k,
                                        const DataSet& batch,
                                        VectorXd* weights,
                                        std::string* error) {
  const bool is_new_set =
      data_.source != nullptr && k % data_.source->steps_per_set() == 0;
  if ((k == 0 || is_new_set) && !SolveOutputLayer(batch, weights, error)) {
    return false;
  }
  if (ReadsLoss()) fall_.Add(spent_, MeanLoss(model_, *weights, batch));
  return true;
}

bool ScheduledOutputLayer::PrepareShare(long k,
                                        const DataSet& batch,
                                        VectorXd* weights,
                                        std::string* error) {
  if (k % schedule_.period != 0) return true;
  Blocks share;
  const bool has_share =
      data_.source == nullptr
          ? TrainingShare(k / schedule_.period, &share, error)
          : Split(FreshSamples(k, batch, *weights), &share, error);
  if (!has_share) return false;
  if (ReadsLoss()) fall_.Add(spent_, LossOnShare(share, *weights));
  return SolveOnShare(share, /*steps_follow=*/true, weights, error);
}

DataSet ScheduledOutputLayer::FreshSamples(long k,
                                           const DataSet& batch,
                                           const VectorXd& weights) const {
  if (data_.source->needs_whole_batches()) return batch;
  const int size = SamplesOfShare(model_, is_proxy());
  return data_.source->Batch(
      k, std::max(size, schedule_.batch_size), model_, weights);
}

double ScheduledOutputLayer::LossOnShare(const Blocks& share,
                                         const VectorXd& weights) {
  VectorXd best = weights;
  std::string ignored;
  if (!SolveOnShare(share, /*steps_follow=*/false, &best, &ignored)) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  double sum = 0.0;
  int num_samples = 0;
  for (const DataSet& block : share) {
    sum += MeanLoss(model_, best, block) * block.num_samples();
    num_samples += block.num_samples();
  }
  return sum / num_samples;
}

VectorXd ScheduledOutputLayer::Finished(const VectorXd& weights) {
  VectorXd finished = weights;
  std::string ignored;
  if (data_.source == nullptr) {
    SolveOutputLayer(data_.train, &finished, &ignored);
  }
  return finished;
}

std::vector<VectorXd*> ScheduledOutputLayer::MutableState() {
  std::vector<VectorXd*> state = ReducedObjective::MutableState();
  if (schedule_.watches_fall) state.push_back(fall_.mutable_state());
  return state;
}

}  // namespace invgrad
