// A network without inputs whose outputs are its weights: the unknowns of a
// point problem, which has no network.
//
//   x = theta   for every sample,   J = I
//
// A Model with it looks for the simulator's input x: L(P(x), y*), or the sum
// over samples with contexts and targets of their own. It has exact Hessians as
// the simulator has them, and all of training; minimize.h minimizes it
// from a start.
//
// Shapes:  theta, x: n;  inputs: 0 x B.
#ifndef INVGRAD_CHAIN_WEIGHTS_NETWORK_H_
#define INVGRAD_CHAIN_WEIGHTS_NETWORK_H_

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/network.h"

namespace invgrad {

class WeightsNetwork final : public Network {
 public:
  explicit WeightsNetwork(int num_weights) : num_weights_(num_weights) {}

  int num_inputs() const override { return 0; }
  int num_outputs() const override { return num_weights_; }
  int num_weights() const override { return num_weights_; }
  std::string Name() const override;
  // Zeros.
  Eigen::VectorXd InitialWeights(Initialization initialization,
                                 NumpyRandom* random) const override;
  std::vector<int> WeightBlocks() const override { return {num_weights_}; }

  std::unique_ptr<Pass> NewPass() const override {
    return std::make_unique<Pass>();
  }
  bool Forward(const Eigen::VectorXd& weights,
               const Eigen::MatrixXd& inputs,
               Derivatives derivatives,
               Pass* pass,
               std::string* error) const override;
  void Backward(const Eigen::VectorXd& weights,
                const Pass& pass,
                const Eigen::MatrixXd& output_covectors,
                Eigen::VectorXd* gradient) const override;
  void Tangent(const Eigen::VectorXd& weights,
               const Pass& pass,
               const Eigen::VectorXd& weight_tangent,
               Eigen::MatrixXd* output_tangents) const override;

 private:
  int num_weights_;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_WEIGHTS_NETWORK_H_
