// The problems of this repository.
#ifndef PROBLEMS_PROBLEMS_H_
#define PROBLEMS_PROBLEMS_H_

#include "invgrad/compare/compare.h"

namespace invgrad {

// Adds them to the table of problems (compare.h). A new problem is one header
// and one row in problems.cc: listing, conformance tests and docs/problems.md
// follow. Call it at the beginning of main.
void RegisterProblems();

}  // namespace invgrad

#endif  // PROBLEMS_PROBLEMS_H_
