// What holds for the derivatives of any network.
#ifndef TESTS_TORCH_NETWORK_IDENTITIES_H_
#define TESTS_TORCH_NETWORK_IDENTITIES_H_

#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/network.h"
#include "tests/support/random_matrix.h"

namespace invgrad {

struct NetworkProducts {
  Eigen::MatrixXd w;  // covectors of the outputs
  Eigen::VectorXd v;  // a tangent of the weights
  Eigen::VectorXd Jtw;
  Eigen::MatrixXd Jv;
};

inline NetworkProducts RandomProducts(const Network& network,
                                      const Eigen::VectorXd& weights,
                                      const Eigen::MatrixXd& inputs) {
  const auto pass = network.NewPass();
  std::string error;
  EXPECT_TRUE(network.Forward(
      weights, inputs, Network::Derivatives::kFirst, pass.get(), &error))
      << error;
  NetworkProducts products;
  products.w = RandomMatrix(network.num_outputs(), pass->num_columns(), 5);
  products.v = RandomMatrix(network.num_weights(), 1, 6);
  network.Backward(weights, *pass, products.w, &products.Jtw);
  network.Tangent(weights, *pass, products.v, &products.Jv);
  return products;
}

// w . (J v) = v . (J^T w), relative to |w| |J v|.
inline void ExpectNetworkAdjointIdentity(const Network& network,
                                         const Eigen::VectorXd& weights,
                                         const Eigen::MatrixXd& inputs,
                                         double tolerance) {
  const NetworkProducts p = RandomProducts(network, weights, inputs);
  EXPECT_NEAR(p.w.cwiseProduct(p.Jv).sum(),
              p.v.dot(p.Jtw),
              tolerance * p.w.norm() * p.Jv.norm());
}

// J v is a central difference, relative to |J v|.
inline void ExpectNetworkTangentIsDifference(const Network& network,
                                             const Eigen::VectorXd& weights,
                                             const Eigen::MatrixXd& inputs,
                                             double h,
                                             double tolerance) {
  const NetworkProducts p = RandomProducts(network, weights, inputs);
  const Eigen::MatrixXd difference =
      (network.Outputs(weights + h * p.v, inputs) -
       network.Outputs(weights - h * p.v, inputs)) /
      (2.0 * h);
  EXPECT_LT((p.Jv - difference).norm(), tolerance * p.Jv.norm());
}

}  // namespace invgrad

#endif  // TESTS_TORCH_NETWORK_IDENTITIES_H_
