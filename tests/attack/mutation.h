// What may become of a file: flipped bits, lost ends, numbers out of range.
#ifndef INVGRAD_TESTS_ATTACK_MUTATION_H_
#define INVGRAD_TESTS_ATTACK_MUTATION_H_

#include <string>

#include "tests/attack/attack.h"

namespace invgrad {

// One to four random changes; differs from `bytes`.
std::string Mutated(const std::string& bytes, Dice* dice);

// Makes `path`, which may exist, something that is no file with content: a
// pipe, a folder, a loop of links, a device without end, or 6 GB of zeros.
// Returns what.
std::string MakeStrange(const std::string& path, Dice* dice);

}  // namespace invgrad

#endif  // INVGRAD_TESTS_ATTACK_MUTATION_H_
