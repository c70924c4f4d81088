/*
Compares variable projection with minimization over all parameters: from random
starts, and for many right-hand sides.

Sample runs:

  separable_fits
  separable_fits --part=exponentials --terms=2,3 --starts=100
  separable_fits --part=global --sides=10000 --repetitions=1

exponentials  fits of sums of 2 to 5 exponentials c_j exp(-a_j t) to 100 samples
              in [0, 10] of the sum with c_j = 1, a_j = 0.1 3^j and noise, from
              --starts random starts: c uniform in [0, --amplitude], log a in
              log 0.03 ... log 30. The best minimum is the least cost of all
              runs, up to a relative 1e-4. A run has up to 500 iterations and
              tolerances of 1e-12.
global        --sides right-hand sides, sums of three decays with common rates:
              one ceres::Problem of all parameters, its reduced problem, and
              FitGlobal. Default options and tolerances; times are the least of
              --repetitions, with the construction of the problems.
*/

#include <string>

#include "bin/separable_fits/parts.h"
#include "bin/support/program.h"
#include "gflags/gflags.h"

DEFINE_string(part, "all", "all, exponentials or global");
DEFINE_int32(starts, 1000, "of each number of exponentials");
DEFINE_string(terms, "2,3,4,5", "numbers of exponentials, 2 to 5");
DEFINE_double(amplitude,
              2.0,
              "largest amplitude of a start; the true ones are 1");
DEFINE_double(noise, 1e-4, "standard deviation of a sample of exponentials");
DEFINE_int32(sides, 1000, "right-hand sides of the global fit");
DEFINE_int32(samples, 100, "of a right-hand side");
DEFINE_int32(repetitions, 3, "of the global fit");

namespace invgrad {
namespace {

bool Run(RunCounts* counts, std::string* error) {
  if (!CheckFlag("part", {"all", "exponentials", "global"}, error) ||
      !CheckFlags({{"starts", {1, 1000000}},
                   {"amplitude", {1e-12}},
                   {"noise", {1e-12}},
                   {"sides", {1, 1000000}},
                   {"samples", {6, 100000}},
                   {"repetitions", {1, 1000}}},
                  error)) {
    return false;
  }
  if (FLAGS_part != "global" && !CompareExponentials(counts, error)) {
    return false;
  }
  if (FLAGS_part != "exponentials") CompareGlobalFits(counts);
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgram(
      argc,
      argv,
      "compares variable projection with minimization over all parameters\n\n"
      "  separable_fits --part=exponentials --terms=2,3 --starts=100",
      invgrad::Run);
}
