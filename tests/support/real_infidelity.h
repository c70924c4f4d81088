// A loss whose outputs keep their norm, for tests.
#ifndef TESTS_REAL_INFIDELITY_H_
#define TESTS_REAL_INFIDELITY_H_

#include "invgrad/autodiff_loss.h"
#include "invgrad/loss.h"

namespace invgrad {

template <int kSize>
struct RealInfidelityFunctor {
  template <typename T>
  bool operator()(const T* y, const double* target, T* loss) const {
    T overlap(0.0);
    for (int k = 0; k < kSize; ++k) overlap += target[k] * y[k];
    *loss = 1.0 - overlap * overlap;
    return true;
  }
};

// L = 1 - (y* . y)^2, with |y| = 1. On the circle y = (cos x, sin x) with
// y* = (1, 0), L = sin(x)^2.
template <int kSize>
class RealInfidelity final
    : public AutoDiffLoss<RealInfidelityFunctor<kSize>, kSize> {
 public:
  bool has_invariant() const override { return true; }
};

}  // namespace invgrad

#endif  // TESTS_REAL_INFIDELITY_H_
