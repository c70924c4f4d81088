#include "bin/support/program.h"

#include <iostream>

#include "gflags/gflags.h"
#include "glog/logging.h"
#include "invgrad/version.h"

namespace invgrad {

int RunProgram(int argc, char** argv, const std::string& usage, int (*run)()) {
  FLAGS_logtostderr = true;
  // Ceres warns of every restart of nonlinear conjugate gradients.
  FLAGS_minloglevel = google::GLOG_ERROR;
  gflags::SetUsageMessage(usage);
  gflags::SetVersionString(INVGRAD_VERSION);
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  google::InitGoogleLogging(argv[0]);
  if (argc > 1) {
    return Fail(std::string("unexpected argument '") + argv[1] +
                "'; every argument is a --flag");
  }
  return run();
}

int Fail(const std::string& message) {
  Warn(message);
  return 1;
}

void Warn(const std::string& message) {
  std::cerr << gflags::ProgramInvocationShortName() << ": " << message << "\n";
}

}  // namespace invgrad
