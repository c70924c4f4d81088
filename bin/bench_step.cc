// Measures the time of the half-inverse step's linear algebra by each route and
// by a full SVD, for the four published sizes and a million weights.
//
// Sample runs:
//
//   bench_step
//   bench_step --cases=poisson --routes=gram,dgesdd
//   bench_step --cases=linear_chain,cubic_chain --benchmark_repetitions=5
//   bench_step --cases=poisson --truncation=1e-2
//   bench_step --memory --cases=poisson --routes=gram,dgesdd
//
// One BLAS thread, warm: the workspace is kept between steps. CASE/ROUTE is the
// whole linear algebra of a step, from the Jacobian's factors (or, for a full
// SVD, from the dense J) to d:
//
//   gram, svd        the routes of spectral_step.h, with a rule's tolerances
//   golub_kahan      golub_kahan.h, with --truncation=1e-3 or more
//   dgesdd, sgesdd   LAPACK's SVD of J in double and single precision
//   bdcsvd           Eigen's
//   step             linearization (network, physics, factors) and gram
//
// After the usual lines follow ratios within this run, GF/s, and multiples of
// the lower limit: the arithmetic of the Gram matrix and the reduction,
// m^2 sum(widths) + 4/3 m^3, at the speed of dgemm in this run. --memory prints
// the peak memory of a process that makes one such step, and no times.

#include <lapacke.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "benchmark/benchmark.h"
#include "bin/support/program.h"
#include "bin/support/ratio_reporter.h"
#include "bin/support/step_case.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "glog/logging.h"
#include "invgrad/core/blas.h"
#include "invgrad/core/small_svd.h"
#include "invgrad/spectral/golub_kahan.h"
#include "invgrad/spectral/spectral_step.h"

DEFINE_string(cases,
              "linear_chain,cubic_chain,quantum_dipole,poisson,million",
              "which sizes, comma-separated");
DEFINE_string(routes,
              "",
              "which routes, comma-separated; empty: all that take less than a "
              "minute");
DEFINE_double(truncation, 0.0, "tau; 0: each problem's published one");
DEFINE_bool(memory, false, "print peak memory instead of times");

