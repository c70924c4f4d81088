// Where the sources and the built programs are.
#ifndef INVGRAD_TESTS_SUPPORT_SOURCE_TREE_H_
#define INVGRAD_TESTS_SUPPORT_SOURCE_TREE_H_

#include <string>

namespace invgrad {

std::string SourceDir();  // the root of the repository
std::string BinDir();     // where the build leaves the programs

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SUPPORT_SOURCE_TREE_H_
