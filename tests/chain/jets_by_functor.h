// The reference for networks with 2-jets, for tests.
#ifndef TESTS_JETS_BY_FUNCTOR_H_
#define TESTS_JETS_BY_FUNCTOR_H_

#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/chain/dense_network.h"
#include "invgrad/chain/network_functor.h"
#include "invgrad/core/nested_jet.h"

namespace invgrad {

inline constexpr Activation kSmoothActivations[] = {Activation::kLinear,
                                                    Activation::kTanh,
                                                    Activation::kSigmoid,
                                                    Activation::kGelu};

// Sums of about a hundred terms of order one to ten.
inline constexpr double kRounding = 1e-12;

// The 2-jet of the outputs in the two inputs, by Jets of Jets through the
// functor: num_outputs x 4.
inline Eigen::MatrixXd JetsByFunctor(const DenseNetwork& network,
                                     const Eigen::VectorXd& weights,
                                     const Eigen::VectorXd& point) {
  using Jet = NestedJet<2>;
  const std::vector<Jet> weight_jets(weights.begin(), weights.end());
  const Jet inputs[] = {MakeHessianJet<2>(point[0], 0),
                        MakeHessianJet<2>(point[1], 1)};
  std::vector<Jet> outputs(network.num_outputs());
  EXPECT_TRUE(
      NetworkFunctor(network)(weight_jets.data(), inputs, outputs.data()));
  Eigen::MatrixXd jets(network.num_outputs(), 4);
  for (int k = 0; k < network.num_outputs(); ++k) {
    jets.row(k) << outputs[k].a.a, outputs[k].v[0].a, outputs[k].v[1].a,
        outputs[k].v[0].v[0] + outputs[k].v[1].v[1];
  }
  return jets;
}

}  // namespace invgrad

#endif  // TESTS_JETS_BY_FUNCTOR_H_
