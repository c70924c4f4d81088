// What every program does first and last.
#ifndef BIN_SUPPORT_PROGRAM_H_
#define BIN_SUPPORT_PROGRAM_H_

#include <string>
#include <vector>

#include "gflags/gflags.h"

namespace invgrad {

// Starts this program again, with OPENBLAS_CORETYPE set, if OpenBLAS runs kernels
// that are too old for the processor (core/blas_kernels.h); says so on stderr.
// Where the variable is set already, only says that the kernels are too old.
// Must be called first: what ran before it runs twice.
void UseProcessorsKernels(char** argv);

// Calls UseProcessorsKernels, reads the flags, refuses other arguments, runs `run`, and returns its exit
// code. `usage` says in a line what the program is for; --helpshort prints it
// with the program's flags.
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

// Prints "PROGRAM: message" to stderr, for what is no reason to stop.
void Warn(const std::string& message);

}  // namespace invgrad

#endif  // BIN_SUPPORT_PROGRAM_H_
