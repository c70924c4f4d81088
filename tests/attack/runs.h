// Random small runs of the programs: every method of the tables, with schedules
// and in phases, with and without shuffling.
#ifndef INVGRAD_TESTS_ATTACK_RUNS_H_
#define INVGRAD_TESTS_ATTACK_RUNS_H_

#include <string>

#include "tests/attack/attack.h"
#include "tests/attack/child.h"

namespace invgrad {

// A NIST file that every run of `estimate` can use.
std::string SmallNistFile();

// A run of some milliseconds into folder/run, which the same command can
// resume if the program can. Input files are written to the folder.
Command AnyRun(const std::string& folder, Dice* dice);

// The command that goes on with the run after it was interrupted: --resume,
// the same command (sweep), or --overwrite.
Command Resumed(Command command);

}  // namespace invgrad

#endif  // INVGRAD_TESTS_ATTACK_RUNS_H_
