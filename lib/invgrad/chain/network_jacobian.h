// The Jacobian of a batch of simulator outputs with respect to the network's
// weights, never formed.
//
//   J = dy/dtheta,   row (s, j) = J_s(j, :) df(a_s)/dtheta,   J_s = dy_s/dx_s
//
// Let a_{l,s} be the input of layer l for sample s, with a last 1 for the bias,
// and delta_{l,sj} the derivative of y_{s,j} with respect to the layer's z. Row
// (s, j) of J consists of the outer products a_{l,s} delta_{l,sj}^T of all
// layers, so (layer_jacobian.h)
//
//   (J J^T)_{(s,j),(t,k)} =
//       sum_l (a_{l,s} . a_{l,t}) (delta_{l,sj} . delta_{l,tk})
//
// In a loop over time (feedback.h), x holds the outputs of T calls of the
// network, J_s includes the closed loop, and a row of J sums the outer products
// over the sample's calls. With jets (derivative_set.h) their T channels take the
// place of the calls.
//
// Shapes:  J: m x n,  m = B |y|, sample by sample;  n: the weights.
// Cost:    J v, J^T w: a tangent or backward pass of the batch, and m |x|.
//          Gram: m^2 sum_l widths[l], instead of m^2 n for a dense J. The
//          delta_l are built on the first use of Gram, ToDense, Layer or
//          ColumnBlocks (2 m n / B more, once) and kept: 8 m sum_l widths[l]
//          bytes. With T > 1 calls everything costs T times as much, but Gram
//          m^2 n.
// Fails:   never by itself. Safe to use from several threads.
#ifndef INVGRAD_CHAIN_NETWORK_JACOBIAN_H_
#define INVGRAD_CHAIN_NETWORK_JACOBIAN_H_

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/layer_jacobian.h"
#include "invgrad/dense_network.h"
#include "invgrad/internal/layered_jacobian.h"
#include "invgrad/jacobian_operator.h"

namespace invgrad {

class NetworkJacobian final : public JacobianOperator, public LayeredJacobian {
 public:
  // `activations` of a forward pass with `weights`. simulator_jacobians: |x| x
  // m, column s |y| + j is row j of J_s: the row-major Jacobians of the samples
  // one after the other. If |x| is T times the number of network outputs, a
  // sample has T adjacent columns of the activations. Sizes that do not fit are
  // CHECKed.
  NetworkJacobian(DenseNetwork network,
                  Eigen::VectorXd weights,
                  DenseNetwork::Activations activations,
                  Eigen::MatrixXd simulator_jacobians);

  int rows() const override {
    return static_cast<int>(last_factor_.cols() / num_calls_);
  }
  int cols() const override { return network_.num_weights(); }
  void Times(const Eigen::VectorXd& v, Eigen::VectorXd* Jv) const override;
  void TransposeTimes(const Eigen::VectorXd& w,
                      Eigen::VectorXd* Jtw) const override;
  void Gram(Eigen::MatrixXd* JJt) const override;
  void ToDense(Eigen::MatrixXd* J) const override;
  std::string RowName(int row) const override;  // "row 12 (sample 3, output 0)"

  // The layers.
  std::vector<std::unique_ptr<const JacobianOperator>> ColumnBlocks()
      const override;

  // The columns of layer l = 0 .. L - 1; refers to this operator.
  LayerJacobian Layer(int l) const;

 private:
  // The simulator's Jacobians: |x| x m.
  Eigen::Map<const Eigen::MatrixXd> SimulatorJacobians() const;

  // delta_l: widths[l + 1] x m T, the calls of a row side by side. The first
  // call computes delta_l of all layers.
  const Eigen::MatrixXd& LayerFactor(int l) const;

  DenseNetwork network_;
  Eigen::VectorXd weights_;
  DenseNetwork::Activations activations_;
  Eigen::MatrixXd last_factor_;  // delta_{L-1}: the simulator's Jacobians
  int num_calls_;                // T
  int outputs_per_sample_;       // |y|

  mutable std::once_flag hidden_factors_built_;
  mutable std::vector<Eigen::MatrixXd> hidden_factors_;  // delta_0 .. L - 2
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_NETWORK_JACOBIAN_H_
