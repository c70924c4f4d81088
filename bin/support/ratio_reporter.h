// Prints Google Benchmark's lines, and keeps the times for ratios of one run.
#ifndef BIN_SUPPORT_RATIO_REPORTER_H_
#define BIN_SUPPORT_RATIO_REPORTER_H_

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "benchmark/benchmark.h"

namespace invgrad {

class RatioReporter final : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    benchmark::ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs) {
      if (run.error_occurred || run.run_type != Run::RT_Iteration) continue;
      // In seconds, for any printed unit.
      times_[run.run_name.function_name].push_back(
          run.GetAdjustedRealTime() /
          benchmark::GetTimeUnitMultiplier(run.time_unit));
    }
  }

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
      std::printf("%-34s / %-28s = %8.3g\n", slow.c_str(), fast.c_str(), ratio);
    }
  }

  // The name of the fastest benchmark that ran; "" if none ran.
  std::string Fastest(const std::vector<std::string>& names) const {
    std::string fastest;
    double least = std::numeric_limits<double>::infinity();
    for (const std::string& name : names) {
      if (Median(name) < least) {
        least = Median(name);
        fastest = name;
      }
    }
    return fastest;
  }

 private:
  std::map<std::string, std::vector<double>> times_;
};

}  // namespace invgrad

#endif  // BIN_SUPPORT_RATIO_REPORTER_H_
