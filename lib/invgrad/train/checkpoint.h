// Named arrays of doubles in one file: all that a run needs to go on.
//
//   invgrad checkpoint, version 1\n
//   <number of arrays>\n
//   <name> <size>\n            for each, sorted by name
//   all values, little-endian, array after array
//
// Written atomically (atomic_file.h): a run that is killed while it writes
// finds its previous checkpoint. Values come back bit for bit.
//
// Fails:   returns false with a message that names the file and what is wrong
//          with it; *checkpoint is then unchanged. Sizes that disagree with the
//          length of the file are refused before anything is allocated. CHECKs
//          that names are not empty and have no white space.
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
