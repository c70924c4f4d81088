#include "bin/support/program.h"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <iostream>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/core/blas_kernels.h"
#include "invgrad/version.h"

DECLARE_bool(helpshort);  // of gflags

namespace invgrad {

namespace {

// With a slash at its end; this is bin/support/program.cc.
std::string BinDirectory() {
  return std::filesystem::path(__FILE__).parent_path().parent_path().string() +
         "/";
}

}  // namespace

void UseProcessorsKernels(char** argv) {
  const std::string old_kernels = OldBlasKernelsMessage();
  if (old_kernels.empty()) return;
  const std::string name = std::filesystem::path(argv[0]).filename();
  constexpr char kVariable[] = "OPENBLAS_CORETYPE";
  // Set by the user, or by UseProcessorsKernels before it restarted the
  // program.
  if (std::getenv(kVariable) != nullptr) {
    std::cerr << name << ": " << old_kernels << "\n";
    return;
  }
  const std::string better =
      BetterBlasKernels(ProcessorVectorUnits(), BlasKernels());
  std::cerr << fmt::format(
      "{}: OpenBLAS chose its {} kernels, which are too old for this "
      "processor; starting again with {}={}\n",
      name,
      BlasKernels(),
      kVariable,
      better);
  setenv(kVariable, better.c_str(), /*overwrite=*/1);
  execv("/proc/self/exe", argv);
  std::cerr << name << ": cannot start again. " << old_kernels << "\n";
}

int RunProgram(int argc, char** argv, const std::string& usage, int (*run)()) {
  UseProcessorsKernels(argv);
  FLAGS_logtostderr = true;
  // Ceres warns of every restart of nonlinear conjugate gradients.
  FLAGS_minloglevel = google::GLOG_ERROR;
  gflags::SetUsageMessage(usage);
  gflags::SetVersionString(INVGRAD_VERSION);
  gflags::ParseCommandLineNonHelpFlags(&argc, &argv, true);
  if (FLAGS_helpshort) {
    // gflags' own help omits the flags of bin/support.
    gflags::ShowUsageWithFlagsRestrict(argv[0], BinDirectory().c_str());
    return 1;  // as for gflags' other help
  }
  gflags::HandleCommandLineHelpFlags();
  google::InitGoogleLogging(argv[0]);
  if (argc > 1) {
    return Fail(std::string("unexpected argument '") + argv[1] +
                "'; every argument is a --flag");
  }
  return run();
}

std::vector<gflags::CommandLineFlagInfo> ProgramFlags() {
  const std::string directory = BinDirectory();
  std::vector<gflags::CommandLineFlagInfo> all;
  gflags::GetAllFlags(&all);
  std::vector<gflags::CommandLineFlagInfo> flags;
  for (const gflags::CommandLineFlagInfo& flag : all) {
    if (flag.filename.rfind(directory, 0) == 0) flags.push_back(flag);
  }
  return flags;
}

bool CheckFlag(const char* name,
               bool is_allowed,
               const std::string& allowed,
               std::string* error) {
  if (is_allowed) return true;
  *error = std::string("--") + name + "=" +
           gflags::GetCommandLineFlagInfoOrDie(name).current_value +
           " is out of range; allowed: " + allowed;
  return false;
}

int Fail(const std::string& message) {
  Warn(message);
  return 1;
}

void Warn(const std::string& message) {
  std::cerr << gflags::ProgramInvocationShortName() << ": " << message << "\n";
}

}  // namespace invgrad
