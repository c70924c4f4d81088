// The state of a run in a file, to resume it: named arrays of doubles.
//
//   void VisitState(StateArchive* archive) {
//     archive->Visit("step", &step_);
//     archive->Visit("weights", &weights_, weights_.size());
//   }
//
// Every class lists its members once, for writing and reading. The file:
//
//   invgrad checkpoint, version 1\n
//   <number of arrays>\n
//   <name> <size>\n            for each, sorted by name
//   all values, little-endian, array after array
//
// Written atomically (atomic_file.h): after a crash during writing, the
// previous checkpoint is intact. Values are restored bit for bit.
//
// Fails:   the first problem of the file, or the first array that is missing or
//          does not fit, sets error(), which names the file; later members are
//          then not changed. Sizes are compared with the length of the file
//          before any allocation.
#ifndef INVGRAD_TRAIN_CHECKPOINT_H_
#define INVGRAD_TRAIN_CHECKPOINT_H_

#include <map>
#include <string>

#include "Eigen/Core"

namespace invgrad {

class StateArchive {
 public:
  // Visit copies the members to the archive.
  StateArchive() = default;
  bool Write(const std::string& path, std::string* error) const;

  // Visit sets the members to the values of the file.
  static StateArchive Read(const std::string& path);

  bool is_reading() const { return is_reading_; }
  // Empty, or the first error.
  const std::string& error() const { return error_; }

  // A prefix of the following names, which have no white space.
  void set_prefix(const std::string& prefix) { prefix_ = prefix; }

  // `size`: the required size; negative: any size.
  void Visit(const std::string& name,
             Eigen::VectorXd* values,
             Eigen::Index size = -1);
  template <typename Number>
  void Visit(const std::string& name, Number* value) {
    Eigen::VectorXd array =
        Eigen::VectorXd::Constant(1, static_cast<double>(*value));
    Visit(name, &array, 1);
    *value = static_cast<Number>(array[0]);
  }

  // Writes a property of the run; when reading, fails if the stored value
  // differs.
  void Expect(const std::string& name, long value);
  // Fails, when reading, if the array does not fit for another reason.
  void Require(bool fits, const std::string& name);

 private:
  void Fail(const std::string& problem);

  bool is_reading_ = false;
  std::string path_;  // of the file that is read
  std::map<std::string, Eigen::VectorXd> arrays_;
  std::string prefix_;
  std::string error_;
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_CHECKPOINT_H_
