// A loss given by a functor on a scalar type, differentiated by Jets.
//
//   L(y, y*),   g = dL/dy,   H_L = d2L/dy2
//
// Shapes:  y, y*: kSize.
//   template <typename T>
//   bool operator()(const T* y, const double* target, T* loss) const;
// Cost:    g: one evaluation with Jets of kSize partial derivatives; H_L: one
//          with kSize^2.
// Fails:   returns false if the functor does or a value is not finite.
#ifndef INVGRAD_AUTODIFF_LOSS_H_
#define INVGRAD_AUTODIFF_LOSS_H_

#include <utility>

#include "invgrad/autodiff_simulator.h"
#include "invgrad/loss.h"

namespace invgrad {

template <typename Functor, int kSize>
class AutoDiffLoss : public Loss {
 public:
  explicit AutoDiffLoss(Functor functor = Functor())
      : simulator_(std::move(functor)) {}

  int size() const override { return kSize; }
  bool Evaluate(const double* y,
                const double* target,
                double* loss,
                double* gradient,
                double* hessian) const override {
    const double one = 1.0;
    return simulator_.Evaluate(y, target, loss, gradient) &&
           (hessian == nullptr ||
            simulator_.WeightedHessian(y, target, &one, hessian));
  }

 private:
  AutoDiffSimulator<Functor, kSize, 1, kSize> simulator_;  // from y to L
};

}  // namespace invgrad

#endif  // INVGRAD_AUTODIFF_LOSS_H_
