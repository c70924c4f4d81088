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
#ifndef INVGRAD_CHAIN_AUTODIFF_LOSS_H_
#define INVGRAD_CHAIN_AUTODIFF_LOSS_H_

#include <algorithm>
#include <utility>

#include "Eigen/Core"
#include "ceres/jet.h"
#include "invgrad/chain/loss.h"
#include "invgrad/chain/simulator.h"
#include "invgrad/core/nested_jet.h"
#include "invgrad/core/scratch.h"

namespace invgrad {

template <typename Functor, int kSize>
class AutoDiffLoss final : public Loss {
 public:
  explicit AutoDiffLoss(Functor functor = Functor())
      : functor_(std::move(functor)) {}

  int size() const override { return kSize; }

  bool Evaluate(const double* y,
                const double* target,
                double* loss,
                double* gradient,
                double* hessian) const override {
    if (gradient == nullptr && hessian == nullptr) {
      return functor_(y, target, loss) && AllFinite(loss, 1);
    }
    if (hessian == nullptr) return Gradient(y, target, loss, gradient);
    using Jet = NestedJet<kSize>;
    Scratch<Jet> y_jets(kSize);
    for (int i = 0; i < kSize; ++i) y_jets[i] = MakeHessianJet<kSize>(y[i], i);
    Jet value;
    if (!functor_(y_jets.data(), target, &value)) return false;
    *loss = value.a.a;
    Eigen::Map<Eigen::Matrix<double, kSize, kSize>> H(hessian);
    for (int i = 0; i < kSize; ++i) {
      if (gradient != nullptr) gradient[i] = value.v[i].a;
      H.col(i) = value.v[i].v;
    }
    return AllFinite(loss, 1) && AllFinite(hessian, H.size()) &&
           (gradient == nullptr || AllFinite(gradient, kSize));
  }

 private:
  bool Gradient(const double* y,
                const double* target,
                double* loss,
                double* gradient) const {
    using Jet = ceres::Jet<double, kSize>;
    Scratch<Jet> y_jets(kSize);
    for (int i = 0; i < kSize; ++i) y_jets[i] = Jet(y[i], i);
    Jet value;
    if (!functor_(y_jets.data(), target, &value)) return false;
    *loss = value.a;
    std::copy_n(value.v.data(), kSize, gradient);
    return AllFinite(loss, 1) && AllFinite(gradient, kSize);
  }

  Functor functor_;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_AUTODIFF_LOSS_H_
