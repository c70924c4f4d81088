// Writes the members of a run to a checkpoint, or reads them: every class lists
// its members once, for both directions.
//
//   void VisitState(StateArchive* archive) {
//     archive->Visit("step", &step_);
//     archive->Visit("weights", &weights_, weights_.size());
//   }
//
// Fails:   the first array that is missing or does not fit sets the error;
//          later members are then not changed. The caller discards the members
//          that were read.
#ifndef INVGRAD_TRAIN_STATE_ARCHIVE_H_
#define INVGRAD_TRAIN_STATE_ARCHIVE_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/train/checkpoint.h"

namespace invgrad {

class StateArchive {
 public:
  // Writes to an empty checkpoint, or reads from one.
  enum class Mode { kWrite, kRead };
  StateArchive(Mode mode, Checkpoint* checkpoint)
      : mode_(mode), checkpoint_(*checkpoint) {}

  bool is_reading() const { return mode_ == Mode::kRead; }

  // A prefix of the following names.
  void set_prefix(const std::string& prefix) { prefix_ = prefix; }

  void Visit(const std::string& name, double* value);
  void Visit(const std::string& name, long* value);
  void Visit(const std::string& name, int* value);
  void Visit(const std::string& name, std::vector<int>* values);
  // `size`: the required size; negative: any size.
  void Visit(const std::string& name,
             Eigen::VectorXd* values,
             Eigen::Index size = -1);

  // Writes a property of the run; when reading, fails if the stored value
  // differs.
  void Expect(const std::string& name, long value);
  // Fails, when reading, if the array does not fit for another reason.
  void Require(bool fits, const std::string& name);

  // Empty, or the first error.
  const std::string& error() const { return error_; }

 private:
  const Mode mode_;
  Checkpoint& checkpoint_;
  std::string prefix_;
  std::string error_;
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_STATE_ARCHIVE_H_
