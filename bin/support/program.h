// What every program does first and last.
#ifndef BIN_SUPPORT_PROGRAM_H_
#define BIN_SUPPORT_PROGRAM_H_

#include <string>

namespace invgrad {

// Reads the flags, refuses other arguments, runs `run`, and returns its exit
// code. `usage` says in a line what the program is for.
int RunProgram(int argc, char** argv, const std::string& usage, int (*run)());

// Prints "PROGRAM: message" to stderr; returns 1, the exit code of bad input.
int Fail(const std::string& message);

// Prints "PROGRAM: message" to stderr, for what is no reason to stop.
void Warn(const std::string& message);

}  // namespace invgrad

#endif  // BIN_SUPPORT_PROGRAM_H_
