#include "invgrad/internal/activation.h"

#include <cmath>
#include <cstddef>

#include "invgrad/chain/tanh.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

// phi', phi'', ..
using Derivatives = double[kMaxActivationOrder];

// z[i] = function(z[i], &derivatives). The compiler removes the derivatives that
// are not stored.
template <int kNumDerivatives, typename Function>
void Apply(int size, double* z, double* derivatives, const Function& function) {
  Derivatives d;
  for (int i = 0; i < size; ++i) {
    z[i] = function(z[i], d);
    for (int p = 0; p < kNumDerivatives; ++p) {
      derivatives[static_cast<std::ptrdiff_t>(p) * size + i] = d[p];
    }
  }
}

template <typename Function>
void Apply(int size,
           double* z,
           int num_derivatives,
           double* derivatives,
           const Function& function) {
  switch (num_derivatives) {
    case 0:
      return Apply<0>(size, z, derivatives, function);
    case 1:
      return Apply<1>(size, z, derivatives, function);
    case 2:
      return Apply<2>(size, z, derivatives, function);
    case 3:
      return Apply<3>(size, z, derivatives, function);
    case 4:
      return Apply<4>(size, z, derivatives, function);
    case 5:
      return Apply<5>(size, z, derivatives, function);
    case 6:
      return Apply<6>(size, z, derivatives, function);
    default:
      LOG(FATAL) << "Derivatives up to order " << kMaxActivationOrder
                 << " are known.";
  }
}

}  // namespace

const char* ActivationName(Activation activation) {
  constexpr const char* kNames[] = {
      "linear", "tanh", "relu", "sigmoid", "gelu"};
  return kNames[static_cast<int>(activation)];
}

void ActivateAll(Activation activation,
                 int size,
                 double* z,
                 int num_derivatives,
                 double* derivatives) {
  const auto apply = [=](const auto& function) {
    Apply(size, z, num_derivatives, derivatives, function);
  };
  switch (activation) {
    case Activation::kLinear:
      return apply([](double z, Derivatives& d) {
        d[0] = 1.0;
        d[1] = d[2] = d[3] = d[4] = d[5] = 0.0;
        return z;
      });
    case Activation::kTanh:
      TanhAll(size, z);
      return apply([](double t, Derivatives& d) {
        const double t2 = t * t;
        const double s = 1.0 - t2;
        d[0] = s;
        d[1] = -2.0 * t * s;
        d[2] = s * (6.0 * t2 - 2.0);
        d[3] = 8.0 * t * s * (2.0 - 3.0 * t2);
        d[4] = 8.0 * s * (2.0 + t2 * (15.0 * t2 - 15.0));
        d[5] = 16.0 * t * s * (t2 * (60.0 - 45.0 * t2) - 17.0);
        return t;
      });
    case Activation::kRelu:
      return apply([](double z, Derivatives& d) {
        d[0] = z <= 0.0 ? 0.0 : 1.0;
        d[1] = d[2] = d[3] = d[4] = d[5] = 0.0;
        return z <= 0.0 ? 0.0 : z;
      });
    case Activation::kSigmoid:
      return apply([](double z, Derivatives& d) {
        const double e = std::exp(-std::abs(z));
        const double small = e / (1.0 + e);  // 1 - phi(|z|)
        const double large = 1.0 / (1.0 + e);
        const double s = small * large;
        d[0] = s;
        d[1] = s * (z < 0.0 ? large - small : small - large);
        d[2] = s * (1.0 - 6.0 * s);
        d[3] = d[1] * (1.0 - 12.0 * s);
        d[4] = s * (1.0 + s * (120.0 * s - 30.0));
        d[5] = d[1] * (1.0 + s * (360.0 * s - 60.0));
        return z < 0.0 ? small : large;
      });
    case Activation::kGelu:
      return apply([](double z, Derivatives& d) {
        const double distribution = 0.5 * std::erfc(-M_SQRT1_2 * z);
        const double z2 = z * z;
        const double density =
            0.5 * M_2_SQRTPI * M_SQRT1_2 * std::exp(-0.5 * z2);
        d[0] = distribution + z * density;
        d[1] = density * (2.0 - z2);
        d[2] = density * z * (z2 - 4.0);
        d[3] = density * (7.0 * z2 - z2 * z2 - 4.0);
        d[4] = density * z * (z2 * (z2 - 11.0) + 18.0);
        d[5] = density * (18.0 - z2 * (51.0 + z2 * (z2 - 16.0)));
        return z * distribution;
      });
  }
}

}  // namespace invgrad
