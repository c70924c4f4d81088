// The output directory of a run, and its flags --output and --overwrite. A
// program has these flags if it uses this file.
//
//   flags.txt      a gflags flag file that repeats the run
//   versions.txt   versions of program and libraries
#ifndef BIN_SUPPORT_RUN_DIRECTORY_H_
#define BIN_SUPPORT_RUN_DIRECTORY_H_

#include <string>

#include "gflags/gflags.h"

DECLARE_string(output);
DECLARE_bool(overwrite);

namespace invgrad {

// The treatment of a directory that is not empty. kRefuse: fail. kOverwrite:
// empty it, if an earlier run made it. kResume: keep it, if the earlier run had
// the same flags, except for output and budget.
enum class ExistingDirectory { kRefuse, kOverwrite, kResume };

// Makes `path` (and its parents) and writes flags.txt and versions.txt. Returns
// false, with *error set, if that fails or is not allowed.
bool PrepareRunDirectory(const std::string& path,
                         ExistingDirectory existing,
                         const std::string& flags,
                         std::string* error);

// The same for --output, by default runs/PROGRAM, with the program's flags.
// --overwrite takes precedence over `existing`.
bool PrepareRunDirectory(ExistingDirectory existing, std::string* error);

// Makes the directory and its parents.
bool MakeDirectories(const std::string& path, std::string* error);

// "half_inverse:truncation=1e-6" -> "half_inverse-truncation-1e-6".
std::string FileName(const std::string& label);

}  // namespace invgrad

#endif  // BIN_SUPPORT_RUN_DIRECTORY_H_
