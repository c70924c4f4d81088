// An application with flags and logging of its own that uses invgrad: a rule
// inside ceres::Solve, as in README.md, and a network that `compare` trained.
//
//   consumer --network=runs/compare/adam-seed1/network.txt --input=0.1,0.2
//
// Also built as a shared object, which load_plugin.cc loads, as a plugin or a
// Python module is loaded.
//
// Ends with status 0 if all is as it should be, and prints the network's
// outputs, one a line.
#include <dlfcn.h>

#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "gflags/gflags.h"
#include "glog/logging.h"
#include "invgrad/blas_threads.h"
#include "invgrad/dense_network.h"
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"
#include "invgrad/version.h"

// Names that a library might take as well.
DEFINE_string(network, "", "network.txt of a run of compare");
DEFINE_string(input, "", "the network's input, separated by commas");
DEFINE_int32(seed, 1, "not used");

namespace {

// NIST's BoxBOD: y = b1 (1 - exp(-b2 x)).
struct OxygenDemand {
  template <typename T>
  bool operator()(const T* b, T* residual) const {
    using std::exp;
    const double x[] = {1.0, 2.0, 3.0, 5.0, 7.0, 10.0};
    const double y[] = {109.0, 149.0, 149.0, 191.0, 213.0, 224.0};
    for (int i = 0; i < 6; ++i) {
      residual[i] = y[i] - b[0] * (1.0 - exp(-b[1] * x[i]));
    }
    return true;
  }
};

void Minimize() {
  double b[] = {100.0, 0.75};
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<OxygenDemand, 6, 2>(new OxygenDemand),
      nullptr,
      b);
  ceres::Solver::Options options;
  options.max_num_iterations = 200;
  ceres::Solver::Summary summary;
  // [callback]
  auto rule = invgrad::MakeRule("geodesic");
  invgrad::UpdateCallback callback(rule.get(), &problem);
  callback.AddTo(&options);
  ceres::Solve(options, &problem, &summary);
  // [/callback]
  LOG(INFO) << callback.summary().BriefReport();
  CHECK_GT(callback.summary().num_accepted, 0) << summary.FullReport();
  // The certified values.
  CHECK_LT(std::hypot(b[0] / 213.80940889 - 1.0, b[1] / 0.54723748542 - 1.0),
           1e-3)
      << summary.FullReport();
}

// [network]
void EvaluateNetwork(const std::string& path, const Eigen::MatrixXd& inputs) {
  std::string error;
  Eigen::VectorXd weights;
  const std::optional<invgrad::DenseNetwork> network =
      invgrad::ReadNetwork(path, &weights, &error);
  if (!network) LOG(FATAL) << error;
  CHECK_EQ(inputs.rows(), network->num_inputs());
  invgrad::DenseNetwork::Activations activations;
  network->Forward(weights, inputs, false, &activations);
  for (const double x : activations.outputs.reshaped()) {
    std::printf("%.17g\n", x);
  }
}
// [/network]

Eigen::VectorXd ParseNumbers(const std::string& text) {
  std::vector<double> numbers;
  std::istringstream words(text);
  for (std::string word; std::getline(words, word, ',');) {
    numbers.push_back(std::stod(word));
  }
  return Eigen::Map<Eigen::VectorXd>(numbers.data(), numbers.size());
}

// Flags, logging, signals and threads of BLAS are the application's. BLAS is
// OpenBLAS in `scope`, where dlsym looks for it.
void CheckProcess(bool is_logging_initialized, void* scope) {
  std::vector<gflags::CommandLineFlagInfo> flags;
  gflags::GetAllFlags(&flags);
  for (const gflags::CommandLineFlagInfo& flag : flags) {
    CHECK(flag.filename.find("lib/invgrad/") == std::string::npos)
        << flag.name << " of " << flag.filename;
  }
  CHECK_EQ(google::IsGoogleLoggingInitialized(), is_logging_initialized);
  // glog's handlers, too, would take SIGTERM.
  for (const int signal_number : {SIGINT, SIGTERM}) {
    struct sigaction action;
    CHECK_EQ(sigaction(signal_number, nullptr, &action), 0);
    CHECK(action.sa_handler == SIG_DFL || action.sa_handler == SIG_IGN)
        << "signal " << signal_number;
  }
  for (const char* symbol : {"dgemm_", "dsyevd_"}) {
    Dl_info info;
    CHECK_NE(dladdr(dlsym(scope, symbol), &info), 0) << symbol;
    CHECK(std::strstr(info.dli_fname, "libopenblas") != nullptr)
        << symbol << " is in " << info.dli_fname;
  }
  CHECK_EQ(invgrad::BlasThreads(), 2);
}

}  // namespace

extern "C" int RunConsumer(int argc, char** argv, void* scope) {
  static_assert(INVGRAD_VERSION_MAJOR == 0, "what CMakeLists.txt asks for");
  invgrad::SetBlasThreads(2);
  CheckProcess(false, scope);
  Minimize();
  CheckProcess(false, scope);
  // The library works before and after.
  google::InitGoogleLogging(argv[0]);
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  Minimize();
  EvaluateNetwork(FLAGS_network, ParseNumbers(FLAGS_input));
  CheckProcess(true, scope);
  return 0;
}

int main(int argc, char** argv) {
  return RunConsumer(argc, argv, RTLD_DEFAULT);
}
