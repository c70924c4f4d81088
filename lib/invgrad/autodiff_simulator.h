// Makes a Simulator from a functor that is written on a scalar type. Jets
// differentiate it with respect to all inputs at once. Use it for up to a few
// dozen inputs. For a new control in each of many time steps use
// time_stepping_simulator.h, for fields use field_simulator.h.
//
//   y = P(x; c),   J = dP/dx,   dP/dc,   H = sum_i w_i d2P_i/dx2
//
// Shapes:  x: kIn;  y: kOut;  c: kContext.
//   template <typename T> bool operator()(const T* x, T* y) const;
// or, with kContext > 0,
//   template <typename T>
//   bool operator()(const T* x, const double* context, T* y) const;
// Four samples of a batch are computed at once, by a T of four doubles
// (internal/lanes.h), unless the functor declines or the context is double*.
// For a context of four samples, and for dP/dc, write
//   template <typename T, typename C>
//   bool operator()(const T* x, const C* context, T* y) const;
// Where a branch on values differs between the four samples, they are repeated
// one at a time.
// Cost:    J and dP/dc: one evaluation each with Jets of kIn or kContext partial
//          derivatives; H: one with kIn^2.
// Fails:   returns false if the functor does or a value is not finite.
#ifndef INVGRAD_AUTODIFF_SIMULATOR_H_
#define INVGRAD_AUTODIFF_SIMULATOR_H_

#include <cstddef>
#include <string>
#include <type_traits>
#include <utility>

