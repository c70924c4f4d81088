// A program of Google Benchmark that prints ratios of the times of one run.
#ifndef BIN_SUPPORT_BENCHMARKS_H_
#define BIN_SUPPORT_BENCHMARKS_H_

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "benchmark/benchmark.h"
#include "bin/support/program.h"
#include "fmt/core.h"
#include "invgrad/core/blas.h"

namespace invgrad {

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

// Prints Google Benchmark's lines, and keeps the times.
class RatioReporter final : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    benchmark::ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration) continue;
      const bool has_failed = HasFailed(run, 0);
      counts_.Add(!has_failed);
      if (has_failed) continue;
      // In seconds, for any printed unit.
      times_[run.run_name.function_name].push_back(
          run.GetAdjustedRealTime() /
          benchmark::GetTimeUnitMultiplier(run.time_unit));
    }
  }

  const RunCounts& counts() const { return counts_; }

  // Seconds, the median of the repetitions; NaN if it did not run.
  double Median(const std::string& name) const {
    const auto it = times_.find(name);
    if (it == times_.end()) return std::numeric_limits<double>::quiet_NaN();
    std::vector<double> sorted = it->second;
    std::sort(sorted.begin(), sorted.end());
    return sorted[sorted.size() / 2];
  }

  // The ratio of the times of `slow` and `fast`, if both ran.
  void PrintRatio(const std::string& slow, const std::string& fast) const {
    const double ratio = Median(slow) / Median(fast);
    if (!std::isnan(ratio)) {
      fmt::print("{:<34} / {:<28} = {:8.3g}\n", slow, fast, ratio);
    }
  }

 private:
  std::map<std::string, std::vector<double>> times_;
  RunCounts counts_;
};

inline benchmark::internal::Benchmark* RegisterBenchmark(
    const std::string& name, std::function<void(benchmark::State&)> measure) {
  return benchmark::RegisterBenchmark(name.c_str(), std::move(measure))
      ->Unit(benchmark::kMillisecond);
}

// The dgemm rate of this run, in flops a second.
inline double GemmRate() {
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

// RunProgram after Google Benchmark has taken its flags.
inline int RunBenchmarks(int argc,
                         char** argv,
                         const std::string& usage,
                         bool (*run)(RunCounts* counts, std::string* error)) {
  UseProcessorsKernels(argv);
  benchmark::Initialize(&argc, argv);
  return RunProgram(argc, argv, usage, run);
}

}  // namespace invgrad

#endif  // BIN_SUPPORT_BENCHMARKS_H_
