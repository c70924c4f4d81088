// What the program registration has found: tables, files and pictures.
//
//   DIR/table.txt, .md     after the last scan: the medians of the seeds
//   DIR/drift.csv          after each scan
//   DIR/trajectories.png   the paths in the scene, from above
//   DIR/determined.png, undetermined.png   the drift of positions
//
// The pictures show the first seed in the first unit.
#ifndef BIN_REGISTRATION_RESULTS_H_
#define BIN_REGISTRATION_RESULTS_H_

#include <string>
#include <vector>

#include "bin/registration/track.h"

namespace invgrad {

struct RegistrationRun {
  Scene scene;
  std::string method;
  std::string unit;
  int seed = 0;
  Track track;
};

// Prints the table, and writes all files to the run's directory. The runs of a
// scene, method and unit follow one another. Returns false, with *error, if a
// file cannot be written.
bool WriteRegistrationResults(const std::string& folder,
                              const std::vector<RegistrationRun>& runs,
                              std::string* error);

}  // namespace invgrad

#endif  // BIN_REGISTRATION_RESULTS_H_
