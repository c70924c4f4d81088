// A folder for one test, removed with all that is in it.
#ifndef INVGRAD_TESTS_TEMPORARY_FOLDER_H_
#define INVGRAD_TESTS_TEMPORARY_FOLDER_H_

#include <stdlib.h>

#include <filesystem>
#include <string>
#include <vector>

#include "glog/logging.h"
#include "gtest/gtest.h"

namespace invgrad {

class TemporaryFolder {
 public:
  TemporaryFolder() : path_(testing::TempDir() + "/invgrad_XXXXXX") {
    CHECK(mkdtemp(path_.data()) != nullptr) << path_;
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }

  std::string operator/(const std::string& name) const {
    return path_ + "/" + name;
  }

  int NumFiles() const {
    return std::distance(std::filesystem::directory_iterator(path_),
                         std::filesystem::directory_iterator());
  }

 private:
  std::string path_;
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_TEMPORARY_FOLDER_H_
