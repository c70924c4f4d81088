// Flags bound to the fields of a program's options, so that only main's
// function knows of flags.
#ifndef BIN_SUPPORT_FLAGS_H_
#define BIN_SUPPORT_FLAGS_H_

#include "gflags/gflags.h"

namespace invgrad {

// Adds the flag --NAME, whose value is *value, and whose default is what is in
// it now. Call it before RunProgram. gflags keeps all three pointers until the
// program ends: `name` and `help` are literals.
template <typename Value>
void AddFlag(const char* name, Value* value, const char* help) {
  // What a DEFINE_ at the beginning of this file would do.
  gflags::FlagRegisterer(name, help, __FILE__, value, new Value(*value));
}

}  // namespace invgrad

#endif  // BIN_SUPPORT_FLAGS_H_
