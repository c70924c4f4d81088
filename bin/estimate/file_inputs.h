// Files as inputs of EstimateMain (compare.h), beside registered problems. A
// program that reads files sets this; the component reads none.
#ifndef BIN_ESTIMATE_FILE_INPUTS_H_
#define BIN_ESTIMATE_FILE_INPUTS_H_

#include <string>
#include <vector>

#include "bin/estimate/estimation_comparison.h"

namespace invgrad {

struct FileInputs {
  void (*add_flags)() = nullptr;
  // Formats and models, for --list.
  std::string (*list)() = nullptr;
  // Adds the inputs that the flags name, if any, and sets those options that are
  // for files alone.
  bool (*read)(EstimationOptions* options,
               std::vector<EstimationInput>* inputs,
               std::string* error) = nullptr;
};

// At the beginning of main.
void SetFileInputs(const FileInputs& files);

}  // namespace invgrad

#endif  // BIN_ESTIMATE_FILE_INPUTS_H_
