#include "invgrad/train/batch_sequence.h"

#include "invgrad/internal/logging.h"

namespace invgrad {

BatchSequence::BatchSequence(const TrainOptions& options,
                             const Model* model,
                             const TrainingData* data)
    : shuffles_(options.shuffle),
      model_(*model),
      data_(*data),
      random_(options.seed),
      before_order_(random_) {}

DataSet BatchSequence::Next(long k,
                            int batch_size,
                            const Eigen::VectorXd& weights) {
  if (data_.source != nullptr) return NextOfSource(k, batch_size, weights);
  const int num_samples = data_.train.num_samples();
  CHECK_LE(batch_size, num_samples);
  const bool begins_epoch = first_ + batch_size > num_samples;
  if (begins_epoch) first_ = 0;
  if (shuffles_ && (begins_epoch || order_.empty())) DrawOrder();
  const int first = first_;
  first_ += batch_size;
  if (!shuffles_) return data_.train.Range(first, batch_size);
  const auto begin = order_.begin() + first;
  return data_.train.Select(std::vector<int>(begin, begin + batch_size));
}

DataSet BatchSequence::NextOfSource(long k,
                                    int batch_size,
                                    const Eigen::VectorXd& weights) {
  const DataSource& source = *data_.source;
  const long steps_per_set = source.steps_per_set();
  if (steps_per_set == 1) {
    return source.Batch(k, batch_size, model_, weights);
  }
  // A step that is repeated, from other weights, has the same samples.
  if (set_ != k / steps_per_set) {
    set_ = k / steps_per_set;
    if (k % steps_per_set == 0) set_weights_ = weights;
    set_samples_ =
        source.Batch(set_ * steps_per_set, batch_size, model_, set_weights_);
  }
  return set_samples_;
}

void BatchSequence::DrawOrder() {
  before_order_ = random_;
  order_ = random_.Permutation(data_.train.num_samples());
}

void BatchSequence::VisitState(long k, StateArchive* archive) {
  archive->Visit("first_of_batch", &first_);
  archive->Require(first_ <= data_.train.num_samples(), "first_of_batch");
  if (shuffles_) {
    int has_order = order_.empty() ? 0 : 1;
    archive->Visit("has_order", &has_order);
    Eigen::VectorXd random = before_order_.State();
    archive->Visit("random", &random, random.size());
    if (archive->is_reading() && archive->error().empty()) {
      archive->Require(random_.SetState(random), "random");
      if (has_order == 1) DrawOrder();
    }
  }
  if (data_.source != nullptr && data_.source->steps_per_set() > 1) {
    archive->Visit("set_weights", &set_weights_);
    archive->Require((set_weights_.size() == 0 && k == 0) ||
                         (set_weights_.size() == model_.num_weights() &&
                          set_weights_.allFinite()),
                     "set_weights");
  }
}

}  // namespace invgrad
