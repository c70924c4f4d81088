// A Jacobian that is stored as a matrix: dense and column-major, or in
// compressed rows, as for a ceres::Problem. Use it to give a matrix to
// SpectralStep (spectral.h) or to a rule; for a J that is not formed use
// jacobian_operator.h.
//
// Shapes:  J: m x n.
// Cost:    dense: 2 m n for a product, m^2 n for Gram. Sparse: as Eigen's.
#ifndef INVGRAD_STORED_JACOBIAN_H_
#define INVGRAD_STORED_JACOBIAN_H_

#include <memory>
#include <vector>

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "invgrad/internal/layered_jacobian.h"
#include "invgrad/jacobian_operator.h"

namespace invgrad {

template <typename MatrixType>
class StoredJacobian final : public JacobianOperator, public LayeredJacobian {
 public:
  using Matrix = MatrixType;

  // Swaps J in, because Eigen's sparse matrices do not move. block_sizes: the
  // number of columns of each of ColumnBlocks; the blocks are copies and have
  // all rows of J. Empty, or their sum is n (CHECKed).
  explicit StoredJacobian(Matrix J, std::vector<int> block_sizes = {});

  int rows() const override { return static_cast<int>(J_.rows()); }
  int cols() const override { return static_cast<int>(J_.cols()); }
  void Times(const Eigen::VectorXd& v, Eigen::VectorXd* Jv) const override;
  void TransposeTimes(const Eigen::VectorXd& w,
                      Eigen::VectorXd* Jtw) const override;
  void Gram(Eigen::MatrixXd* JJt) const override;
  void ToDense(Eigen::MatrixXd* J) const override { *J = J_; }
  void ParameterGram(Eigen::MatrixXd* JtJ) const override;
  std::vector<std::unique_ptr<const JacobianOperator>> ColumnBlocks()
      const override;

  const std::vector<int>& block_sizes() const { return block_sizes_; }
  const Matrix& matrix() const { return J_; }
  Matrix* mutable_matrix() { return &J_; }

 private:
  Matrix J_;
  std::vector<int> block_sizes_;
};

using DenseJacobian = StoredJacobian<Eigen::MatrixXd>;
using SparseJacobian =
    StoredJacobian<Eigen::SparseMatrix<double, Eigen::RowMajor>>;
extern template class StoredJacobian<Eigen::MatrixXd>;
extern template class StoredJacobian<
    Eigen::SparseMatrix<double, Eigen::RowMajor>>;

}  // namespace invgrad

#endif  // INVGRAD_STORED_JACOBIAN_H_
