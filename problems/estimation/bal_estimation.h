// Bundle adjustment (bundle_adjustment.h) as an Estimation.
#ifndef PROBLEMS_ESTIMATION_BAL_ESTIMATION_H_
#define PROBLEMS_ESTIMATION_BAL_ESTIMATION_H_

#include <memory>
#include <string>

#include "problems/estimation/estimation.h"

namespace invgrad {

// Returns null, with *error set, if the file cannot be read.
std::unique_ptr<Estimation> ReadBalEstimation(const std::string& path,
                                              std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_BAL_ESTIMATION_H_
