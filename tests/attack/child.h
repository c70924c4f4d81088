// A program in bin/ as a child process, with limits on its time and memory, and
// with faults (file_calls.h).
#ifndef INVGRAD_TESTS_ATTACK_CHILD_H_
#define INVGRAD_TESTS_ATTACK_CHILD_H_

#include <optional>
#include <string>
#include <vector>

#include "tests/attack/file_calls.h"

namespace invgrad {

struct Command {
  std::string program;
  std::vector<std::string> arguments;
  std::string folder;  // where it runs; calls that change files elsewhere are
                       // not counted
  std::vector<std::string> environment;  // "NAME=value", besides the parent's
  std::string output;                    // of stdout; empty: Outcome::text
  std::optional<Fault> fault;  // calls are counted only if there is one
  int signal = 0;              // after so many seconds; 0: none
  double signal_after = 0.0;
};

struct Outcome {
  int exit_code = -1;  // -1: ended by a signal
  int signal = 0;
  bool was_late = false;  // killed at the limit of time
  double seconds = 0.0;
  double peak_bytes = 0.0;         // of memory
  std::string text;                // stdout and stderr
  std::vector<std::string> calls;  // those counted
  bool had_fault = false;
};

// Returns after the program and all its children have ended. Fails the test if
// the program was killed for its time or took gigabytes.
Outcome RunChild(const Command& command);

// The command as a line for a shell.
std::string ShellLine(const Command& command);

}  // namespace invgrad

#endif  // INVGRAD_TESTS_ATTACK_CHILD_H_
