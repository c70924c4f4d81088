#include "invgrad/spectral/gradient_noise.h"

#include <algorithm>
#include <limits>

#include "invgrad/internal/logging.h"

namespace invgrad {

double GradientNoiseScale(const LeaveOneOutScore& gradient_score,
                          int num_samples) {
  CHECK_GT(num_samples, 0);
  const double g_c = gradient_score.g_c;
  const double g_fitted = gradient_score.g_fitted;
  const bool is_zero = g_c == 0.0 && g_fitted == 0.0;
  if (num_samples > 1 && is_zero) return 0.0;
  if (num_samples == 1 || g_c <= 0.0) {
    return std::numeric_limits<double>::infinity();
  }
  // Rounding, or the choice of samples, can make the variance negative.
  return std::max(0.0, (num_samples - 1.0) * (g_fitted / g_c) - num_samples);
}

}  // namespace invgrad
