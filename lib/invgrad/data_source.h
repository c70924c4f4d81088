// A stream of fresh samples, which are made and not stored: each step has new
// ones, or every few steps.
//
// The samples are a function of the step, so that all methods train on the same
// stream, or also of the weights. A resumed run continues the stream.
#ifndef INVGRAD_DATA_SOURCE_H_
#define INVGRAD_DATA_SOURCE_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/data_set.h"

namespace invgrad {

class Model;

class DataSource {
 public:
  virtual ~DataSource() = default;

  // The samples of step k = 0, 1, ...  `weights` of the model that is trained:
  // those before the first step of the set of samples that k belongs to.
  virtual DataSet Batch(long step,
                        int batch_size,
                        const Model& model,
                        const Eigen::VectorXd& weights) const = 0;
  // A set of samples serves the steps k with the same k / steps_per_set().
  virtual long steps_per_set() const { return 1; }

  // Whether batches have as many samples as the training data.
  virtual bool needs_whole_batches() const { return false; }

  // What determines the stream, to recognize a run: "heat, seed 0".
  virtual std::string Name() const = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_DATA_SOURCE_H_
