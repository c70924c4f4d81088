#include "bin/support/run_output.h"

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <limits>
#include <map>
#include <numeric>
#include <sstream>
#include <string_view>

#include "Eigen/Core"
#include "bin/support/program.h"
#include "ceres/version.h"
#include "fmt/core.h"
#include "invgrad/core/blas.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/format.h"
#include "invgrad/version.h"
#include "report/interrupt.h"

DEFINE_string(output,
              "",
              "directory of the results; empty: runs/ and the program's name");
DEFINE_bool(overwrite, false, "replace the directory of an earlier run");
DEFINE_bool(plots, true, "draw the pictures (needs gnuplot)");

namespace invgrad {

namespace {

namespace fs = std::filesystem;

// A resumed run may be longer than the first one, look at other levels or
// values, and use other numbers of processes.
constexpr std::string_view kFlagsThatMayChange[] = {"output",
                                                    "epochs",
                                                    "steps",
                                                    "seconds",
                                                    "levels",
                                                    "value",
                                                    "tail",
                                                    "jobs",
                                                    "progress",
                                                    "plots"};

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
  return fmt::format(
      "invgrad {}\nceres {}\neigen {}.{}.{}\nblas {}\nblas threads {}\n"
      "compiler {}\ncpu {}\n",
      INVGRAD_VERSION,
      CERES_VERSION_STRING,
      EIGEN_WORLD_VERSION,
      EIGEN_MAJOR_VERSION,
      EIGEN_MINOR_VERSION,
      BlasName(),
      BlasThreads(),
      __VERSION__,
      CpuName());
}

bool SameFlags(const std::string& path,
               const std::string& flags,
               std::string* error) {
  std::string text;
  if (!ReadFile(path, &text, error)) {
    *error += "; is this the directory of a run?";
    return false;
  }
  std::map<std::string, std::string> before = ParseFlagText(text);
  for (const auto& [name, value] : ParseFlagText(flags)) {
    if (before[name] == value || std::count(std::begin(kFlagsThatMayChange),
                                            std::end(kFlagsThatMayChange),
                                            name) > 0) {
      continue;
    }
    *error = fmt::format(
        "{0}: the run to resume had --{1}={2}, now it is --{1}={3}; give "
        "another --output, or --overwrite",
        path,
        name,
        before[name],
        value);
    return false;
  }
  return true;
}

// Whether the directory may be used or reused; removes it if necessary.
bool MakeRoom(const std::string& path,
              ExistingDirectory existing,
              const std::string& flags,
              std::string* error) {
  std::error_code failure;
  const std::string flag_file = path + "/flags.txt";
  if (!fs::exists(path, failure) ||
      (fs::is_directory(path, failure) && fs::is_empty(path, failure))) {
    return true;
  }
  if (existing == ExistingDirectory::kResume) {
    return SameFlags(flag_file, flags, error);
  }
  if (existing == ExistingDirectory::kRefuse) {
    gflags::CommandLineFlagInfo info;
    *error = fmt::format(
        "--output={} exists; give another directory, or --overwrite{}",
        path,
        gflags::GetCommandLineFlagInfo("resume", &info)
            ? ", or --resume to go on with its run"
            : "");
    return false;
  }
  if (!fs::exists(flag_file, failure)) {
    *error = fmt::format(
        "--overwrite: {} is not the directory of a run (it has no flags.txt) "
        "and is left alone",
        path);
    return false;
  }
  fs::remove_all(path, failure);
  if (failure) *error = path + ": " + failure.message();
  return !failure;
}

}  // namespace

bool PrepareRunDirectory(const std::string& path,
                         ExistingDirectory existing,
                         const std::string& flags,
                         std::string* error) {
  if (!MakeRoom(path, existing, flags, error)) return false;
  if (!MakeDirectories(path, error)) {
    *error = "--output=" + *error;
    return false;
  }
  return WriteFile(path + "/flags.txt", flags, error) &&
         WriteFile(path + "/versions.txt", VersionsText(), error);
}

