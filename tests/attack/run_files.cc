#include "tests/attack/run_files.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

#include "fmt/core.h"
#include "glog/logging.h"

namespace invgrad {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> Split(const std::string& line) {
  std::vector<std::string> fields;
  std::istringstream stream(line + ",");
  for (std::string field; std::getline(stream, field, ',');) {
    fields.push_back(field);
  }
  return fields;
}

// Without the columns of times. No field that we compare has a comma.
std::string WithoutTimes(const std::string& csv) {
  std::istringstream lines(csv);
  std::vector<std::string> titles;
  std::string text;
  for (std::string line; std::getline(lines, line);) {
    const std::vector<std::string> fields = Split(line);
    if (titles.empty()) titles = fields;
    for (size_t i = 0; i < fields.size(); ++i) {
      if (i >= titles.size() || titles[i].find("second") == std::string::npos) {
        text += fields[i] + ",";
      }
    }
    text += '\n';
  }
  return text;
}

// Without times, and without digests of what has times.
std::string WithoutSeconds(const std::string& result) {
  std::istringstream lines(result);
  std::string text;
  for (std::string line; std::getline(lines, line);) {
    const std::string key = line.substr(0, line.find(' '));
    if (key != "seconds" && key != "history" && key != "digest") {
      text += line + '\n';
    }
  }
  return text;
}

}  // namespace

Files ReadFiles(const std::string& folder) {
  Files files;
  std::error_code unreadable;  // a loop of links, say
  if (!fs::is_directory(folder, unreadable)) return files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    std::string& content = files[entry.path().lexically_relative(folder)];
    constexpr std::uintmax_t kMaxSize = 10000000;
    if (entry.is_symlink()) {
      content = "link to " + fs::read_symlink(entry.path()).string();
    } else if (entry.is_directory()) {
      content = "folder";
    } else if (!entry.is_regular_file()) {
      content = "no regular file";
    } else if (entry.file_size() > kMaxSize) {
      content = fmt::format("{} bytes", entry.file_size());
    } else {
      std::ifstream file(entry.path(), std::ios::binary);
      content.assign(std::istreambuf_iterator<char>(file), {});
    }
  }
  return files;
}

void WriteFiles(const Files& files, const std::string& folder) {
  fs::remove_all(folder);
  fs::create_directories(folder);
  for (const auto& [name, content] : files) {
    if (content == "folder") {
      fs::create_directories(folder + "/" + name);
      continue;
    }
    std::ofstream file(folder + "/" + name, std::ios::binary);
    file << content;
    CHECK(file.good()) << name;
  }
}

Files Results(const Files& files) {
  Files results;
  for (const auto& [path, content] : files) {
    const fs::path name = fs::path(path).filename();
    if (name == "result.txt") {
      results[path] = WithoutSeconds(content);
    } else if (name == "history.csv" || name == "results.csv") {
      results[path] = WithoutTimes(content);
    } else if (name == "network.txt" || name.extension() == ".npy" ||
               name.extension() == ".dat" || name.extension() == ".g2o") {
      results[path] = content;
    }
  }
  return results;
}

std::vector<std::string> TemporaryFiles(const Files& files) {
  std::vector<std::string> names;
  for (const auto& [name, content] : files) {
    if (name.find(".tmp") != std::string::npos) names.push_back(name);
  }
  return names;
}

std::string FindDifference(const Files& files, const Files& expected) {
  for (const auto& [name, content] : expected) {
    const auto found = files.find(name);
    if (found == files.end()) return name + " is missing";
    if (found->second != content) {
      constexpr size_t kMaxLength = 1000;
      return fmt::format("{} differs:\n{}\nexpected:\n{}",
                         name,
                         found->second.substr(0, kMaxLength),
                         content.substr(0, kMaxLength));
    }
  }
  for (const auto& [name, content] : files) {
    if (expected.count(name) == 0) return name + " is new";
  }
  return "";
}

}  // namespace invgrad
