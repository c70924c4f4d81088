#include "invgrad/chain/activation.h"

#include <cmath>

namespace invgrad {
namespace {

// Applies value(z, &slope, &curvature) to every entry. The compiler drops what
// the null pointers do not ask for.
template <typename Function>
void ForEach(
    int size, double* z, double* slope, double* curvature, Function function) {
  double s = 0.0;
  double c = 0.0;
  if (slope == nullptr) {
    for (int i = 0; i < size; ++i) z[i] = function(z[i], &s, &c);
  } else if (curvature == nullptr) {
    for (int i = 0; i < size; ++i) z[i] = function(z[i], &slope[i], &c);
  } else {
    for (int i = 0; i < size; ++i) {
      z[i] = function(z[i], &slope[i], &curvature[i]);
    }
  }
}

}  // namespace

const char* ActivationName(Activation activation) {
  switch (activation) {
    case Activation::kLinear:
      return "linear";
    case Activation::kTanh:
      return "tanh";
    case Activation::kRelu:
      return "relu";
    case Activation::kSigmoid:
      return "sigmoid";
    case Activation::kGelu:
      return "gelu";
  }
  return "unknown";
}

void ActivateAll(Activation activation,
                 int size,
                 double* z,
                 double* slope,
                 double* curvature) {
  switch (activation) {
    case Activation::kLinear:
      ForEach(size, z, slope, curvature, [](double z, double* s, double* c) {
        *s = 1.0;
        *c = 0.0;
        return z;
      });
      return;
    case Activation::kTanh:
      ForEach(size, z, slope, curvature, [](double z, double* s, double* c) {
        const double t = std::tanh(z);
        *s = 1.0 - t * t;
        *c = -2.0 * t * *s;
        return t;
      });
      return;
    case Activation::kRelu:
      ForEach(size, z, slope, curvature, [](double z, double* s, double* c) {
        *s = z <= 0.0 ? 0.0 : 1.0;
        *c = 0.0;
        return z <= 0.0 ? 0.0 : z;
      });
      return;
    case Activation::kSigmoid:
      ForEach(size, z, slope, curvature, [](double z, double* s, double* c) {
        const double e = std::exp(-std::abs(z));
        const double small = e / (1.0 + e);  // 1 - phi(|z|)
        const double large = 1.0 / (1.0 + e);
        *s = small * large;
        *c = *s * (z < 0.0 ? large - small : small - large);
        return z < 0.0 ? small : large;
      });
      return;
    case Activation::kGelu:
      ForEach(size, z, slope, curvature, [](double z, double* s, double* c) {
        const double distribution = 0.5 * std::erfc(-M_SQRT1_2 * z);
        const double density =
            0.5 * M_2_SQRTPI * M_SQRT1_2 * std::exp(-0.5 * z * z);
        *s = distribution + z * density;
        *c = density * (2.0 - z * z);
        return z * distribution;
      });
      return;
  }
}

}  // namespace invgrad
