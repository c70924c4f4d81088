// The batches of a phase, step after step.
//
//   with a data source   what it gives for the step
//   shuffled             consecutive samples of the epoch's order
//   otherwise            consecutive samples
//
// A batch has `batch_size` samples; an incomplete last one of an epoch is left out.
#ifndef INVGRAD_TRAIN_BATCH_SEQUENCE_H_
#define INVGRAD_TRAIN_BATCH_SEQUENCE_H_

#include <vector>

#include "Eigen/Core"
#include "invgrad/random.h"
#include "invgrad/train.h"
#include "invgrad/train/checkpoint.h"

namespace invgrad {

class BatchSequence {
 public:
  // Model and data must outlive the sequence. Uses shuffle and seed of the options.
  BatchSequence(int batch_size,
                const TrainOptions& options,
                const Model* model,
                const TrainingData* data);

  long steps_per_epoch() const { return steps_per_epoch_; }
  // Whether each batch has samples that the step before was not computed from.
  bool has_new_samples() const {
    return data_.source != nullptr || batch_size_ < data_.train.num_samples();
  }

  // The samples of step k from the weights; k grows by one from call to call.
  DataSet Next(long k, const Eigen::VectorXd& weights);

  // Before step k.
  void VisitState(long k, StateArchive* archive);

 private:
  DataSet NextOfSource(long k, const Eigen::VectorXd& weights);
  void DrawOrder();

  const int batch_size_;
  const bool shuffles_;
  const Model& model_;
  const TrainingData& data_;
  const long steps_per_epoch_;

  NumpyRandom random_;
  // Of the current epoch, if shuffled, and the random numbers before it.
  std::vector<int> order_;
  NumpyRandom before_order_;
  // Of a source whose samples serve several steps: the weights before the first
  // one, the number of the set, and its samples.
  Eigen::VectorXd set_weights_;
  long set_ = -1;
  DataSet set_samples_;
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_BATCH_SEQUENCE_H_
