// A Ceres cost function that also computes second derivatives.
//
//   H = sum_i w_i d2r_i/dx2
//
// Shapes:  w: m, one weight for each residual; H: n x n, symmetric, with the
//          parameter blocks one after the other; n: the sum of their ambient
//          sizes.
// Fails:   as Evaluate.
//
// AutoDiffSecondOrderCostFunction (autodiff_second_order_cost_function.h)
// computes H by automatic differentiation.
#ifndef INVGRAD_SECOND_ORDER_COST_FUNCTION_H_
#define INVGRAD_SECOND_ORDER_COST_FUNCTION_H_

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "ceres/autodiff_cost_function.h"
#include "ceres/cost_function.h"
#include "ceres/types.h"
#include "invgrad/internal/nested_jet.h"

namespace invgrad {

class SecondOrderCostFunction : public ceres::CostFunction {
 public:
  // Computes H (n x n; symmetric, so row-major or column-major) at
  // `parameters` (one pointer a block) for the weights `w` (m).
  virtual bool WeightedHessian(const double* const* parameters,
                               const double* w,
                               double* hessian) const = 0;
};

// A second-order cost function by automatic differentiation.
//
// If it replaces ceres::AutoDiffCostFunction, ProblemLinearizer computes the
// exact Hessian for Newton's method:
//
//   problem.AddResidualBlock(
//       new AutoDiffSecondOrderCostFunction<Rosenbrock, 2, 2>(new Rosenbrock),
//       nullptr, x);
//
// Cost:    for H one call of the functor with nested Jets, about n^2 times the
//          work of a call with doubles.
// Fails:   false where the functor returns false.

// Functor and arguments are those of ceres::AutoDiffCostFunction; kNumResiduals
// may be ceres::DYNAMIC.
template <typename Functor, int kNumResiduals, int... Ns>
class AutoDiffSecondOrderCostFunction final : public SecondOrderCostFunction {
 public:
  explicit AutoDiffSecondOrderCostFunction(
      Functor* functor, ceres::Ownership ownership = ceres::TAKE_OWNERSHIP)
      : first_order_(functor, ownership) {
    CopySizes();
  }

  // For kNumResiduals = ceres::DYNAMIC.
  AutoDiffSecondOrderCostFunction(
      Functor* functor,
      int num_residuals,
      ceres::Ownership ownership = ceres::TAKE_OWNERSHIP)
      : first_order_(functor, num_residuals, ownership) {
    CopySizes();
  }

  bool Evaluate(const double* const* parameters,
                double* residuals,
                double** jacobians) const override {
    return first_order_.Evaluate(parameters, residuals, jacobians);
  }

  bool WeightedHessian(const double* const* parameters,
                       const double* w,
                       double* hessian) const override {
    using Jet = NestedJet<kNumParameters>;
    // On the heap: a Jet holds (1 + n)^2 numbers.
    std::vector<Jet> x;
    x.reserve(kNumParameters);
    std::vector<const Jet*> blocks;
    blocks.reserve(sizeof...(Ns));
    for (std::size_t b = 0; b < sizeof...(Ns); ++b) {
      blocks.push_back(x.data() + x.size());
      for (int i = 0; i < parameter_block_sizes()[b]; ++i) {
        x.push_back(MakeHessianJet<kNumParameters>(parameters[b][i],
                                                   static_cast<int>(x.size())));
      }
    }
    std::vector<Jet> r(num_residuals());
    if (!CallFunctor(
            blocks, r.data(), std::make_index_sequence<sizeof...(Ns)>())) {
      return false;
    }
    std::fill_n(hessian, kNumParameters * kNumParameters, 0.0);
    for (int i = 0; i < num_residuals(); ++i) {
      for (int j = 0; j < kNumParameters; ++j) {
        for (int k = 0; k < kNumParameters; ++k) {
          hessian[j * kNumParameters + k] += w[i] * r[i].v[j].v[k];
        }
      }
    }
    return true;
  }

 private:
  static constexpr int kNumParameters = (0 + ... + Ns);

  void CopySizes() {
    set_num_residuals(first_order_.num_residuals());
    *mutable_parameter_block_sizes() = first_order_.parameter_block_sizes();
  }

  template <typename T, std::size_t... kBlocks>
  bool CallFunctor(const std::vector<const T*>& blocks,
                   T* residuals,
                   std::index_sequence<kBlocks...>) const {
    return first_order_.functor()(blocks[kBlocks]..., residuals);
  }

  ceres::AutoDiffCostFunction<Functor, kNumResiduals, Ns...> first_order_;
};

}  // namespace invgrad

#endif  // INVGRAD_SECOND_ORDER_COST_FUNCTION_H_
