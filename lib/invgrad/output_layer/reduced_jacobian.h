// The Jacobian of some of the weights, without the directions of outputs that
// the others span.
//
//   J* = (I - Q Q^T) J_u,   J = [J_u J_C] in some order of columns
//
// Shapes:  J: m x n;  u: the numbers of n_u weights;  Q: m x r, orthonormal
//          columns; r = 0: no projection.
// Cost:    that of J's products, and 4 m r for each vector. Without a
//          projection and with one block of J's columns for each layer, the Gram
//          matrix is the sum of those of the blocks.
// Fails:   never by itself. Sizes that do not fit are CHECKed.
#ifndef INVGRAD_OUTPUT_LAYER_REDUCED_JACOBIAN_H_
#define INVGRAD_OUTPUT_LAYER_REDUCED_JACOBIAN_H_

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/internal/layered_jacobian.h"
#include "invgrad/jacobian_operator.h"

namespace invgrad {

class ReducedJacobian final : public JacobianOperator, public LayeredJacobian {
 public:
  // `others`: ascending; the last of J's ColumnBlocks, if there are any, has the
  // columns that are left out.
  ReducedJacobian(std::shared_ptr<const JacobianOperator> J,
                  std::vector<int> others,
                  Eigen::MatrixXd Q);

  int rows() const override { return J_->rows(); }
  int cols() const override { return static_cast<int>(others_.size()); }
  void Times(const Eigen::VectorXd& v, Eigen::VectorXd* Jv) const override;
  void TransposeTimes(const Eigen::VectorXd& w,
                      Eigen::VectorXd* Jtw) const override;
  void Gram(Eigen::MatrixXd* JJt) const override;
  void ToDense(Eigen::MatrixXd* J) const override;
  std::string RowName(int row) const override { return J_->RowName(row); }
  // The layers, without the projection: it is of all layers together, and rules
  // of single layers ignore that already.
  std::vector<std::unique_ptr<const JacobianOperator>> ColumnBlocks()
      const override;
  std::vector<LayerColumns> FactorLayers() const override;
  void FactorsAlong(const Eigen::VectorXd& w,
                    SampledFactors* factors) const override;

 private:
  bool projects() const { return Q_.cols() > 0; }
  // The numbers of J's FactorLayers whose weights are all in u.
  std::vector<int> LayersOfOthers() const;

  const std::shared_ptr<const JacobianOperator> J_;
  const std::vector<int> others_;
  const Eigen::MatrixXd Q_;
  std::vector<int> number_of_;  // of each column of J in u; -1: in C
};

}  // namespace invgrad

#endif  // INVGRAD_OUTPUT_LAYER_REDUCED_JACOBIAN_H_
