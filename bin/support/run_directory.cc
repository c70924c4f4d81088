#include "bin/support/run_directory.h"

#include <cctype>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <vector>

#include "Eigen/Core"
#include "bin/support/program.h"
#include "ceres/version.h"
#include "gflags/gflags.h"
#include "invgrad/core/blas.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/version.h"

namespace invgrad {

namespace {

namespace fs = std::filesystem;

// A resumed run may be longer than the first one, look at other levels or
// values, and use other numbers of processes.
const std::set<std::string>& FlagsThatMayChange() {
  static const auto& flags = *new std::set<std::string>{"output",
                                                        "epochs",
                                                        "steps",
                                                        "seconds",
                                                        "levels",
                                                        "value",
                                                        "tail",
                                                        "jobs",
                                                        "progress",
                                                        "plots"};
  return flags;
}

std::map<std::string, std::string> ParseFlagText(const std::string& text) {
  std::map<std::string, std::string> flags;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const size_t equals = line.find('=');
    if (line.rfind("--", 0) != 0 || equals == std::string::npos) continue;
    flags[line.substr(2, equals - 2)] = line.substr(equals + 1);
  }
  return flags;
}

std::string CpuName() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.rfind("model name", 0) == 0) {
      return line.substr(line.find(':') + 2);
    }
  }
  return "unknown";
}

std::string VersionsText() {
  std::ostringstream text;
  text << "invgrad " << INVGRAD_VERSION << "\nceres " << CERES_VERSION_STRING
       << "\neigen " << EIGEN_WORLD_VERSION << "." << EIGEN_MAJOR_VERSION << "."
       << EIGEN_MINOR_VERSION << "\nblas " << BlasName() << "\nblas threads "
       << BlasThreads() << "\ncompiler " << __VERSION__ << "\ncpu " << CpuName()
       << "\n";
  return text.str();
}

bool SameFlags(const std::string& path,
               const std::string& flags,
               std::string* error) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file) {
    *error = path + ": cannot be read; is this the directory of a run?";
    return false;
  }
  const auto before = ParseFlagText(text.str());
  for (const auto& [name, value] : ParseFlagText(flags)) {
    if (FlagsThatMayChange().count(name) > 0) continue;
    const auto it = before.find(name);
    const std::string old_value = it == before.end() ? "" : it->second;
    if (old_value != value) {
      *error = path + ": the run to resume had --" + name + "=" + old_value +
               ", now it is --" + name + "=" + value +
               "; give another --output, or --overwrite";
      return false;
    }
  }
  return true;
}

}  // namespace

bool PrepareRunDirectory(const std::string& path,
                         ExistingDirectory existing,
                         const std::string& flags,
                         std::string* error) {
  std::error_code failure;
  const std::string flag_file = path + "/flags.txt";
  const bool exists = fs::exists(path, failure);
  const bool is_empty =
      exists && fs::is_directory(path, failure) && fs::is_empty(path, failure);
  if (exists && !is_empty) {
    if (existing == ExistingDirectory::kRefuse) {
      gflags::CommandLineFlagInfo info;
      *error = "--output=" + path + " exists; give another directory, or " +
               "--overwrite";
      if (gflags::GetCommandLineFlagInfo("resume", &info)) {
        *error += ", or --resume to go on with its run";
      }
      return false;
    }
    if (existing == ExistingDirectory::kOverwrite) {
      if (!fs::exists(flag_file, failure)) {
        *error = "--overwrite: " + path + " is not the directory of a run " +
                 "(it has no flags.txt) and is left alone";
        return false;
      }
      fs::remove_all(path, failure);
      if (failure) {
        *error = path + ": " + failure.message();
        return false;
      }
    } else if (!SameFlags(flag_file, flags, error)) {
      return false;
    }
  }
  fs::create_directories(path, failure);
  if (failure) {
    *error = "--output=" + path + ": " + failure.message();
    return false;
  }
  return WriteFile(flag_file, flags, error) &&
         WriteFile(path + "/versions.txt", VersionsText(), error);
}

std::string FlagFileText() {
  std::string text;
  for (const gflags::CommandLineFlagInfo& flag : ProgramFlags()) {
    if (flag.name != "overwrite" && flag.name != "resume") {
      text += "--" + flag.name + "=" + flag.current_value + "\n";
    }
  }
  return text;
}

std::string FileName(const std::string& label) {
  std::string name;
  for (const char c : label) {
    const bool is_plain = std::isalnum(static_cast<unsigned char>(c)) != 0 ||
                          c == '_' || c == '.' || c == '+' || c == '-';
    name += is_plain ? c : '-';
  }
  return name;
}

}  // namespace invgrad
