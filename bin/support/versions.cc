#include "bin/support/versions.h"

#include <filesystem>
#include <fstream>
#include <system_error>

#include "Eigen/Core"
#include "ceres/version.h"
#include "fmt/core.h"
#include "invgrad/blas_threads.h"
#include "invgrad/internal/blas.h"
#include "invgrad/version.h"

namespace invgrad {

std::string CpuName(std::istream& cpuinfo) {
  for (std::string line; std::getline(cpuinfo, line);) {
    const std::size_t colon = line.find(": ");
    if (line.rfind("model name", 0) == 0 && colon != std::string::npos) {
      return line.substr(colon + 2);
    }
  }
  return "unknown";
}

std::vector<std::pair<std::string, std::string>> Versions() {
  std::ifstream cpuinfo("/proc/cpuinfo");
  return {{"invgrad", INVGRAD_VERSION},
          {"ceres", CERES_VERSION_STRING},
          {"eigen",
           fmt::format("{}.{}.{}",
                       EIGEN_WORLD_VERSION,
                       EIGEN_MAJOR_VERSION,
                       EIGEN_MINOR_VERSION)},
          {"blas", BlasName()},
          {"blas threads", std::to_string(BlasThreads())},
          {"compiler", __VERSION__},
          {"cpu", CpuName(cpuinfo)}};
}

std::string VersionsText() {
  std::string text;
  for (const auto& [name, value] : Versions()) {
    text += fmt::format("{} {}\n", name, value);
  }
  return text;
}

std::string CommitOfBuild() {
  std::error_code ignored;
  const std::filesystem::path program =
      std::filesystem::read_symlink("/proc/self/exe", ignored);
  std::ifstream file(program.parent_path() / "commit.txt");
  std::string commit;
  std::getline(file, commit);
  return commit;
}

}  // namespace invgrad
