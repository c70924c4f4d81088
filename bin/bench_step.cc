// Times the half-inverse step's linear algebra by each route and by a full SVD,
// for the four published sizes, a million weights, and two physics-informed
// networks with more points than weights (docs/results/speed.md).
//
// Sample runs:
//
//   bench_step
//   bench_step --cases=poisson --routes=gram,dgesdd
//   bench_step --cases=linear_chain,cubic_chain --benchmark_repetitions=5
//   bench_step --cases=poisson --truncation=1e-2
//   bench_step --cases=equation_1341,equation_3021 --routes=gram,parameter_gram
//   bench_step --memory --cases=poisson --routes=gram,dgesdd
//   bench_step --cases=cubic_chain,poisson --routes=gram,step --blas_threads=2
//
// Warm: the workspace is kept between steps. CASE/ROUTE is the
// whole linear algebra of a step, from the Jacobian's factors (or, for a full
// SVD, from the dense J) to d:
//
//   gram, svd        the routes of spectral_step.h, with a rule's tolerances
//   loo, loo_32      leave_one_out.h for one filter: all samples, and 32
//   loo_32x18        32 samples for 18 filters
//   parameter_gram   J^T J alone, from the factors
//   golub_kahan      golub_kahan.h, with --truncation=1e-3 or more
//   dgesdd, sgesdd   LAPACK's SVD of J in double and single precision
//   bdcsvd           Eigen's
//   step             linearization (network, physics, factors) and gram
//
// Then follow ratios within this run, GF/s, and multiples of the lower limit
// (Case::LimitFlops at the speed of dgemm in this run). --memory prints the
// peak memory of a process that makes one such step, and no times.

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "benchmark/benchmark.h"
#include "bin/support/benchmarks.h"
#include "bin/support/lapack_svd.h"
#include "bin/support/learning_run.h"
#include "bin/support/leave_one_out_step.h"
#include "bin/support/program.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "glog/logging.h"
#include "invgrad/core/blas_threads.h"
#include "invgrad/core/small_svd.h"
#include "invgrad/core/specification.h"
#include "invgrad/spectral/golub_kahan.h"
#include "invgrad/spectral/spectral_step.h"

DEFINE_string(cases,
              "linear_chain,cubic_chain,quantum_dipole,poisson,million,"
              "equation_1341,equation_3021",
              "which sizes, comma-separated");
DEFINE_string(routes,
              "",
              "which routes, comma-separated; empty: all that take less than a "
              "minute");
DEFINE_double(truncation, 0.0, "tau; 0: each problem's published one");
DEFINE_bool(memory, false, "print peak memory instead of times");
DEFINE_int32(blas_threads, 1, "threads of the linear algebra");

namespace invgrad {
namespace {

struct CaseRow {
  const char* name;
  const char* problem;
  double truncation;      // the published one
  bool full_svd_is_slow;  // a minute or more
  // Of a network in place of the problem's; then no full SVD.
  std::vector<int> widths;
};

const std::vector<CaseRow>& CaseRows() {
  static const auto& rows = *new std::vector<CaseRow>{
      {"linear_chain", "oscillator_chain", 1e-10, false, {}},
      {"cubic_chain", "oscillator_chain:coupling=cubic", 1e-6, false, {}},
      {"quantum_dipole", "quantum_dipole", 1e-5, false, {}},
      {"poisson", "poisson", 1e-5, true, {}},
      {"million", "poisson", 1e-5, true, {64, 512, 1024, 416, 64}},
      {"equation_1341",
       "burgers_pinn:num_x=128",
       1e-6,
       true,
       {2, 20, 20, 20, 20, 1}},
      {"equation_3021",
       "burgers_pinn:num_x=128",
       1e-6,
       true,
       {2, 20, 20, 20, 20, 20, 20, 20, 20, 1}},
  };
  return rows;
}

// A batch of a problem, linearized at its initial weights.
struct Case {
  const CaseRow* row;
  SpectralFilter filter;
  std::shared_ptr<const Model> model;
  DataSet batch;
  Eigen::VectorXd weights;
  Linearization at_weights;

  explicit Case(const CaseRow& case_row)
      : row(&case_row),
        filter(SpectralFilter::HalfInverse(
            FLAGS_truncation > 0.0 ? FLAGS_truncation : row->truncation)) {
    LearningProblem problem;
    std::string error;
    CHECK(CreateLearningProblem(row->problem, &problem, &error)) << error;
    if (!row->widths.empty()) {
      problem.model = std::make_shared<Model>(problem.model->WithNetwork(
          DenseNetwork(row->widths,
                       problem.model->dense_network()->hidden_activation())));
    }
    model = problem.model;
    batch = problem.train.Range(0, BatchSize(problem, -1));
    weights = InitialWeights(problem, 1);
    Linearize(&at_weights);
  }

