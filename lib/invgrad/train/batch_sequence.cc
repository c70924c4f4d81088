#include "invgrad/train/batch_sequence.h"

#include "invgrad/internal/logging.h"

namespace invgrad {

BatchSequence::BatchSequence(int batch_size,
                             const TrainOptions& options,
                             const Model* model,
                             const TrainingData* data)
    : batch_size_(batch_size),
      shuffles_(options.shuffle),
      model_(*model),
      data_(*data),
      steps_per_epoch_(data->train.num_samples() / batch_size),
      random_(options.seed),
      before_order_(random_) {
  CHECK_GT(steps_per_epoch_, 0);
}

DataSet BatchSequence::Next(long k, const Eigen::VectorXd& weights) {
  if (data_.source != nullptr) return NextOfSource(k, weights);
  const long in_epoch = k % steps_per_epoch_;
  const int first = static_cast<int>(in_epoch) * batch_size_;
  if (!shuffles_) return data_.train.Range(first, batch_size_);
  if (in_epoch == 0) DrawOrder();
  const auto begin = order_.begin() + first;
  return data_.train.Select(std::vector<int>(begin, begin + batch_size_));
}

DataSet BatchSequence::NextOfSource(long k, const Eigen::VectorXd& weights) {
  const DataSource& source = *data_.source;
  const long steps_per_set = source.steps_per_set();
  if (steps_per_set == 1) {
    return source.Batch(k, batch_size_, model_, weights);
  }
  if (k % steps_per_set == 0) set_weights_ = weights;
  if (set_ != k / steps_per_set) {
    set_ = k / steps_per_set;
    set_samples_ = source.Batch(k, batch_size_, model_, set_weights_);
  }
  return set_samples_;
}

void BatchSequence::DrawOrder() {
  before_order_ = random_;
  order_ = random_.Permutation(data_.train.num_samples());
}

void BatchSequence::VisitState(long k, StateArchive* archive) {
  if (shuffles_) {
    const bool is_within_epoch = k % steps_per_epoch_ != 0;
    Eigen::VectorXd random =
        (is_within_epoch ? before_order_ : random_).State();
    archive->Visit("random", &random, random.size());
    if (archive->is_reading() && archive->error().empty()) {
      archive->Require(random_.SetState(random), "random");
      if (is_within_epoch) DrawOrder();
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