#include "Eigen/Core"
#include "ceres/jet.h"
#include "invgrad/internal/lanes.h"
#include "invgrad/internal/nested_jet.h"
#include "invgrad/internal/scratch.h"
#include "invgrad/simulator.h"

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
    return Call(x_jets.data(), context, y_jets.data()) &&
           Store(y_jets.data(), y, jacobian);
  }

  bool has_context_jacobian() const override { return kHasContextJacobian; }
  bool ContextJacobian(const double* x,
                       const double* context,
                       double* jacobian) const override {
    if constexpr (kHasContextJacobian) {
      using Jet = ceres::Jet<double, kContext>;
      Scratch<Jet> jets(kIn + kContext + kOut);
      Jet* const c_jets = jets.data() + kIn;
      Jet* const y_jets = c_jets + kContext;
      for (int i = 0; i < kIn; ++i) jets[i] = Jet(x[i]);
      for (int i = 0; i < kContext; ++i) c_jets[i] = Jet(context[i], i);
      Scratch<double> y(kOut);
      return Call(jets.data(), c_jets, y_jets) &&
             Store(y_jets, y.data(), jacobian);
    } else {
      return Simulator::ContextJacobian(x, context, jacobian);
    }
  }

  int EvaluateBatch(int count,
                    const double* x,
                    const double* contexts,
                    double* y,
                    double* jacobians) const override {
    const auto jacobian = [jacobians](int s) {
      return jacobians == nullptr ? nullptr : jacobians + s * kJacobianSize;
    };
    return ForSamplesInLanes(
        count,
        kHasLanes,
        [&](int s) {
          return EvaluateLanes(
              x + s * kIn, contexts + s * kContext, y + s * kOut, jacobian(s));
        },
        [&](int s) {
          return Evaluate(
              x + s * kIn, contexts + s * kContext, y + s * kOut, jacobian(s));
        });
  }
  int AdjointBatch(int count,
                   const double* x,
                   const double* contexts,
                   const BatchCovector& covector,
                   double* x_bar) const override {
    Scratch<double> memory(Pack::kLanes * (kOut + kJacobianSize) + kOut);
    double* const y = memory.data();
    double* const jacobians = y + Pack::kLanes * kOut;
    double* const w = jacobians + Pack::kLanes * kJacobianSize;
    const auto pull_back = [&](int s, int lane) {
      return covector(s + lane, y + lane * kOut, w) &&
             PullBack(
                 jacobians + lane * kJacobianSize, w, x_bar + (s + lane) * kIn);
    };
    return ForSamplesInLanes(
        count,
        kHasLanes,
        [&](int s) {
          if (!EvaluateLanes(
                  x + s * kIn, contexts + s * kContext, y, jacobians)) {
            return false;
          }
          for (int lane = 0; lane < Pack::kLanes; ++lane) {
            if (!pull_back(s, lane)) return false;
          }
          return true;
        },
        [&](int s) {
          return Evaluate(x + s * kIn, contexts + s * kContext, y, jacobians) &&
                 pull_back(s, 0);
        });
  }
  std::string WhyNoLanes() const override {
    return kHasLanes                     ? ""
           : !WantsLanes<Functor>::value ? kLanesDeclined
                                         : "the functor's context is double*";
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
  static constexpr std::ptrdiff_t kJacobianSize = std::ptrdiff_t{kOut} * kIn;

  static constexpr bool HasLanes() {
    if constexpr (!WantsLanes<Functor>::value) {
      return false;
    } else if constexpr (kContext > 0) {
      return std::
          is_invocable_v<const Functor&, const Pack*, const Pack*, Pack*>;
    } else {
      return true;
    }
  }
  static constexpr bool kHasLanes = HasLanes();

  static constexpr bool HasContextJacobian() {
    if constexpr (kContext > 0) {
      using Jet = ceres::Jet<double, kContext>;
      return std::is_invocable_v<const Functor&, const Jet*, const Jet*, Jet*>;
    } else {
      return false;
    }
  }
  static constexpr bool kHasContextJacobian = HasContextJacobian();

  // Copies values and derivatives; returns whether they are finite.
  template <int kDerivatives>
  static bool Store(const ceres::Jet<double, kDerivatives>* y_jets,
                    double* y,
                    double* jacobian) {
    // A row-major J is a column-major J^T.
    Eigen::Map<Eigen::Matrix<double, kDerivatives, kOut>> J_transposed(
        jacobian);
    for (int i = 0; i < kOut; ++i) {
      y[i] = y_jets[i].a;
      J_transposed.col(i) = y_jets[i].v;
    }
    return AllFinite(y, kOut) && AllFinite(jacobian, J_transposed.size());
  }

  // Evaluate for four samples; y and J as in EvaluateBatch.
  bool EvaluateLanes([[maybe_unused]] const double* x,
                     [[maybe_unused]] const double* contexts,
                     [[maybe_unused]] double* y,
                     [[maybe_unused]] double* jacobians) const {
    if constexpr (kHasLanes) {
      Scratch<Pack> memory(kIn + kContext + kOut);
      Pack* const x_packs = memory.data();
      Pack* const context = x_packs + kIn;
      Pack* const y_packs = context + kContext;
      LoadLanes(x, kIn, x_packs);
      LoadLanes(contexts, kContext, context);
      if (jacobians == nullptr) {
        if (!CallInlinedFor<Pack>(
                [&] { return Call(x_packs, context, y_packs); })) {
          return false;
        }
        StoreLanes(y_packs, kOut, y);
        return AreLanesFinite(y_packs, kOut);
      }
      using Jet = ceres::Jet<Pack, kIn>;
      Scratch<Jet> jets(kIn + kOut);
      Jet* const x_jets = jets.data();
      Jet* const y_jets = x_jets + kIn;
      for (int i = 0; i < kIn; ++i) x_jets[i] = Jet(x_packs[i], i);
      if (!CallInlinedFor<Pack>(
              [&] { return Call(x_jets, context, y_jets); })) {
        return false;
      }
      bool is_finite = true;
      for (int i = 0; i < kOut; ++i) {
        y_packs[i] = y_jets[i].a;
        for (int lane = 0; lane < Pack::kLanes; ++lane) {
          double* const row = jacobians + lane * kJacobianSize + i * kIn;
          for (int k = 0; k < kIn; ++k) row[k] = y_jets[i].v[k][lane];
        }
        is_finite &= AreLanesFinite(y_jets[i].v.data(), kIn);
      }
      StoreLanes(y_packs, kOut, y);
      return is_finite && AreLanesFinite(y_packs, kOut);
    } else {
      return false;
    }
  }

  template <typename T, typename C>
  bool Call(const T* x, [[maybe_unused]] const C* context, T* y) const {
    if constexpr (kContext > 0) {
      return functor_(x, context, y);
    } else {
      return functor_(x, y);
    }
  }

  Functor functor_;
};

}  // namespace invgrad

#endif  // INVGRAD_AUTODIFF_SIMULATOR_H_
