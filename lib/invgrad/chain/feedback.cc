#include "invgrad/internal/feedback.h"

#include <cstddef>

namespace invgrad {

int Feedback::AdvanceBatch(int count,
                           const double* states,
                           const double* controls,
                           double* next_states) const {
  const std::ptrdiff_t ns = state_size();
  for (int s = 0; s < count; ++s) {
    if (!Advance(states + s * ns,
                 controls + s * control_size(),
                 next_states + s * ns)) {
      return s;
    }
  }
  return count;
}

int Feedback::StepJacobiansBatch(int count,
                                 const double* x,
                                 const double* starts,
                                 double* M) const {
  const std::ptrdiff_t ns = state_size();
  const std::ptrdiff_t nc = control_size();
  for (int s = 0; s < count; ++s) {
    if (!StepJacobians(x + s * num_calls() * nc,
                       starts + s * ns,
                       M + s * num_calls() * ns * (ns + nc))) {
      return s;
    }
  }
  return count;
}

}  // namespace invgrad
