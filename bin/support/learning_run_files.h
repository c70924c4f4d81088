// The files of a training run, which learning_run.h describes.
#ifndef BIN_SUPPORT_LEARNING_RUN_FILES_H_
#define BIN_SUPPORT_LEARNING_RUN_FILES_H_

#include <string>
#include <vector>

#include "bin/support/learning_run.h"
#include "invgrad/train/run_identity.h"

namespace invgrad {

// Adds all of them to the files of the program's run (run_directory.h).
bool ListRunFiles(const std::string& directory, std::string* error);

// Writes all but the checkpoint; no result.txt if the run was interrupted.
bool WriteRunFiles(const std::string& directory,
                   const Network& network,
                   const LearningRunResult& result,
                   const RunIdentity& identity,
                   const std::vector<NeuronStatistics>& final_neurons,
                   std::string* error);

}  // namespace invgrad

#endif  // BIN_SUPPORT_LEARNING_RUN_FILES_H_
