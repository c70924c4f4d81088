// The program sweep, run as a user runs it, and its results.
#ifndef INVGRAD_TESTS_PROGRAMS_SWEEP_PROGRAM_H_
#define INVGRAD_TESTS_PROGRAMS_SWEEP_PROGRAM_H_

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/programs/csv_lines.h"
#include "tests/support/program_runner.h"

namespace invgrad {

class SweepProgram : public ProgramRunner {
 protected:
  SweepProgram() : ProgramRunner("sweep") {}

  // The exit code of SmallSweep, two of whose runs diverge.
  static constexpr int kSomeFailed = 2;

  static std::string SmallGrid() {
    return "lambda=1,0.1;rule=half_inverse,adam:step_size=1e-3|3e-2|1e200;"
           "seed=1";
  }

  // Eight runs of some milliseconds.
  std::vector<std::string> SmallSweep(const std::string& output) const {
    return {"--problem=toy_network:num_samples=32",
            "--grid=" + SmallGrid(),
            "--steps=6",
            "--plots=false",
            "--output=" + Path(output)};
  }

  CsvLines Results(const std::string& output) const {
    return ReadCsv(ReadAll(Path(output) + "/sweep.csv"));
  }

  // But for the times.
  CsvLines Losses(const std::string& output) const {
    CsvLines rows = Results(output);
    for (auto& row : rows) {
      row.erase("seconds");
      row.erase("ms_per_step");
    }
    return rows;
  }

  // The directories of the jobs, sorted.
  std::vector<std::string> Jobs(const std::string& output) const {
    std::vector<std::string> jobs;
    for (const auto& entry :
         std::filesystem::directory_iterator(Path(output) + "/jobs")) {
      jobs.push_back(entry.path());
    }
    std::sort(jobs.begin(), jobs.end());
    return jobs;
  }
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_PROGRAMS_SWEEP_PROGRAM_H_
