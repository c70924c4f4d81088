// The Jacobian of a batch of simulator outputs with respect to the weights of
// any network, as the product of two operators.
//
//   J = dy/dtheta = P' N,   P' = diag(dy_s/dx_s),   N = dx/dtheta
//
// Shapes:  J: m x n,  m = B |y|, sample by sample;  n: the weights. Without
//          simulators y = x, P' = I.
// Cost:    J v: Network::Tangent and P' of each sample; J^T w: the transpose of
//          each P' and Network::Backward. Gram, ToDense: min(m, n) products.
// Fails:   never by itself.
#ifndef INVGRAD_CHAIN_CHAIN_JACOBIAN_H_
#define INVGRAD_CHAIN_CHAIN_JACOBIAN_H_

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/internal/layered_jacobian.h"
#include "invgrad/internal/network_layers.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/simulator.h"

namespace invgrad {

class ChainJacobian final : public JacobianOperator, public LayeredJacobian {
 public:
  // `pass` of a forward pass with `weights`; simulators: dy_s/dx_s of each
  // sample, which may refer to `simulator`, or none for y = x. The columns of
  // the pass are the samples (CHECKed).
  ChainJacobian(
      std::shared_ptr<const Network> network,
      Eigen::VectorXd weights,
      std::unique_ptr<const Network::Pass> pass,
      std::shared_ptr<const Simulator> simulator,
      std::vector<std::unique_ptr<const JacobianOperator>> simulators);

  int rows() const override { return outputs_per_sample_ * num_samples_; }
  int cols() const override { return network_->num_weights(); }
  void Times(const Eigen::VectorXd& v, Eigen::VectorXd* Jv) const override;
  void TransposeTimes(const Eigen::VectorXd& w,
                      Eigen::VectorXd* Jtw) const override;
  std::string RowName(int row) const override;  // "row 12 (sample 3, output 0)"
  std::vector<LayerColumns> FactorLayers() const override {
    return FactorLayersOf(*network_);
  }
  void FactorsAlong(const Eigen::VectorXd& w,
                    SampledFactors* factors) const override;

 private:
  // P'^T w: the covectors of the network's outputs.
  Eigen::MatrixXd OutputCovectors(const Eigen::VectorXd& w) const;

  std::shared_ptr<const Network> network_;
  Eigen::VectorXd weights_;
  std::unique_ptr<const Network::Pass> pass_;
  std::shared_ptr<const Simulator> simulator_;
  std::vector<std::unique_ptr<const JacobianOperator>> simulators_;
  int num_samples_;
  int outputs_per_sample_;  // |y|
};

// "row 12 (sample 3, output 0)"
std::string SampleRowName(int row, int outputs_per_sample);

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_CHAIN_JACOBIAN_H_
