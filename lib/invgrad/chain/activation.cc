#include "invgrad/chain/activation.h"

#include <cmath>

#include "invgrad/chain/tanh.h"

namespace invgrad {
namespace {

struct Derivatives {
  double slope = 0.0;
  double curvature = 0.0;
  double third = 0.0;
  double fourth = 0.0;
};

}  // namespace

const char* ActivationName(Activation activation) {
  constexpr const char* kNames[] = {
      "linear", "tanh", "relu", "sigmoid", "gelu"};
  return kNames[static_cast<int>(activation)];
}

void ActivateAll(Activation activation,
                 int size,
                 double* z,
                 double* slope,
                 double* curvature,
                 double* third,
                 double* fourth) {
  // z[i] = function(z[i], &derivatives). The compiler removes the derivatives
  // whose pointers are null.
  const auto apply = [=](const auto& function) {
    Derivatives d;
    if (slope == nullptr) {
      for (int i = 0; i < size; ++i) z[i] = function(z[i], &d);
    } else if (curvature == nullptr) {
      for (int i = 0; i < size; ++i) {
        z[i] = function(z[i], &d);
        slope[i] = d.slope;
      }
    } else {
      for (int i = 0; i < size; ++i) {
        z[i] = function(z[i], &d);
        slope[i] = d.slope;
        curvature[i] = d.curvature;
        if (third != nullptr) third[i] = d.third;
        if (fourth != nullptr) fourth[i] = d.fourth;
      }
    }
  };
  switch (activation) {
    case Activation::kLinear:
      apply([](double z, Derivatives* d) {
        *d = {1.0, 0.0, 0.0, 0.0};
        return z;
      });
      return;
    case Activation::kTanh:
      TanhAll(size, z);
      apply([](double t, Derivatives* d) {
        const double s = 1.0 - t * t;
        d->slope = s;
        d->curvature = -2.0 * t * s;
        d->third = s * (6.0 * t * t - 2.0);
        d->fourth = 8.0 * t * s * (2.0 - 3.0 * t * t);
        return t;
      });
      return;
    case Activation::kRelu:
      apply([](double z, Derivatives* d) {
        *d = {z <= 0.0 ? 0.0 : 1.0, 0.0, 0.0, 0.0};
        return z <= 0.0 ? 0.0 : z;
      });
      return;
    case Activation::kSigmoid:
      apply([](double z, Derivatives* d) {
        const double e = std::exp(-std::abs(z));
        const double small = e / (1.0 + e);  // 1 - phi(|z|)
        const double large = 1.0 / (1.0 + e);
        d->slope = small * large;
        d->curvature = d->slope * (z < 0.0 ? large - small : small - large);
        d->third = d->slope * (1.0 - 6.0 * d->slope);
        d->fourth = d->curvature * (1.0 - 12.0 * d->slope);
        return z < 0.0 ? small : large;
      });
      return;
    case Activation::kGelu:
      apply([](double z, Derivatives* d) {
        const double distribution = 0.5 * std::erfc(-M_SQRT1_2 * z);
        const double z2 = z * z;
        const double density =
            0.5 * M_2_SQRTPI * M_SQRT1_2 * std::exp(-0.5 * z2);
        d->slope = distribution + z * density;
        d->curvature = density * (2.0 - z2);
        d->third = density * z * (z2 - 4.0);
        d->fourth = density * (7.0 * z2 - z2 * z2 - 4.0);
        return z * distribution;
      });
      return;
  }
}

}  // namespace invgrad
