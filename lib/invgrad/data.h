// The samples of a learning problem. DataSet stores them, one column each.
// DataSource makes new ones during training; use it where samples are cheap to
// make, and a DataSet in all other cases.
//
// Shapes:  inputs: |a| x N;  contexts: |c| x N;  targets: |y| x N.
#ifndef INVGRAD_DATA_H_
#define INVGRAD_DATA_H_

#include <string>
#include <vector>

#include "Eigen/Core"

namespace invgrad {

struct DataSet {
  Eigen::MatrixXd inputs;    // |a| x N: a
  Eigen::MatrixXd contexts;  // |c| x N: c; 0 x N if none
  Eigen::MatrixXd targets;   // |y| x N: y*
  // |x| x N: solutions x of P(x) = y*, for supervised training; 0 x N if
  // unknown.
  Eigen::MatrixXd solutions;

  // Of a piece of a batch: the number of its first sample in the batch, and the
  // size of the batch; 0: this is the whole batch.
  int first_in_batch = 0;
  int piece_of = 0;

  int num_samples() const { return static_cast<int>(inputs.cols()); }

  // c of a sample; without contexts a null vector of size 0.
  Eigen::Map<const Eigen::VectorXd> Context(int sample) const {
    // An array without rows may have no columns.
    return {contexts.rows() == 0 ? nullptr : contexts.col(sample).data(),
            contexts.rows()};
  }

  // The samples `indices`, in that order.
  DataSet Select(const std::vector<int>& indices) const;

  // The samples first, ..., first + count - 1.
  DataSet Range(int first, int count) const;

  // The same, as a piece: costs are scaled as in the whole batch, and messages
  // number the samples of the whole batch.
  DataSet Piece(int first, int count) const;
  int batch_size() const { return piece_of > 0 ? piece_of : num_samples(); }

  // Returns false if a value is not finite; *error names array, sample and
  // entry.
  bool IsFinite(std::string* error) const;
};

class Model;

// A stream of fresh samples, which are made and not stored. There are new ones
// at each step, or every few steps.
//
// The samples depend on the step alone, so that all methods train on the same
// stream, or also on the weights. A resumed run continues the stream.
class DataSource {
 public:
  virtual ~DataSource() = default;

  // batch_size samples of step k = 0, 1, ..., the first one of a set. `weights`
  // of the model that is trained: those before this step.
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

#endif  // INVGRAD_DATA_H_
