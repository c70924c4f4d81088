// The reference for the derivatives of networks and other functors, for tests.
#ifndef TESTS_DERIVATIVES_BY_FUNCTOR_H_
#define TESTS_DERIVATIVES_BY_FUNCTOR_H_

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/dense_network.h"
#include "invgrad/derivative_set.h"
#include "tests/chain/nested_dual.h"

namespace invgrad {

inline constexpr Activation kSmoothActivations[] = {Activation::kLinear,
                                                    Activation::kTanh,
                                                    Activation::kSigmoid,
                                                    Activation::kGelu};

// Sums of about a hundred terms of order one to ten.
inline constexpr double kRounding = 1e-12;

// The jets of num_functions functions at a point: num_functions x T. function:
//   void operator()(const Dual4* point, Dual4* values)
template <typename Function>
Eigen::MatrixXd JetsByDuals(const DerivativeSet& set,
                            const std::string& variables,
                            int num_functions,
                            const Eigen::VectorXd& point,
                            const Function& function) {
  const auto derivatives = [&](const std::string& word) {
    std::vector<Dual4> a(point.size());
    for (Eigen::Index i = 0; i < point.size(); ++i) {
      double directions[4] = {};
      for (std::size_t k = 0; k < word.size(); ++k) {
        directions[4 - word.size() + k] = word[k] == variables[i] ? 1.0 : 0.0;
      }
      a[i] = MakeDual4(point[i], directions);
    }
    std::vector<Dual4> values(num_functions);
    function(a.data(), values.data());
    Eigen::VectorXd result(num_functions);
    for (int f = 0; f < num_functions; ++f) {
      result[f] = DerivativeOf(values[f], static_cast<int>(word.size()));
    }
    return result;
  };
  Eigen::MatrixXd jets(num_functions, set.num_channels());
  for (int k = 0; k < set.num_channels(); ++k) {
    const std::string& word = set.word(k);
    jets.col(k).setZero();
    for (std::size_t begin = 0; begin <= word.size();) {
      const std::size_t end = std::min(word.find('+', begin), word.size());
      jets.col(k) += derivatives(word.substr(begin, end - begin));
      begin = end + 1;
    }
  }
  return jets;
}

// The jets of a network's outputs, whose inputs are the coordinates.
inline Eigen::MatrixXd JetsByFunctor(const DerivativeSet& set,
                                     const std::string& variables,
                                     const DenseNetwork& network,
                                     const Eigen::VectorXd& weights,
                                     const Eigen::VectorXd& point) {
  return JetsByDuals(
      set,
      variables,
      network.num_outputs(),
      point,
      [&](const Dual4* a, Dual4* values) {
        const std::vector<Dual4> w(weights.begin(), weights.end());
        EXPECT_TRUE(NetworkFunctor(network)(w.data(), a, values));
      });
}

}  // namespace invgrad

#endif  // TESTS_DERIVATIVES_BY_FUNCTOR_H_