  void Linearize(Linearization* at) const {
    std::string error;
    CHECK(model->Linearize(
        weights, batch, LinearizationParts::Jacobian(), at, &error))
        << error;
  }
  const JacobianOperator& J() const { return *at_weights.jacobian; }
  const Eigen::VectorXd& g() const { return at_weights.loss_gradient; }

  bool is_wide() const { return J().rows() <= J().cols(); }
  // The operations of the Gram matrix: m^2 sum(widths), or m n^2 of J^T J.
  double GramFlops() const {
    const double m = J().rows();
    const double n = J().cols();
    if (!is_wide()) return m * n * n;
    const std::vector<int>& widths = model->dense_network()->widths();
    return m * m * std::accumulate(widths.begin() + 1, widths.end(), 0.0);
  }
  // With its reduction, 4/3 of the cube of its size.
  double LimitFlops() const {
    const double size = std::min(J().rows(), J().cols());
    return GramFlops() + 4.0 / 3.0 * size * size * size;
  }
};

// Returns the label of the line.
using Step = std::function<std::string(const Case&)>;

std::string Label(int rank, double estimated_error) {
  return fmt::format("rank {}, error < {:.1e}", rank, estimated_error);
}

// A step by `route`; with its linearization if `is_whole`.
Step RouteStep(SpectralRoute route, bool is_whole = false) {
  auto workspace = std::make_shared<SpectralWorkspace>();
  return [route, is_whole, workspace](const Case& at) {
    Linearization linearization;
    if (is_whole) at.Linearize(&linearization);
    const Linearization& here = is_whole ? linearization : at.at_weights;
    SpectralStepOptions options = SpectralStepOptions::ForTraining();
    options.route = route;
    Eigen::VectorXd d;
    SpectralStepSummary summary;
    return SpectralStep(*here.jacobian,
                        here.loss_gradient,
                        at.filter,
                        options,
                        workspace.get(),
                        &d,
                        &summary)
               ? Label(summary.rank, summary.estimated_error)
               : summary.message;
  };
}

// leave_one_out_step.h; 0: all samples.
Step LeaveOneOutStep(int max_num_samples, bool is_choice) {
  auto step = std::make_shared<LeftOutStep>(max_num_samples, is_choice);
  return [step](const Case& at) {
    return step->Run(at.J(), at.g(), at.batch.num_samples(), at.filter);
  };
}

Step ParameterGramStep() {
  auto gram = std::make_shared<Eigen::MatrixXd>();
  return [gram](const Case& at) {
    at.J().ParameterGram(gram.get());
    return std::string();
  };
}

Step KrylovStep() {
  auto basis = std::make_shared<Eigen::MatrixXd>();
  return [basis](const Case& at) {
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

struct EigenSvd : SmallSvd {
  using Matrix = Eigen::MatrixXd;
  Matrix Vt;

  bool Compute(const Matrix& J) {
    SmallSvd::Compute(J);
    Vt = V.transpose();
    return true;
  }
};

// A full SVD of the dense J; steps reuse its arrays.
template <typename Svd>
Step SvdStep() {
  return [J = typename Svd::Matrix(),
          svd = Svd()](const Case& at) mutable -> std::string {
    if (J.size() == 0) {
      Eigen::MatrixXd dense;
      at.J().ToDense(&dense);
      J = dense.cast<typename Svd::Matrix::Scalar>();
    }
    CHECK(svd.Compute(J));
    const Eigen::VectorXd d = FilteredStep(svd, at.filter, at.g());
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
      {"step", false, [] { return RouteStep(SpectralRoute::kGram, true); }},
      {"loo", false, [] { return LeaveOneOutStep(0, false); }},
      {"loo_32", false, [] { return LeaveOneOutStep(32, false); }},
      {"loo_32x18", false, [] { return LeaveOneOutStep(32, true); }},
      {"parameter_gram", false, ParameterGramStep},
      {"golub_kahan", false, KrylovStep},
      {"svd", true, [] { return RouteStep(SpectralRoute::kSvd); }},
      {"dgesdd", true, SvdStep<LapackSvd<double>>},
      {"sgesdd", true, SvdStep<LapackSvd<float>>},
      {"bdcsvd", true, SvdStep<EigenSvd>},
  };
  return rows;
}

bool IsWanted(const CaseRow& row, const RouteRow& route) {
  const std::string name = route.name;
  const bool is_equation = std::string(row.name).rfind("equation_", 0) == 0;
  if (name == "parameter_gram" && !is_equation) return false;
  if (route.is_full_svd && !row.widths.empty()) return false;
  if (!FLAGS_routes.empty()) {
    const std::vector<std::string> wanted = SplitList(FLAGS_routes);
    return std::find(wanted.begin(), wanted.end(), name) != wanted.end();
  }
  // golub_kahan is for truncations that keep a small share of the values.
  if (name == "golub_kahan") return FLAGS_truncation >= 1e-3;
  return !(route.is_full_svd && row.full_svd_is_slow);
}

// The memory, in megabytes, of a process that makes one step.
double PeakMemory(const CaseRow& row, const RouteRow& route) {
  const pid_t child = fork();
  PCHECK(child >= 0);
  if (child == 0) {
    route.make()(Case(row));
    _exit(0);
  }
  int status = 0;
  rusage usage;
  PCHECK(wait4(child, &status, 0, &usage) == child);
  CHECK_EQ(status, 0) << row.name << " " << route.name;
  return usage.ru_maxrss / 1024.0;
}

// The rows whose names a flag lists.
template <typename Row>
bool FindRows(const char* flag,
              const std::vector<Row>& rows,
              std::vector<const Row*>* found,
              std::string* error) {
  std::vector<std::string> names;
  names.reserve(rows.size());
  for (const Row& row : rows) names.emplace_back(row.name);
  for (const std::string& name :
       SplitList(gflags::GetCommandLineFlagInfoOrDie(flag).current_value)) {
    const auto it = std::find(names.begin(), names.end(), name);
    if (it == names.end()) {
      *error = UnknownNameMessage(std::string("--") + flag, name, names);
      return false;
    }
    found->push_back(&rows[it - names.begin()]);
  }
  return true;
}

void PrintMemory(const std::vector<const CaseRow*>& cases) {
  fmt::print("peak memory of a process that makes one step, MB\n");
  for (const CaseRow* row : cases) {
    for (const RouteRow& route : RouteRows()) {
      if (!IsWanted(*row, route)) continue;
      fmt::print("{:<30} {:8.0f}\n",
                 fmt::format("{}/{}", row->name, route.name),
                 PeakMemory(*row, route));
      std::fflush(stdout);
    }
  }
}

// The factors and the first use of the workspace are not measured; they are
// negligible for steps of a minute.
void Measure(const Case& at,
             const RouteRow& route,
             bool is_slow,
             benchmark::State* state) {
  const Step step = route.make();
  std::string label;
  if (!is_slow) label = step(at);
  for (auto _ : *state) label = step(at);
  state->SetLabel(label);
}

void Register(const std::shared_ptr<const Case>& at) {
  for (const RouteRow& route : RouteRows()) {
    if (!IsWanted(*at->row, route)) continue;
    const bool is_slow = route.is_full_svd && at->row->full_svd_is_slow;
    auto* registered = RegisterBenchmark(
        fmt::format("{}/{}", at->row->name, route.name),
        [=, &route](auto& state) { Measure(*at, route, is_slow, &state); });
    if (is_slow) registered->MinTime(1e-3);  // once
  }
}

void PrintRatios(const std::vector<std::shared_ptr<const Case>>& cases,
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
    const auto print = [&](const std::string& route, double flops) {
      const double seconds =
          reporter.Median(std::string(at->row->name) + "/" + route);
      if (std::isnan(seconds)) return;
      fmt::print(
          "{:<29} {:5} x {:7}: {:9.3f} GF, {:5.1f} GF/s, {:5.2f} times the "
          "limit\n",
          std::string(at->row->name) + "/" + route,
          at->J().rows(),
          at->J().cols(),
          flops * 1e-9,
          flops / seconds * 1e-9,
          seconds * gemm_rate / flops);
    };
    print("gram", at->LimitFlops());
    print("parameter_gram", at->GramFlops());
  }
}

bool Run(RunCounts* counts, std::string* error) {
  std::vector<const CaseRow*> rows;
  std::vector<const RouteRow*> routes;
  if (!CheckFlags({{"truncation", {0.0, 1.0, false, true}},
                   {"blas_threads", {1.0, 256.0}}},
                  error) ||
      !FindRows("routes", RouteRows(), &routes, error) ||
      !FindRows("cases", CaseRows(), &rows, error)) {
    return false;
  }
  SetBlasThreads(FLAGS_blas_threads);
  if (FLAGS_memory) {
    PrintMemory(rows);
    return true;
  }
  std::vector<std::shared_ptr<const Case>> cases;
  for (const CaseRow* row : rows) {
    cases.push_back(std::make_shared<const Case>(*row));
    Register(cases.back());
  }
  const double gemm_rate = GemmRate();
  RatioReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  *counts = reporter.counts();
  PrintRatios(cases, reporter, gemm_rate);
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunBenchmarks(
      argc,
      argv,
      "times the half-inverse step's linear algebra by each route",
      invgrad::Run);
}
