/*
Measures how long the library's computations take, beside named alternatives.

Sample runs:

  bench --benchmark_filter=^step/linear_chain/ --benchmark_repetitions=3
  bench --benchmark_filter=^training/ --problem=oscillator_chain --rules=adam,sip
  bench --benchmark_filter=^covariance/ --input=M3500.g2o
  bench --benchmark_filter=^fits/ --benchmark_list_tests
  bench --benchmark_filter=^step/cubic_chain/gram --blas_threads=2

Google Benchmark (its flags: bench --help), by default with one BLAS thread.
Benchmarks are named SUBJECT[/CASE]/METHOD; sources: bin/bench/.

  step        the linear algebra of a half-inverse step, beside full SVDs
  jacobian    network and simulator, beside automatic differentiation
  field       the products of fields' Jacobians, beside the value
  training    steps of --rules on --problem; samples alone and on threads
  callback    ceres::Solve with declined proposals, beside without
  blocks      models as cost functions, in few or in many residual blocks
  determined  a step for 6 unknowns, beside Eigen's decompositions
  covariance  of --input, beside an LM iteration and ceres::Covariance
  fits        many small, streamed and global fits, beside ceres::Solve
  starts      variable projection from random starts, beside ceres::Solve
  torch       a U-net through invgrad, beside libtorch alone
  ranks       mpirun -n 2 bench: a training step, beside one process

Then follow the ratios of this run, by medians of the repetitions, and the most
memory that the process had.
*/

#include "bin/bench/bench.h"

#include <sys/resource.h>

#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "benchmark/benchmark.h"
#include "bin/support/program.h"
#include "bin/support/ranks.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/blas_threads.h"
#include "problems/problems.h"

DEFINE_string(input,
              "",
              "files of real data, as of estimate, comma-separated: for "
              "covariance and callback");
DEFINE_int32(blas_threads, 1, "threads of the linear algebra");

namespace invgrad {
namespace {

// Whether a run of Google Benchmark ended by SkipWithError, which versions name
// differently: error_occurred up to 1.7, skipped from 1.8 on.
template <typename Run>
auto HasFailed(const Run& run, int /*first choice*/)
    -> decltype(bool(run.error_occurred)) {
  return run.error_occurred;
}
template <typename Run>
auto HasFailed(const Run& run, long /*second choice*/)
    -> decltype(run.skipped != 0) {
  return run.skipped != 0;
}

// Names of a benchmark and of its reference.
std::vector<std::pair<std::string, std::string>>& Ratios() {
  static auto& ratios = *new std::vector<std::pair<std::string, std::string>>;
  return ratios;
}

// Prints Google Benchmark's lines, and keeps the times.
class RatioReporter final : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    benchmark::ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration) continue;
      counts_.Add(!HasFailed(run, 0));
      if (HasFailed(run, 0)) continue;
      times_[run.run_name.function_name].push_back(run.GetAdjustedRealTime());
    }
  }

  const RunCounts& counts() const { return counts_; }

  void PrintRatios() {
    for (const auto& [name, reference] : Ratios()) {
      if (times_.count(name) == 0 || times_.count(reference) == 0) continue;
      fmt::print("{:<40} / {:<28} = {:8.3g}\n",
                 name,
                 reference,
                 Median(name) / Median(reference));
    }
  }

 private:
  double Median(const std::string& name) {
    std::vector<double>& times = times_[name];
    std::sort(times.begin(), times.end());
    return times[times.size() / 2];
  }

  std::map<std::string, std::vector<double>> times_;  // in the unit of the line
  RunCounts counts_;
};

bool AddBenchmarks(std::string* error) {
#ifdef INVGRAD_MPI
  if (NumRanks() > 1) return AddRankBenchmarks(error);
#endif
  return AddStepBenchmarks(error) && AddJacobianBenchmarks(error) &&
         AddFieldBenchmarks(error) && AddTrainingBenchmarks(error) &&
         AddCallbackBenchmarks(error) && AddModelBlockBenchmarks(error) &&
         AddDeterminedStepBenchmarks(error) && AddCovarianceBenchmarks(error) &&
         AddManyFitsBenchmarks(error) &&
#ifdef INVGRAD_TORCH
         AddTorchBenchmarks(error) &&
#endif
         AddStreamingFitBenchmarks(error) && AddGlobalFitBenchmarks(error) &&
         AddExponentialsBenchmarks(error);
}

bool Run(RunCounts* counts, std::string* error) {
  if (!CheckFlags({{"blas_threads", {1.0, 256.0}}}, error) ||
      !AgreeOnRanks(AddBenchmarks(error), error)) {
    return false;
  }
  SetBlasThreads(FLAGS_blas_threads);
  RatioReporter reporter;
  if (benchmark::RunSpecifiedBenchmarks(&reporter) == 0) {
    *error =
        "no benchmark has a name like --benchmark_filter; "
        "--benchmark_list_tests shows them (covariance needs --input, ranks "
        "mpirun)";
    return false;
  }
  *counts = reporter.counts();
  if (counts->num_worked == 0) return true;
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  fmt::print("\nTimes as ratios; peak memory {:.0f} MB\n",
             static_cast<double>(usage.ru_maxrss) / 1024.0);
  reporter.PrintRatios();
  return true;
}

}  // namespace

benchmark::internal::Benchmark* AddBenchmark(
    const std::string& name,
    const std::string& reference,
    std::function<void(benchmark::State&)> measure) {
  if (!reference.empty()) Ratios().emplace_back(name, reference);
  return benchmark::RegisterBenchmark(name.c_str(), std::move(measure))
      ->Unit(benchmark::kMillisecond);
}

}  // namespace invgrad

int main(int argc, char** argv) {
  invgrad::UseProcessorsKernels(argv);  // before Google's flags are taken
  benchmark::Initialize(&argc, argv);
  invgrad::RegisterProblems();
  invgrad::BenchTraining().Add();
  return invgrad::RunProgramOnRanks(
      argc,
      argv,
      "measures how long the library's computations take, beside named "
      "alternatives\n\n"
      "  bench --benchmark_filter=^step/linear_chain/",
      invgrad::Run);
}
