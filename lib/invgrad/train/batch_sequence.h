// The batches of a phase, step after step.
//
//   with a data source   what it gives for the step
//   shuffled             consecutive samples of the epoch's order
//   otherwise            consecutive samples
//
// Batches may differ in size. The samples at the end of an epoch that do not fill
// a batch are left out.
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
  BatchSequence(const TrainOptions& options,
                const Model* model,
                const TrainingData* data);

  // Whether a data source makes other samples for each step.
  bool is_fresh() const {
    return data_.source != nullptr && data_.source->steps_per_set() == 1;
  }

  // The next samples, of step k from the weights. With a data source k says
  // which they are.
  DataSet Next(long k, int batch_size, const Eigen::VectorXd& weights);

  // Before step k.
  void VisitState(long k, StateArchive* archive);

 private:
  DataSet NextOfSource(long k, int batch_size, const Eigen::VectorXd& weights);
  void DrawOrder();

  const bool shuffles_;
  const Model& model_;
  const TrainingData& data_;

  int first_ = 0;  // of the next batch, in the epoch
  NumpyRandom random_;
  // Of the current epoch, if shuffled, and the random numbers before it; empty
  // before the first batch.
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
