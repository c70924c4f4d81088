// Where a program writes, and what it draws and shows beside its results: the
// flags of all programs that leave files.
#ifndef BIN_SUPPORT_OUTPUT_OPTIONS_H_
#define BIN_SUPPORT_OUTPUT_OPTIONS_H_

#include <string>

namespace invgrad {

struct OutputOptions {
  std::string output;      // the directory; by default runs/PROGRAM
  bool overwrite = false;  // the files of an earlier run
  bool plots = true;       // draws the pictures
  bool progress = true;    // shows live how the runs are doing
};

// Adds a flag for each field, under its name; progress if it is shown. Call it
// before RunProgram.
void AddOutputFlags(bool shows_progress = true);

// The options of this process.
const OutputOptions& Output();

}  // namespace invgrad

#endif  // BIN_SUPPORT_OUTPUT_OPTIONS_H_
