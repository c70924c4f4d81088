// CHECK, LOG and VLOG, for the library's sources and for templates in its
// headers. No other header of the library includes a logging library, because
// Ceres brings one with it, whose macros have the same names: glog, or, in
// versions after 2.2, Abseil.
#ifndef INVGRAD_INTERNAL_LOGGING_H_
#define INVGRAD_INTERNAL_LOGGING_H_

#include "ceres/version.h"

#if CERES_VERSION_MAJOR == 2 && CERES_VERSION_MINOR <= 2
#include "glog/logging.h"
#else
#include "absl/log/check.h"
#include "absl/log/log.h"
#endif

#endif  // INVGRAD_INTERNAL_LOGGING_H_
