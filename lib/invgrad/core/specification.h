// Parses specifications such as "half_inverse:step_size=auto:rho=1".
//
// A specification is a name and settings, separated by colons; commas separate
// specifications. Space around the pieces is ignored.
#ifndef INVGRAD_CORE_SPECIFICATION_H_
#define INVGRAD_CORE_SPECIFICATION_H_

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "invgrad/option_set.h"

namespace invgrad {

struct Specification {
  std::string text;  // as it was written
  std::string name;
  Settings settings;
};

// Splits "a:x=1:y=2,b". Returns false, with *error, for an empty name, a
// setting without '=', or an empty key.
bool ParseSpecifications(const std::string& text,
                         std::vector<Specification>* specifications,
                         std::string* error);

// "unknown rule 'adm'; did you mean adam?" names up to three candidates, nearest
// by edit distance first. If none is near enough to be a misspelling: "unknown
// rule 'q'; known: adam, newton".
std::string UnknownNameMessage(const std::string& what,
                               const std::string& name,
                               const std::vector<std::string>& candidates);

// Text of a user or of a file for a message: bytes that are no printable ASCII
// become "\x1b", and what is longer than `max_size` bytes is cut with "...".
std::string Printable(std::string_view text, std::size_t max_size = 200);

}  // namespace invgrad

#endif  // INVGRAD_CORE_SPECIFICATION_H_