bool PrepareRunDirectory(ExistingDirectory existing, std::string* error) {
  if (FLAGS_output.empty()) {
    FLAGS_output = std::string("runs/") + gflags::ProgramInvocationShortName();
  }
  if (FLAGS_overwrite) existing = ExistingDirectory::kOverwrite;
  std::string flags;  // except those about an existing directory
  for (const gflags::CommandLineFlagInfo& flag : ProgramFlags()) {
    if (flag.name != "overwrite" && flag.name != "resume") {
      flags += fmt::format("--{}={}\n", flag.name, flag.current_value);
    }
  }
  return PrepareRunDirectory(FLAGS_output, existing, flags, error);
}

bool MakeDirectories(const std::string& path, std::string* error) {
  std::error_code failure;
  fs::create_directories(path, failure);
  if (failure) *error = path + ": " + failure.message();
  return !failure;
}

std::string FileName(const std::string& label) {
  std::string name;
  for (const char c : label) {
    const bool is_plain = std::isalnum(static_cast<unsigned char>(c)) != 0 ||
                          c == '_' || c == '.' || c == '+' || c == '-';
    name += is_plain ? c : '-';
  }
  constexpr size_t kMaxSize = 180;
  if (name.size() <= kMaxSize) return name;
  std::uint64_t digest = 0xcbf29ce484222325;  // FNV-1a
  for (const char c : label) {
    digest = (digest ^ static_cast<unsigned char>(c)) * 0x100000001b3;
  }
  const std::string end = fmt::format("-{:016x}", digest);
  return name.substr(0, kMaxSize - end.size()) + end;
}

bool WriteTable(const std::string& path,
                const Table& table,
                std::string* error) {
  return WriteFile(path + ".txt", table.ToText(), error) &&
         WriteFile(path + ".md", table.ToMarkdown(), error);
}

void DrawPictures(const std::vector<Picture>& pictures) {
  if (!FLAGS_plots) return;
  std::cout << std::flush;  // before what may take long
  const int signal_before = Interrupt::Signal();
  double max_seconds = 60.0;
  for (const Picture& picture : pictures) {
    std::error_code ignored;
    fs::remove(picture.path_png, ignored);
    std::string error;
    const auto start = std::chrono::steady_clock::now();
    if (picture.panels.empty() ||
        WritePlots(picture.path_png, picture.panels, &error, max_seconds)) {
      continue;
    }
    Warn(error);
    if (Interrupt::Signal() != signal_before) return;
    const std::chrono::duration<double> seconds =
        std::chrono::steady_clock::now() - start;
    if (seconds.count() > max_seconds) max_seconds = 5.0;
  }
}

Series HistoryCurve(const std::string& title,
                    const History& history,
                    double HistoryRow::*field,
                    bool against_seconds) {
  Series curve;
  curve.title = title;
  for (const HistoryRow& row : history) {
    if (row.step == 0) continue;
    curve.x.push_back(against_seconds ? row.seconds
                                      : static_cast<double>(row.step));
    curve.y.push_back(row.*field);
  }
  return curve;
}

SeedSpread::SeedSpread(const std::vector<double>& values)
    : num_runs(values.size()) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  median = low = high = none;
  if (values.empty()) return;
  const auto rank = [&values](size_t i) {
    return std::isfinite(values[i]) ? values[i]
                                    : std::numeric_limits<double>::infinity();
  };
  std::vector<size_t> order(values.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&rank](size_t a, size_t b) {
    return rank(a) < rank(b);
  });
  median_run = order[(order.size() - 1) / 2];
  if (std::isfinite(values[median_run])) median = values[median_run];
  for (const double value : values) {
    if (std::isfinite(value)) {
      low = std::fmin(low, value);
      high = std::fmax(high, value);
    } else {
      ++num_failed;
    }
  }
}

std::string SeedSpread::Text() const {
  std::string text = NumberOrDash(low);
  if (low < high) text += " - " + FormatNumber(high);
  if (num_failed > 0) {
    text += fmt::format(", {} of {} failed or not run", num_failed, num_runs);
  }
  return text;
}

}  // namespace invgrad
