// What a run depends on that its flags do not say.
#ifndef BIN_SUPPORT_VERSIONS_H_
#define BIN_SUPPORT_VERSIONS_H_

#include <istream>
#include <string>
#include <utility>
#include <vector>

namespace invgrad {

// The first model name of /proc/cpuinfo; "unknown" if it has none.
std::string CpuName(std::istream& cpuinfo);

// Versions of program and libraries, kernels and threads of BLAS, compiler and
// processor: names and values.
std::vector<std::pair<std::string, std::string>> Versions();

// The same, a line each.
std::string VersionsText();

// "1a2b3c4", with "-dirty" if the checkout had other changes: what the build
// wrote beside the program. Empty: unknown, as in an installed program.
std::string CommitOfBuild();

}  // namespace invgrad

#endif  // BIN_SUPPORT_VERSIONS_H_
