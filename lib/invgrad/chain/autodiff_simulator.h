// A simulator given by a functor on a scalar type, differentiated by Jets with
// respect to all inputs at once.
//
//   y = P(x; c),   J = dP/dx,   H = sum_i w_i d2P_i/dx2
//
// Shapes:  x: kIn;  y: kOut;  c: kContext.
//   template <typename T> bool operator()(const T* x, T* y) const;
// or, with kContext > 0,
//   template <typename T>
//   bool operator()(const T* x, const double* context, T* y) const;
// Cost:    J: one evaluation with Jets of kIn partial derivatives; H: one with
//          kIn^2. For up to a few dozen inputs; for a simulator that steps
//          through time see time_stepping_simulator.h.
// Fails:   returns false if the functor does or a value is not finite.
#ifndef INVGRAD_CHAIN_AUTODIFF_SIMULATOR_H_
#define INVGRAD_CHAIN_AUTODIFF_SIMULATOR_H_

#include <utility>

#include "Eigen/Core"
#include "ceres/jet.h"
#include "invgrad/chain/simulator.h"
#include "invgrad/core/nested_jet.h"
#include "invgrad/core/scratch.h"

namespace invgrad {

template <typename Functor, int kIn, int kOut, int kContext = 0>
class AutoDiffSimulator final : public Simulator {
 public:
  explicit AutoDiffSimulator(Functor functor = Functor())
      : functor_(std::move(functor)) {}

  int num_inputs() const override { return kIn; }
  int num_outputs() const override { return kOut; }
  int num_context() const override { return kContext; }

  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override {
    if (jacobian == nullptr) return Call(x, context, y) && AllFinite(y, kOut);
    using Jet = ceres::Jet<double, kIn>;
    Scratch<Jet> x_jets(kIn);
    Scratch<Jet> y_jets(kOut);
    for (int i = 0; i < kIn; ++i) x_jets[i] = Jet(x[i], i);
    if (!Call(x_jets.data(), context, y_jets.data())) return false;
    // A row-major J is a column-major J^T.
    Eigen::Map<Eigen::Matrix<double, kIn, kOut>> J_transposed(jacobian);
    for (int i = 0; i < kOut; ++i) {
      y[i] = y_jets[i].a;
      J_transposed.col(i) = y_jets[i].v;
    }
    return AllFinite(y, kOut) && AllFinite(jacobian, J_transposed.size());
  }

  bool has_weighted_hessian() const override { return true; }
  bool WeightedHessian(const double* x,
                       const double* context,
                       const double* w,
                       double* hessian) const override {
    using Jet = NestedJet<kIn>;
    Scratch<Jet> x_jets(kIn);
    Scratch<Jet> y_jets(kOut);
    for (int i = 0; i < kIn; ++i) x_jets[i] = MakeHessianJet<kIn>(x[i], i);
    if (!Call(x_jets.data(), context, y_jets.data())) return false;
    Eigen::Map<Eigen::Matrix<double, kIn, kIn>> H(hessian);
    H.setZero();
    for (int i = 0; i < kOut; ++i) {
      for (int k = 0; k < kIn; ++k) H.col(k) += w[i] * y_jets[i].v[k].v;
    }
    return AllFinite(hessian, H.size());
  }

 private:
  template <typename T>
  bool Call(const T* x, [[maybe_unused]] const double* context, T* y) const {
    if constexpr (kContext > 0) {
      return functor_(x, context, y);
    } else {
      return functor_(x, y);
    }
  }

  Functor functor_;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_AUTODIFF_SIMULATOR_H_
