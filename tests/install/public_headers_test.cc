// The border between what users include and what they do not.

#include "tests/install/public_headers.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/source_tree.h"

namespace invgrad {
namespace public_headers_test {

namespace fs = std::filesystem;

// The headers of ours that a file includes: "invgrad/train.h".
std::vector<std::string> Includes(const std::string& file) {
  static const auto& pattern =
      *new std::regex("^#include [<\"](invgrad/[^>\"]+)[>\"].*");
  std::ifstream in(file);
  EXPECT_TRUE(in) << file;
  std::vector<std::string> includes;
  std::smatch match;
  for (std::string line; std::getline(in, line);) {
    if (std::regex_match(line, match, pattern)) includes.push_back(match[1]);
  }
  return includes;
}

std::string InTree(const std::string& header) {
  return SourceDir() + "/lib/" + header;
}

// The headers of ours that an include of `header` brings.
std::set<std::string> Closure(const std::string& header) {
  std::set<std::string> all;
  std::vector<std::string> open = {header};
  while (!open.empty()) {
    const std::string next = open.back();
    open.pop_back();
    for (const std::string& include : Includes(InTree(next))) {
      if (all.insert(include).second) open.push_back(include);
    }
  }
  return all;
}

bool IsOfRoom(const std::string& header) {
  return header.find('/', std::string("invgrad/").size()) !=
             std::string::npos &&
         header.rfind("invgrad/internal/", 0) != 0 &&
         header.rfind("invgrad/compare/", 0) != 0;
}

TEST(PublicHeaders, AreThoseOfTheList) {
  std::vector<std::string> headers;
  const auto add = [&headers](const std::string& folder) {
    int num_added = 0;
    for (const auto& entry :
         fs::directory_iterator(InTree("invgrad/" + folder))) {
      if (entry.path().extension() != ".h") continue;
      headers.push_back(folder + entry.path().filename().string());
      ++num_added;
    }
    return num_added;
  };
  EXPECT_LE(add(""), 45);
  EXPECT_LE(add("compare/"), 4);  // of the component
  std::sort(headers.begin(), headers.end());
  EXPECT_EQ(headers, PublicHeaders());
}

TEST(PublicHeaders, IncludeNoHeaderOfARoom) {
  for (const std::string& header : PublicHeaders()) {
    for (const std::string& include : Closure("invgrad/" + header)) {
      EXPECT_FALSE(IsOfRoom(include)) << header << " brings " << include;
    }
  }
}

TEST(PublicHeaders, InternalOnesAreThoseThatPublicOnesBring) {
  std::set<std::string> brought;
  for (const std::string& header : PublicHeaders()) {
    for (const std::string& include : Closure("invgrad/" + header)) {
      if (include.rfind("invgrad/internal/", 0) == 0) brought.insert(include);
    }
  }
  std::set<std::string> internal;
  for (const auto& entry : fs::directory_iterator(InTree("invgrad/internal"))) {
    internal.insert("invgrad/internal/" + entry.path().filename().string());
  }
  EXPECT_EQ(internal, brought);
}

TEST(PublicHeaders, TrainBringsFewOthers) {
  EXPECT_LE(Closure("invgrad/train.h").size(), 15u);
}

TEST(PublicHeaders, SufficeForTutorialsExamplesAndTheConsumer) {
  int num_read = 0;
  for (const char* folder :
       {"docs/tutorials", "docs/examples", "tests/consumer"}) {
    for (const auto& entry :
         fs::directory_iterator(SourceDir() + "/" + folder)) {
      const std::string extension = entry.path().extension();
      if (extension != ".cc" && extension != ".h") continue;
      for (const std::string& include : Includes(entry.path())) {
        EXPECT_FALSE(IsOfRoom(include) ||
                     include.rfind("invgrad/internal/", 0) == 0)
            << entry.path() << " includes " << include;
      }
      ++num_read;
    }
  }
  EXPECT_GE(num_read, 20);
}

}  // namespace public_headers_test
}  // namespace invgrad
