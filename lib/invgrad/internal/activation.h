// The activation functions phi of a network's hidden units.
//
//   linear z,   tanh z,   ReLU max(z, 0),   sigmoid 1 / (1 + e^-z),
//   GELU z Phi(z) with Phi the normal distribution function [1]
//
// ReLU has slope 0 at z = 0, as in TensorFlow and PyTorch. NaN propagates
// through all of them.
//
// [1] Hendrycks, Gimpel. Gaussian Error Linear Units. 2016. arXiv 1606.08415.
//     The exact form, not its tanh approximation.
#ifndef INVGRAD_INTERNAL_ACTIVATION_H_
#define INVGRAD_INTERNAL_ACTIVATION_H_

#include <cmath>

#include "ceres/jet.h"

namespace invgrad {

enum class Activation { kLinear, kTanh, kRelu, kSigmoid, kGelu };
inline constexpr Activation kActivations[] = {Activation::kLinear,
                                              Activation::kTanh,
                                              Activation::kRelu,
                                              Activation::kSigmoid,
                                              Activation::kGelu};

// "linear", "tanh", "relu", "sigmoid", "gelu"
const char* ActivationName(Activation activation);

// phi(z) for any scalar type of Ceres' autodiff.
template <typename T>
T Activate(Activation activation, const T& z) {
  using std::erfc;
  using std::exp;
  using std::tanh;
  switch (activation) {
    case Activation::kLinear:
      return z;
    case Activation::kTanh:
      return tanh(z);
    case Activation::kRelu:
      return z <= T(0.0) ? T(0.0) : z;
    case Activation::kSigmoid:
      // The argument of exp is never positive: no overflow.
      if (z < T(0.0)) {
        const T e = exp(z);
        return e / (T(1.0) + e);
      }
      return T(1.0) / (T(1.0) + exp(-z));
    case Activation::kGelu:
      // 1 + erf would cancel for z < 0.
      return T(0.5) * z * erfc(T(-M_SQRT1_2) * z);
  }
  return z;
}

// The highest derivative of phi that is known.
inline constexpr int kMaxActivationOrder = 6;

// phi of `size` values in place, and its first num_derivatives <=
// kMaxActivationOrder derivatives: phi^(p) of all values from
// derivatives + (p - 1) size on.
void ActivateAll(Activation activation,
                 int size,
                 double* z,
                 int num_derivatives,
                 double* derivatives);

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_ACTIVATION_H_
