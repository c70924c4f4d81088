// A dense network as a Ceres functor: weights and inputs of any scalar type.
//
//   x = f(a; theta)
//
// For a network inside an autodiff functor, and as reference for the tests of
// DenseNetwork. For derivatives with respect to more than a few hundred weights
// use Model or DenseNetwork, which are much faster.
//
// Shapes:  weights: n, laid out as in dense_network.h;  inputs: |a|;
//          outputs: |x|.
// Cost:    2 n operations on T.
#ifndef INVGRAD_NETWORK_FUNCTOR_H_
#define INVGRAD_NETWORK_FUNCTOR_H_

#include <utility>
#include <vector>

#include "invgrad/dense_network.h"
#include "invgrad/internal/activation.h"

namespace invgrad {

class NetworkFunctor {
 public:
  explicit NetworkFunctor(DenseNetwork network)
      : network_(std::move(network)) {}

  template <typename T>
  bool operator()(const T* weights, const T* inputs, T* outputs) const {
    const std::vector<int>& widths = network_.widths();
    std::vector<T> below(inputs, inputs + widths[0]);
    std::vector<T> above;
    for (int l = 0; l < network_.num_layers(); ++l) {
      const bool is_hidden = l + 1 < network_.num_layers();
      const T* weight = weights + network_.offset(l);
      above.clear();
      for (int unit = 0; unit < widths[l + 1]; ++unit) {
        T z(0.0);
        for (const T& a : below) z += *weight++ * a;
        z += *weight++;  // the bias
        above.push_back(is_hidden ? Activate(network_.hidden_activation(), z)
                                  : z);
      }
      below.swap(above);
    }
    for (const T& x : below) *outputs++ = x;
    return true;
  }

 private:
  DenseNetwork network_;
};

}  // namespace invgrad

#endif  // INVGRAD_NETWORK_FUNCTOR_H_
