// The program compare, run as a user runs it, for tests.
#ifndef INVGRAD_TESTS_PROGRAMS_COMPARE_PROGRAM_H_
#define INVGRAD_TESTS_PROGRAMS_COMPARE_PROGRAM_H_

#include <string>
#include <vector>

#include "tests/support/program_runner.h"

namespace invgrad {

class CompareProgram : public ProgramRunner {
 protected:
  CompareProgram() : ProgramRunner("compare") {}

  // A run of some milliseconds.
  std::vector<std::string> SmallRun(const std::string& output) const {
    return {"--problem=oscillator_chain:num_samples=64",
            "--rules=half_inverse,adam:step_size=1e-2",
            "--epochs=3",
            "--batch_size=16",
            "--plots=false",
            "--output=" + Path(output)};
  }
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_PROGRAMS_COMPARE_PROGRAM_H_
