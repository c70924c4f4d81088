// Start and end of every program.
#ifndef BIN_SUPPORT_PROGRAM_H_
#define BIN_SUPPORT_PROGRAM_H_

#include <string>
#include <vector>

#include "gflags/gflags.h"

namespace invgrad {

// Restarts this program with OPENBLAS_CORETYPE set, with a message on stderr,
// if OpenBLAS runs kernels that are too old for the processor
// (core/blas_kernels.h). If the variable is already set, only prints the
// message. Call it first, because earlier code runs twice.
void UseProcessorsKernels(char** argv);

// Calls UseProcessorsKernels, reads the flags, rejects other arguments, runs
// `run`, and returns its exit code. `usage` describes the program in a line;
// --helpshort prints it with the program's flags.
int RunProgram(int argc, char** argv, const std::string& usage, int (*run)());

// The flags that bin/ defines in this program, its own file and those of
// bin/support that it links; not those of gflags and glog.
std::vector<gflags::CommandLineFlagInfo> ProgramFlags();

// False, with *error "--steps=-1 is out of range; allowed: 0 or more", unless
// the flag's value is allowed.
bool CheckFlag(const char* name,
               bool is_allowed,
               const std::string& allowed,
               std::string* error);

// Prints "PROGRAM: message" to stderr; returns 1, the exit code of bad input.
int Fail(const std::string& message);

// Prints the warning "PROGRAM: message" to stderr.
void Warn(const std::string& message);

}  // namespace invgrad

#endif  // BIN_SUPPORT_PROGRAM_H_
