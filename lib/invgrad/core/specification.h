// Text that a user has written: its parts, and messages about it.
#ifndef INVGRAD_CORE_SPECIFICATION_H_
#define INVGRAD_CORE_SPECIFICATION_H_

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "invgrad/option_set.h"

namespace invgrad {

// Without the space around it, ends of lines included.
std::string_view Trimmed(std::string_view text);

// The trimmed text between the separators; one empty piece for "".
std::vector<std::string> TrimmedPieces(std::string_view text, char separator);

// Whether all of the text is a finite number; a plus sign may be in front.
bool ParseFinite(std::string_view text, double* value);

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
