#include <algorithm>
#include <cmath>

#include "fmt/core.h"
#include "invgrad/spectral.h"

namespace invgrad {

SpectralFilter SpectralFilter::Power(double kappa, double tau) {
  SpectralFilter filter;
  filter.kappa = kappa;
  filter.tau = tau;
  return filter;
}

SpectralFilter SpectralFilter::LevenbergMarquardt(double damping,
                                                  double relative_damping) {
  SpectralFilter filter;
  filter.kappa = 1.0;
  filter.tau = 0.0;
  filter.damping = damping;
  filter.relative_damping = relative_damping;
  return filter;
}

bool SpectralFilter::IsValid(std::string* error) const {
  const struct {
    const char* name;
    double value;
    bool in_range;
    const char* allowed;
  } fields[] = {
      {"kappa", kappa, kappa >= -1.0 && kappa <= 1.0, "[-1, 1]"},
      {"tau", tau, tau >= 0.0 && tau < 1.0, "[0, 1)"},
      {"damping", damping, damping >= 0.0, "[0, inf)"},
      {"relative_damping",
       relative_damping,
       relative_damping >= 0.0,
       "[0, inf)"},
  };
  for (const auto& field : fields) {
    if (field.in_range && std::isfinite(field.value)) continue;
    *error = fmt::format("{}={:g} is out of range; allowed: {}",
                         field.name,
                         field.value,
                         field.allowed);
    return false;
  }
  return true;
}

bool SpectralFilter::IsGradientDescent() const {
  return kappa == -1.0 && tau == 0.0;
}

bool SpectralFilter::Keeps(double s, double s_max) const {
  return s > 0.0 && s > tau * s_max;
}

double SpectralFilter::RootOfDamping(double s_max) const {
  return std::hypot(std::sqrt(damping), std::sqrt(relative_damping) * s_max);
}

double SpectralFilter::PeakBelow(double highest, double s_max) const {
  if (kappa <= 0.0) return highest;
  return IsDamped() ? std::min(highest, RootOfDamping(s_max) / std::sqrt(kappa))
                    : highest;
}

double SpectralFilter::operator()(double s, double s_max) const {
  if (!(s > 0.0)) return 0.0;
  if (!Keeps(s, s_max)) {
    if (!clamp) return 0.0;
    s = tau * s_max;
  }
  if (!IsDamped()) return std::pow(s, -kappa);
  const double root = std::hypot(s, RootOfDamping(s_max));
  return s / root * std::pow(root, -kappa);
}

}  // namespace invgrad
