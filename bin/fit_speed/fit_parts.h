// The parts of the program fit_speed. Each prints a table.
#ifndef BIN_FIT_SPEED_FIT_PARTS_H_
#define BIN_FIT_SPEED_FIT_PARTS_H_

#include <functional>
#include <string>

#include "bin/support/program.h"
#include "gflags/gflags.h"

// Defined in fit_speed.cc.
DECLARE_int32(fits);
DECLARE_int32(points);
DECLARE_int32(rows);
DECLARE_int32(threads);
DECLARE_int32(repetitions);

namespace invgrad {

void CompareManyFits(RunCounts* counts);

// Returns false, with *error set, if a process fails.
bool CompareStreamingFits(RunCounts* counts, std::string* error);

void CompareFactors(RunCounts* counts);

double Seconds(const std::function<void()>& work);

}  // namespace invgrad

#endif  // BIN_FIT_SPEED_FIT_PARTS_H_
