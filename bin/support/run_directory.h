// The directory of a run: when it may be reused, and what it holds.
//
//   flags.txt      a gflags flag file that repeats the run; its comments name
//                  the program and what else determines the run
//   versions.txt   versions of program and libraries
//   files.txt      the names of the files that the run writes
//
// The directory is that of Output() (output_options.h).
#ifndef BIN_SUPPORT_RUN_DIRECTORY_H_
#define BIN_SUPPORT_RUN_DIRECTORY_H_

#include <string>
#include <string_view>

#include "invgrad/train/run_identity.h"

namespace invgrad {

// The treatment of a directory that is not empty. kRefuse: fail. kOverwrite:
// remove the files of the run that made it; fail if it holds any other file, or
// the current directory. kResume: keep it, if that run had the same flags and
// identity, except for output and a budget that is not larger.
enum class ExistingDirectory { kRefuse, kOverwrite, kResume };

// Makes `path` (and its parents) and writes flags.txt and versions.txt. Returns
// false, with *error set, if that fails or is not allowed; nothing is then
// changed. A kill leaves a directory that can be resumed or overwritten.
bool PrepareRunDirectory(const std::string& path,
                         ExistingDirectory existing,
                         const RunIdentity& identity,
                         const std::string& flags,
                         std::string* error);

// The same for --output, with the program's flags. --overwrite takes precedence
// over `existing`.
bool PrepareRunDirectory(ExistingDirectory existing,
                         const RunIdentity& identity,
                         std::string* error);
inline bool PrepareRunDirectory(ExistingDirectory existing,
                                std::string* error) {
  return PrepareRunDirectory(existing, RunIdentity(), error);
}

// Returns false, with *error, if --resume is given beside --overwrite.
bool CheckResume(bool resume, std::string* error);

// For a process beside others that write parts of the same run: checks that
// --output is the directory of a run with these flags and this identity, as
// kResume does, and changes nothing.
bool JoinRunDirectory(const RunIdentity& identity, std::string* error);

// "OUTPUT/NAME"
std::string InOutput(const std::string& name);

// Adds the path to files.txt if it is in the run's directory. Call it before
// making a file there or the file's folder: --overwrite removes no others.
// Returns false, with *error set, if files.txt cannot be written.
bool ListRunFile(const std::string& path, std::string* error);

// Lists the file, and writes it (io/atomic_file.h).
bool WriteRunFile(const std::string& path,
                  std::string_view bytes,
                  std::string* error);

// Makes the directory and its parents.
bool MakeDirectories(const std::string& path, std::string* error);

}  // namespace invgrad

#endif  // BIN_SUPPORT_RUN_DIRECTORY_H_
