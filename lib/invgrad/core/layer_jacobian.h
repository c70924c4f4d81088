// The columns of J that belong to one layer of weights, never formed.
//
//   row (s, j) = delta_{s,j} (x) a_s,   entry (unit, i) = delta_unit a_i
//
// A layer's z is linear in the layer's weights. The derivative of output j of
// sample s with respect to these weights is therefore an outer product: a_s is
// the layer's input for the sample (with a last 1 for the bias), delta_{s,j}
// the derivative of y_{s,j} with respect to the sample's z. Products and both
// Gram matrices need only these factors [1]:
//
//   (J J^T)_{(s,j),(t,k)} = (a_s . a_t) (delta_{s,j} . delta_{t,k})
//   J^T J = sum_s (sum_j delta_{s,j} delta_{s,j}^T) (x) (a_s a_s^T)
//
// If the network is called T times a sample, each row sums over the calls t:
//
//   row (s, j) = sum_t delta_{s,j,t} (x) a_{s,t}
//
// Shapes:  inputs a: fan_in x B T, a sample's calls side by side;  deltas:
//          fan_out x m T, m = B r, sample by sample, a row's calls side by
//          side;  J: m x n, n = fan_in fan_out, unit after unit, as the weights
//          of dense_network.h.
// Cost:    J v, J^T w: T (2 n B + 2 m fan_out).  T = 1, Gram: m^2 fan_out;
//          ParameterGram: B n^2 / 2, where a dense J takes m n^2.  T > 1: both
//          by a dense J, which takes 2 m n T: the sums over pairs of calls,
//          m^2 fan_out T^2, cost more, except for very few calls.
// Fails:   never by itself. Sizes that do not fit are CHECKed.
//
// [1] Such a J is the transpose of a Khatri-Rao product. Kolda, Bader. Tensor
//     Decompositions and Applications. SIAM Review 51 (2009), section 2.6.
#ifndef INVGRAD_CORE_LAYER_JACOBIAN_H_
#define INVGRAD_CORE_LAYER_JACOBIAN_H_

#include <vector>

#include "Eigen/Core"
#include "invgrad/core/column_strips.h"
#include "invgrad/jacobian_operator.h"

namespace invgrad {

class LayerJacobian final : public JacobianOperator {
 public:
  // The factors are not copied and must outlive the layer.
  LayerJacobian(const Eigen::MatrixXd* inputs,
                const Eigen::MatrixXd* deltas,
                int num_calls = 1);

  int rows() const override {
    return static_cast<int>(deltas_->cols() / num_calls_);
  }
  int cols() const override {
    return static_cast<int>(inputs_->rows() * deltas_->rows());
  }
  const Eigen::MatrixXd& inputs() const { return *inputs_; }
  const Eigen::MatrixXd& deltas() const { return *deltas_; }
  int num_calls() const { return num_calls_; }  // T
  // r
  int outputs_per_sample() const {
    return static_cast<int>(deltas_->cols() / inputs_->cols());
  }

  void Times(const Eigen::VectorXd& v, Eigen::VectorXd* Jv) const override;
  void TransposeTimes(const Eigen::VectorXd& w,
                      Eigen::VectorXd* Jtw) const override;
  void Gram(Eigen::MatrixXd* JJt) const override;
  void ToDense(Eigen::MatrixXd* J) const override;
  void ParameterGram(Eigen::MatrixXd* JtJ) const override;

  // ToDense into the columns of a larger matrix.
  void WriteTo(Eigen::Ref<Eigen::MatrixXd> J) const;
  // J^T: n x m.
  Eigen::MatrixXd Transposed() const;

 private:
  // A row's deltas in one column: fan_out T x m.
  Eigen::Map<const Eigen::MatrixXd> DeltasOfRows() const;

  const Eigen::MatrixXd* inputs_;
  const Eigen::MatrixXd* deltas_;
  int num_calls_;
};

// The lower triangle of sum_l J_l J_l^T, the Gram matrix of layers side by side,
// in this rank's strips. At least one layer, all with the same rows, r and T
// (CHECKed).
void GramOfLayers(const std::vector<LayerJacobian>& layers,
                  const ColumnStrips& strips,
                  Eigen::MatrixXd* JJt);

}  // namespace invgrad

#endif  // INVGRAD_CORE_LAYER_JACOBIAN_H_
