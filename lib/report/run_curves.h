// Curves of runs that differ in the seed alone as one curve: their median, with
// the band from the least to the greatest.
//
// The runs may be sampled at different x. Between two samples a run is
// interpolated, linearly in x, and in log y where both are positive; after its
// last sample it keeps the last value. A value that is not finite is a failure:
// it counts as worst in the median, and its part of the band is left out. The
// curve begins where all runs have begun.
#ifndef REPORT_RUN_CURVES_H_
#define REPORT_RUN_CURVES_H_

#include <vector>

#include "report/plot.h"

namespace invgrad {

// At every x of a run, in ascending order. Title, style and colour are those of
// the first run, of which there must be one (CHECKed). One run is returned as
// it is, without a band. Of an even number of values the median is the lower of
// the two.
Series MedianCurve(const std::vector<Series>& runs);

}  // namespace invgrad

#endif  // REPORT_RUN_CURVES_H_
