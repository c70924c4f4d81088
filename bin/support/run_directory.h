// The directory that a run leaves behind: refused if it exists, unless the user
// asked to overwrite or to resume it.
//
//   flags.txt      a gflags flag file that repeats the run
//   versions.txt   what it ran with
#ifndef BIN_SUPPORT_RUN_DIRECTORY_H_
#define BIN_SUPPORT_RUN_DIRECTORY_H_

#include <string>

namespace invgrad {

enum class ExistingDirectory { kRefuse, kOverwrite, kResume };

// Makes `path` (and its parents) and writes flags.txt and versions.txt.
// kOverwrite empties a directory that an earlier run of this library made, and
// refuses any other. kResume wants the flags of the earlier run, but for those
// that steer output and budget. False with *error set if it may not or cannot.
bool PrepareRunDirectory(const std::string& path,
                         ExistingDirectory existing,
                         const std::string& flags,
                         std::string* error);

// The program's flags (program.h), one "--name=value" a line, but for those
// that say what to do with an existing directory.
std::string FlagFileText();

// "half_inverse:truncation=1e-6" -> "half_inverse-truncation-1e-6".
std::string FileName(const std::string& label);

}  // namespace invgrad

#endif  // BIN_SUPPORT_RUN_DIRECTORY_H_
