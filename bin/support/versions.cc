#include "bin/support/versions.h"

#include <fstream>

#include "Eigen/Core"
#include "ceres/version.h"
#include "fmt/core.h"
#include "invgrad/blas_threads.h"
#include "invgrad/internal/blas.h"
#include "invgrad/version.h"

namespace invgrad {
namespace {

std::string CpuName() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.rfind("model name", 0) == 0) {
      return line.substr(line.find(':') + 2);
    }
  }
  return "unknown";
}

}  // namespace

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

}  // namespace invgrad
