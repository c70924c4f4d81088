// The state of a run in a file, to resume it: named arrays of doubles.
//
//   void VisitState(StateArchive* archive) {
//     archive->Visit("step", &step_);
//     archive->Visit("weights", &weights_, weights_.size());
//   }
//
// Every class lists its members once, for writing and reading. The file:
//
//   invgrad checkpoint, version 10\n
//   <digest of all bytes after this line>\n    digest.h
//   <name>: <value>\n          for each part of the run's identity
//   \n
//   <number of arrays>\n
//   <name> <size>\n            for each, sorted by name
//   all values, little-endian, array after array
//
// Written atomically (atomic_file.h): after a crash during writing, the
// previous checkpoint is intact. Values are restored bit for bit.
//
// Fails:   the first problem of the file (another run's, damaged), or the first
//          array that is missing or does not fit, sets error(), which names the
//          file; later members are then not changed. Identity and sizes are
//          checked before the values are read.
#ifndef INVGRAD_TRAIN_CHECKPOINT_H_
#define INVGRAD_TRAIN_CHECKPOINT_H_

#include <algorithm>
#include <limits>
#include <map>
#include <string>

#include "Eigen/Core"
#include "invgrad/train/run_identity.h"

namespace invgrad {

// Whether all values are integers in [0, max], with max <= 2^53.
bool AreCounts(const Eigen::VectorXd& values, double max = 9007199254740992.0);

class StateArchive {
 public:
  // Visit copies the members to the archive.
  StateArchive() = default;
  bool Write(const std::string& path,
             const RunIdentity& identity,
             std::string* error) const;

  // Visit sets the members to the values of the file, which must be of the same
  // run.
  static StateArchive Read(const std::string& path,
                           const RunIdentity& identity);

  bool is_reading() const { return is_reading_; }
  // Empty, or the first error.
  const std::string& error() const { return error_; }

  // A prefix of the following names, which have no white space.
  void set_prefix(const std::string& prefix) { prefix_ = prefix; }

  // `size`: the required size; negative: any size.
  void Visit(const std::string& name,
             Eigen::VectorXd* values,
             Eigen::Index size = -1);
  void Visit(const std::string& name, double* value);
  // An integer >= 0.
  template <typename Integer>
  void Visit(const std::string& name, Integer* value) {
    constexpr double kMax = std::min<double>(
        9007199254740992.0,
        static_cast<double>(std::numeric_limits<Integer>::max()));
    Eigen::VectorXd array =
        Eigen::VectorXd::Constant(1, static_cast<double>(*value));
    Visit(name, &array, 1);
    Require(AreCounts(array, kMax), name);
    if (error_.empty()) *value = static_cast<Integer>(array[0]);
  }

  // Fails, when reading, if the array does not fit for another reason.
  void Require(bool fits, const std::string& name);
  void Fail(const std::string& problem);

 private:
  bool is_reading_ = false;
  std::string path_;  // of the file that is read
  std::map<std::string, Eigen::VectorXd> arrays_;
  std::string prefix_;
  std::string error_;
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_CHECKPOINT_H_
