// The parts of the program separable_fits. Each prints a table.
#ifndef BIN_SEPARABLE_FITS_PARTS_H_
#define BIN_SEPARABLE_FITS_PARTS_H_

#include <string>

#include "bin/support/program.h"
#include "gflags/gflags.h"

// Defined in separable_fits.cc.
DECLARE_int32(starts);
DECLARE_double(amplitude);
DECLARE_double(noise);
DECLARE_string(terms);
DECLARE_int32(sides);
DECLARE_int32(samples);
DECLARE_int32(repetitions);

namespace invgrad {

bool CompareExponentials(RunCounts* counts, std::string* error);

void CompareGlobalFits(RunCounts* counts);

}  // namespace invgrad

#endif  // BIN_SEPARABLE_FITS_PARTS_H_
