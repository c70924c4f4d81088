#include "tests/support/source_tree.h"

namespace invgrad {

std::string SourceDir() { return INVGRAD_SOURCE_DIR; }
std::string BinDir() { return INVGRAD_BIN_DIR; }

}  // namespace invgrad
