// The table of command lines that are wrong, and what to make wrong ones of.
#ifndef INVGRAD_TESTS_ATTACK_COMMAND_LINES_H_
#define INVGRAD_TESTS_ATTACK_COMMAND_LINES_H_

#include <string>
#include <vector>

namespace invgrad {

// A NIST file in.dat is in the folder if a row names it. In `prepare` and `line`, $C is a comparison and $E an estimation of some
// milliseconds.
struct CommandLineRow {
  std::string prepare;  // for a shell in an empty folder; programs are in PATH
  std::string line;     // program and arguments; 'quoted' ones may have spaces
  int exit_code;        // docs/programs.md
  std::string says;     // a part of the message
  std::string output = {};  // where stdout goes; empty: to the message
  std::vector<std::string> environment = {};
};

const std::vector<CommandLineRow>& CommandLineRows();

// For each program, a run of milliseconds that one more flag may change.
struct SmallRun {
  std::string program;
  std::vector<std::string> arguments;
  std::string input;  // the name of the NIST file that it reads, or empty
};

const std::vector<SmallRun>& SmallRuns();

const std::vector<std::string>& GarbageValues();

}  // namespace invgrad

#endif  // INVGRAD_TESTS_ATTACK_COMMAND_LINES_H_
