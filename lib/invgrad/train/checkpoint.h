// Named arrays of doubles in one file: the state to resume a run.
//
//   invgrad checkpoint, version 1\n
//   <number of arrays>\n
//   <name> <size>\n            for each, sorted by name
//   all values, little-endian, array after array
//
// Written atomically (atomic_file.h): after a crash during writing, the
// previous checkpoint is intact. Values are restored bit for bit.
//
// Fails:   returns false with a message that names the file and the error;
//          *checkpoint is then unchanged. Sizes are compared with the length of
//          the file before any allocation. CHECKs that names are not empty and
//          have no white space.
#ifndef INVGRAD_TRAIN_CHECKPOINT_H_
#define INVGRAD_TRAIN_CHECKPOINT_H_

#include <map>
#include <string>

#include "Eigen/Core"

namespace invgrad {

struct Checkpoint {
  std::map<std::string, Eigen::VectorXd> arrays;
};

bool WriteCheckpoint(const std::string& path,
                     const Checkpoint& checkpoint,
                     std::string* error);
bool ReadCheckpoint(const std::string& path,
                    Checkpoint* checkpoint,
                    std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_CHECKPOINT_H_
