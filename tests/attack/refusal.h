// What holds for a program that is given anything.
#ifndef INVGRAD_TESTS_ATTACK_REFUSAL_H_
#define INVGRAD_TESTS_ATTACK_REFUSAL_H_

#include <string>
#include <vector>

#include "tests/attack/child.h"

namespace invgrad {

// Runs the command and expects:
// - it ends by itself, in time, with an exit code of docs/programs.md, and
//   without gigabytes (RunChild);
// - its messages are short, printable, and no internal error;
// - if it refuses its input, a message has one of `names` (if there are any),
//   and the folder is as before (unless the message is "cannot write ...");
// - no file called "keep" is lost.
Outcome RunOrRefuse(const Command& command,
                    const std::vector<std::string>& names);

}  // namespace invgrad

#endif  // INVGRAD_TESTS_ATTACK_REFUSAL_H_
