// Start and end of every program, and the values of its flags.
#ifndef BIN_SUPPORT_PROGRAM_H_
#define BIN_SUPPORT_PROGRAM_H_

#include <string>
#include <utility>
#include <vector>

#include "gflags/gflags.h"
#include "invgrad/option_set.h"

namespace invgrad {

// Restarts this program with OPENBLAS_CORETYPE set, with a message on stderr,
// if OpenBLAS runs kernels that are too old for the processor
// (blas_kernels.h). If the variable is already set, only prints the
// message. Call it first, because earlier code runs twice.
void UseProcessorsKernels(char** argv);

// Counts successful and failed runs, for the exit code. A run that diverged has
// failed; one that used up its budget has worked.
struct RunCounts {
  int num_worked = 0;
  int num_failed = 0;

  void Add(bool has_worked) { ++(has_worked ? num_worked : num_failed); }
};

// Calls UseProcessorsKernels, reads the flags, rejects other arguments, and
// calls `run`. --helpshort prints `usage`, a line about the program, the exit
// codes and the program's flags. Returns the exit code:
//
//   0         no run failed
//   1         `run` returned false, and *error is printed: bad flags or input,
//             or results that cannot be written
//   2         some runs failed
//   3         all runs failed
//   128 + n   signal n ended the program (report/interrupt.h); what was
//             complete is in tables and files
int RunProgram(int argc,
               char** argv,
               const std::string& usage,
               bool (*run)(RunCounts* counts, std::string* error));

// The flags that bin/ defines in this program, its own file and those of
// bin/support that it links; not those of gflags and glog.
std::vector<gflags::CommandLineFlagInfo> ProgramFlags();

// Return false, with *error "--steps=-1 is out of range; allowed: [0, inf)",
// for the first flag whose value is not allowed. Defaults are allowed; ranges
// include their lower ends.
bool CheckFlags(const std::vector<std::pair<const char*, Range>>& ranges,
                std::string* error);
bool CheckFlag(const char* name,
               const std::vector<std::string>& choices,
               std::string* error);

// Returns false, with *error "--NAME=VALUE `why`", for the first of these flags
// that the program has and whose value is not the default.
bool CheckNotGiven(const std::vector<std::string>& names,
                   const std::string& why,
                   std::string* error);

// Returns `is_valid`; if it is false, *error then begins with "--NAME: ".
bool NameFlag(const char* name, bool is_valid, std::string* error);

// parse(text of the flag, value, error) under that name.
template <typename Parse, typename Value>
bool ParseFlag(const char* name,
               Parse parse,
               Value* value,
               std::string* error) {
  const std::string text =
      gflags::GetCommandLineFlagInfoOrDie(name).current_value;
  return NameFlag(name, parse(text, value, error), error);
}

// The items of a comma-separated list.
std::vector<std::string> SplitList(const std::string& list);

// "1,2,5", "1..20" or "1,2,...,20": 1 to 10000 different integers from 0 to
// 2^31 - 1.
bool ParseSeeds(const std::string& text,
                std::vector<int>* seeds,
                std::string* error);

// "1e-3,1e-4": positive numbers; may be empty.
bool ParseNumbers(const std::string& text,
                  std::vector<double>* numbers,
                  std::string* error);

// A word of a command as a shell reads it, in single quotes where it needs them.
std::string QuoteForShell(const std::string& word);

// Prints the warning "PROGRAM: message" to stderr, without control characters,
// and of words at most 300 bytes.
void Warn(const std::string& message);

// From now on Warn and UseProcessorsKernels print nothing in this process.
void SilenceMessages();

}  // namespace invgrad

#endif  // BIN_SUPPORT_PROGRAM_H_
