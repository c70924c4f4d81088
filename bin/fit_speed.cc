/*
Compares the fits of lib/invgrad/fit with ceres::Solve, as ratios within one
run.

Sample runs:

  fit_speed
  fit_speed --part=many --points=10
  fit_speed --part=streaming --rows=1000000 --repetitions=1

many       --fits fits of a exp(-b t) + c to --points points, by the same
           functor, starts and tolerances, in chunks of 1,000 which alternate.
           Ceres has a new problem for each data set, and a residual block for
           each point, as in its example curve_fitting.cc, or one for all
           points, which is faster. For the covariance it has DENSE_SVD, which
           alone allows for rank deficiency.
streaming  one fit of five sines, 10 parameters, to --rows points; a
           ceres::Problem has a tenth of them. Each fit has a process of its
           own; its peak memory is above that of the data.
factor     the triangular factor R of streaming_gram.h and the normal equations
           of 10 columns that nearly agree: errors of a step, and times.

Times are the smallest of --repetitions, and differences the largest.
*/

#include <string>

#include "bin/fit_speed/fit_parts.h"
#include "bin/support/program.h"
#include "gflags/gflags.h"

DEFINE_string(part, "all", "all, many, streaming or factor");
DEFINE_int32(fits, 100000, "data sets");
DEFINE_int32(points, 30, "of a data set");
DEFINE_int32(rows, 10000000, "of the streaming fit");
DEFINE_int32(threads, 2, "of the columns that name them");
DEFINE_int32(repetitions, 3, "of each time");

namespace invgrad {
namespace {

bool Run(RunCounts* counts, std::string* error) {
  if (!CheckFlag("part", {"all", "many", "streaming", "factor"}, error) ||
      !CheckFlags({{"fits", {1, 1000000}},
                   {"points", {3, 1000}},
                   {"rows", {1000, 1000000000}},
                   {"threads", {1, 1000}},
                   {"repetitions", {1, 1000}}},
                  error)) {
    return false;
  }
  const auto has_part = [](const std::string& part) {
    return FLAGS_part == "all" || FLAGS_part == part;
  };
  // Processes first: they are copies of this one.
  if (has_part("streaming") && !CompareStreamingFits(counts, error)) {
    return false;
  }
  if (has_part("many")) CompareManyFits(counts);
  if (has_part("factor")) CompareFactors(counts);
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgram(argc,
                             argv,
                             "compares fits with ceres::Solve: very many small "
                             "ones, and one with very "
                             "many rows",
                             invgrad::Run);
}
