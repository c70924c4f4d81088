// What a run depends on that its flags do not say.
#ifndef BIN_SUPPORT_VERSIONS_H_
#define BIN_SUPPORT_VERSIONS_H_

#include <string>

namespace invgrad {

// Versions of program and libraries, kernels and threads of BLAS, compiler and
// processor, a line each.
std::string VersionsText();

}  // namespace invgrad

#endif  // BIN_SUPPORT_VERSIONS_H_
