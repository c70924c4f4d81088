#include "invgrad/internal/lanes.h"

#include "invgrad/internal/logging.h"

namespace invgrad {

void LogDifferentBranches() {
  static const bool is_logged = [] {
    VLOG(1) << "the branches of a simulator's functor differ between samples: "
               "these samples are computed one at a time";
    return true;
  }();
  static_cast<void>(is_logged);
}

}  // namespace invgrad