namespace invgrad {
namespace {

// Measures repeated calls of `step`, which returns the label of the line.
using Step = std::function<std::string(const StepCase&)>;

std::string Label(int rank, double estimated_error) {
  return fmt::format("rank {}, error < {:.1e}", rank, estimated_error);
}

// A step by `route` for the given linearization.
std::string SpectralStepAt(const Linearization& at,
                           const SpectralFilter& filter,
                           SpectralRoute route,
                           SpectralWorkspace* workspace) {
  SpectralStepOptions options = SpectralStepOptions::ForTraining();
  options.route = route;
  Eigen::VectorXd d;
  SpectralStepSummary summary;
  return SpectralStep(*at.jacobian,
                      at.loss_gradient,
                      filter,
                      options,
                      workspace,
                      &d,
                      &summary)
             ? Label(summary.rank, summary.estimated_error)
             : summary.message;
}

Step RouteStep(SpectralRoute route) {
  auto workspace = std::make_shared<SpectralWorkspace>();
  return [route, workspace](const StepCase& at) {
    return SpectralStepAt(at.at_weights, at.filter, route, workspace.get());
  };
}

Step FullStep() {
  auto workspace = std::make_shared<SpectralWorkspace>();
  return [workspace](const StepCase& at) {
    Linearization linearization;
    at.Linearize(&linearization);
    return SpectralStepAt(
        linearization, at.filter, SpectralRoute::kGram, workspace.get());
  };
}

Step KrylovStep() {
  auto basis = std::make_shared<Eigen::MatrixXd>();
  return [basis](const StepCase& at) {
    GolubKahanOptions options;
    options.tolerance = 1e-6;
    options.max_iterations = std::min(at.J().rows(), at.J().cols());
    Eigen::VectorXd d;
    GolubKahanSummary summary;
    GolubKahanStep(
        at.J(), at.g(), at.filter, options, basis.get(), &d, &summary);
    return summary.converged ? Label(summary.rank, summary.estimated_error)
                             : summary.message;
  };
}

// V phi(S) U^T g from a thin SVD.
template <typename Matrix, typename Vector>
Eigen::VectorXd Filtered(const Matrix& U,
                         const Vector& s,
                         const Matrix& Vt,
                         const StepCase& at) {
  using Scalar = typename Matrix::Scalar;
  Vector c = U.transpose() * at.g().template cast<Scalar>();
  for (Eigen::Index i = 0; i < c.size(); ++i) {
    c[i] *= static_cast<Scalar>(at.filter(s[i], s[0]));
  }
  return (Vt.transpose() * c).template cast<double>();
}

lapack_int Gesdd(int m, int n, double* A, double* s, double* U, double* Vt) {
  const int k = std::min(m, n);
  return LAPACKE_dgesdd(LAPACK_COL_MAJOR, 'S', m, n, A, m, s, U, m, Vt, k);
}
lapack_int Gesdd(int m, int n, float* A, float* s, float* U, float* Vt) {
  const int k = std::min(m, n);
  return LAPACKE_sgesdd(LAPACK_COL_MAJOR, 'S', m, n, A, m, s, U, m, Vt, k);
}

// LAPACK's SVD of the dense J; steps reuse its arrays.
template <typename Scalar>
Step LapackStep() {
  using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;
  struct Arrays {
    Matrix J, A, U, Vt;
    Vector s;
  };
  auto arrays = std::make_shared<Arrays>();
  return [arrays](const StepCase& at) -> std::string {
    const int m = at.J().rows();
    const int n = at.J().cols();
    const int k = std::min(m, n);
    Arrays& a = *arrays;
    if (a.J.size() == 0) {
      Eigen::MatrixXd J;
      at.J().ToDense(&J);
      a.J = J.cast<Scalar>();
      a.U.resize(m, k);
      a.Vt.resize(k, n);
      a.s.resize(k);
    }
    a.A = a.J;  // LAPACK overwrites a.A
    CHECK_EQ(Gesdd(m, n, a.A.data(), a.s.data(), a.U.data(), a.Vt.data()), 0);
    benchmark::DoNotOptimize(Filtered(a.U, a.s, a.Vt, at).data());
    return "";
  };
}

Step EigenStep() {
  struct Arrays {
    Eigen::MatrixXd J;
    SmallSvd svd;
  };
  auto arrays = std::make_shared<Arrays>();
  return [arrays](const StepCase& at) -> std::string {
    if (arrays->J.size() == 0) at.J().ToDense(&arrays->J);
    const SmallSvd& svd = arrays->svd;
    arrays->svd.Compute(arrays->J);
    const Eigen::MatrixXd Vt = svd.V.transpose();
    const Eigen::VectorXd d = Filtered(svd.U, svd.s, Vt, at);
    benchmark::DoNotOptimize(d.data());
    return "";
  };
}

struct RouteRow {
  const char* name;
  bool is_full_svd;
  std::function<Step()> make;
};

const std::vector<RouteRow>& RouteRows() {
  static const auto& rows = *new std::vector<RouteRow>{
      {"gram", false, [] { return RouteStep(SpectralRoute::kGram); }},
      {"step", false, FullStep},
      {"golub_kahan", false, KrylovStep},
      {"svd", true, [] { return RouteStep(SpectralRoute::kSvd); }},
      {"dgesdd", true, LapackStep<double>},
      {"sgesdd", true, LapackStep<float>},
      {"bdcsvd", true, EigenStep},
  };
  return rows;
}

std::vector<std::string> Split(const std::string& list) {
  std::istringstream stream(list);
  std::vector<std::string> names;
  std::string name;
  while (std::getline(stream, name, ',')) names.push_back(name);
  return names;
}

bool IsWanted(const StepCaseRow& row, const RouteRow& route) {
  const std::string name = route.name;
  if (row.full_svd_is_impossible && route.is_full_svd) return false;
  if (!FLAGS_routes.empty()) {
    const std::vector<std::string> wanted = Split(FLAGS_routes);
    return std::find(wanted.begin(), wanted.end(), name) != wanted.end();
  }
  // golub_kahan is for truncations that keep a small share of the values.
  if (name == "golub_kahan") return FLAGS_truncation >= 1e-3;
  return !(row.full_svd_is_slow && route.is_full_svd);
}

// The dgemm rate of this run, in flops a second.
double GemmRate() {
  constexpr int kSize = 1024;
  const Eigen::MatrixXd A = Eigen::MatrixXd::Random(kSize, kSize);
  Eigen::MatrixXd C(kSize, kSize);
  double best = 0.0;
  for (int i = 0; i < 5; ++i) {
    using Clock = std::chrono::steady_clock;
    const Clock::time_point start = Clock::now();
    Gemm(Op::kNone, Op::kTranspose, 1.0, A, A, 0.0, C);
    const double seconds =
        std::chrono::duration<double>(Clock::now() - start).count();
    best = std::max(best, 2.0 * kSize * kSize * kSize / seconds);
  }
  return best;
}

// The memory, in megabytes, of a process that makes one step.
double PeakMemory(const StepCaseRow& row, const RouteRow& route) {
  const pid_t child = fork();
  PCHECK(child >= 0);
  if (child == 0) {
    route.make()(StepCase(row, FLAGS_truncation));
    _exit(0);
  }
  int status = 0;
  rusage usage;
  PCHECK(wait4(child, &status, 0, &usage) == child);
  CHECK_EQ(status, 0) << row.name << " " << route.name;
  return usage.ru_maxrss / 1024.0;
}

// The row with this name; null, with a message, if there is none.
template <typename Row>
const Row* FindRow(const char* flag,
                   const std::vector<Row>& rows,
                   const std::string& name) {
  std::string names;
  for (const Row& row : rows) {
    if (name == row.name) return &row;
    names += std::string(" ") + row.name;
  }
  fmt::print(stderr, "--{}={}: allowed are{}\n", flag, name, names);
  return nullptr;
}

bool ReadFlags(std::vector<const StepCaseRow*>* cases) {
  if (!(FLAGS_truncation >= 0.0 && FLAGS_truncation < 1.0)) {
    fmt::print(
        stderr, "--truncation={}: allowed are [0, 1)\n", FLAGS_truncation);
    return false;
  }
  for (const std::string& name : Split(FLAGS_routes)) {
    if (FindRow("routes", RouteRows(), name) == nullptr) return false;
  }
  for (const std::string& name : Split(FLAGS_cases)) {
    cases->push_back(FindRow("cases", StepCaseRows(), name));
    if (cases->back() == nullptr) return false;
  }
  return true;
}

void PrintMemory(const std::vector<const StepCaseRow*>& cases) {
  fmt::print("peak memory of a process that makes one step, MB\n");
  for (const StepCaseRow* row : cases) {
    for (const RouteRow& route : RouteRows()) {
      if (!IsWanted(*row, route)) continue;
      fmt::print("{:<30} {:8.0f}\n",
                 fmt::format("{}/{}", row->name, route.name),
                 PeakMemory(*row, route));
      std::fflush(stdout);
    }
  }
}

void Register(const std::shared_ptr<const StepCase>& at) {
  for (const RouteRow& route : RouteRows()) {
    if (!IsWanted(*at->row, route)) continue;
    const std::string name = std::string(at->row->name) + "/" + route.name;
    const bool slow = at->row->full_svd_is_slow && route.is_full_svd;
    auto* registered = benchmark::RegisterBenchmark(
        name.c_str(),
        [at, slow](benchmark::State& state, const RouteRow& it) {
          // Not measured: the factors and the first use of the workspace, which
          // is negligible for steps of a minute.
          const Step step = it.make();
          std::string label;
          if (!slow) label = step(*at);
          for (auto _ : state) label = step(*at);
          state.SetLabel(label);
        },
        route);
    registered->Unit(benchmark::kMillisecond);
    if (slow) registered->MinTime(1e-3);  // once
  }
}

void PrintRatios(const std::vector<std::shared_ptr<const StepCase>>& cases,
                 const RatioReporter& reporter,
                 double gemm_rate) {
  fmt::print("\nRatios of this run (medians of the repetitions)\n");
  for (const auto& at : cases) {
    const std::string name = at->row->name;
    for (const RouteRow& route : RouteRows()) {
      if (std::string(route.name) == "gram") continue;
      reporter.PrintRatio(name + "/" + route.name, name + "/gram");
    }
  }
  fmt::print("\ndgemm: {:.1f} GF/s\n", gemm_rate * 1e-9);
  for (const auto& at : cases) {
    const double seconds =
        reporter.Median(std::string(at->row->name) + "/gram");
    if (std::isnan(seconds)) continue;
    fmt::print(
        "{:<15} {:5} x {:7}: {:9.3f} GF, {:5.1f} GF/s, {:5.2f} times the "
        "limit\n",
        at->row->name,
        at->J().rows(),
        at->J().cols(),
        at->LimitFlops() * 1e-9,
        at->LimitFlops() / seconds * 1e-9,
        seconds * gemm_rate / at->LimitFlops());
  }
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  using invgrad::StepCase;
  invgrad::UseProcessorsKernels(argv);
  benchmark::Initialize(&argc, argv);
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  std::vector<const invgrad::StepCaseRow*> rows;
  if (!invgrad::ReadFlags(&rows)) return 1;
  invgrad::SetBlasThreads(1);
  if (FLAGS_memory) {
    invgrad::PrintMemory(rows);
    return 0;
  }
  std::vector<std::shared_ptr<const StepCase>> cases;
  for (const invgrad::StepCaseRow* row : rows) {
    cases.push_back(std::make_shared<const StepCase>(*row, FLAGS_truncation));
    invgrad::Register(cases.back());
  }
  const double gemm_rate = invgrad::GemmRate();
  invgrad::RatioReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  invgrad::PrintRatios(cases, reporter, gemm_rate);
  return 0;
}
