// Finds published data, which are not part of this repository: in the folder
// that the environment variable INVGRAD_DATA names, else in ../shared/data
// beside the sources.
//
//   const std::string path = PublishedData("g2o/M3500.g2o");
//   if (path.empty()) GTEST_SKIP() << "https://... has it";
#ifndef INVGRAD_TESTS_PUBLISHED_DATA_H_
#define INVGRAD_TESTS_PUBLISHED_DATA_H_

#include <cstdlib>
#include <filesystem>
#include <string>

#include "tests/support/source_tree.h"

namespace invgrad {

// Empty if it is not there.
inline std::string PublishedData(const std::string& name) {
  const char* folder = std::getenv("INVGRAD_DATA");
  const std::string path =
      (folder != nullptr ? std::string(folder)
                         : SourceDir() + "/../shared/data") +
      "/" + name;
  std::error_code ignored;
  return std::filesystem::exists(path, ignored) ? path : "";
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_PUBLISHED_DATA_H_
