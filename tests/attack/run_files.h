// The files of a run, and which of them must repeat bit for bit.
#ifndef INVGRAD_TESTS_ATTACK_RUN_FILES_H_
#define INVGRAD_TESTS_ATTACK_RUN_FILES_H_

#include <map>
#include <string>
#include <vector>

namespace invgrad {

// Path relative to a folder -> content; folders, links, pipes -> what they are.
using Files = std::map<std::string, std::string>;

// Empty if the folder does not exist.
Files ReadFiles(const std::string& folder);
// Makes the folder have exactly these files, which are all regular.
void WriteFiles(const Files& files, const std::string& folder);

// Weights, networks, histories, results and estimates, without their times.
Files Results(const Files& files);

// Files of writers that did not end.
std::vector<std::string> TemporaryFiles(const Files& files);

// Empty, or the first difference: "weights.npy is missing", "... differs".
std::string FindDifference(const Files& files, const Files& expected);

}  // namespace invgrad

#endif  // INVGRAD_TESTS_ATTACK_RUN_FILES_H_
