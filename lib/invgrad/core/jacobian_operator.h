// The Jacobian J = dy/dx as a linear operator, usually without storing J.
//
//   J v,   J^T w,   J J^T,   J^T J,   and J itself only on request
//
// Shapes:  J: m x n (m = rows, n = cols);  v: n;  w: m.
// Cost:    stated by each implementation; a dense J costs 2 m n for a product
//          and m^2 n for the Gram matrix.
// Fails:   never; entries that are not finite give results that are not finite.
//          Sizes are CHECKed.
#ifndef INVGRAD_CORE_JACOBIAN_OPERATOR_H_
#define INVGRAD_CORE_JACOBIAN_OPERATOR_H_

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "invgrad/core/column_strips.h"
#include "invgrad/core/sampled_factors.h"

namespace invgrad {

class JacobianOperator {
 public:
  virtual ~JacobianOperator() = default;

  virtual int rows() const = 0;
  virtual int cols() const = 0;

  // J v: m.
  virtual void Times(const Eigen::VectorXd& v, Eigen::VectorXd* Jv) const = 0;

  // J^T w: n.
  virtual void TransposeTimes(const Eigen::VectorXd& w,
                              Eigen::VectorXd* Jtw) const = 0;

  // The lower triangle of J J^T: m x m. Entries above the diagonal are
  // unspecified. By default from the dense J.
  virtual void Gram(Eigen::MatrixXd* JJt) const;

  // The ranks that share the rows of J, of which each knows its own; null: this
  // process knows all. All ranks must then call the same functions.
  virtual const Communicator* communicator() const { return nullptr; }
  // The same as Gram, in this rank's columns alone: m x strips.num_local().
  // Only with a communicator.
  virtual void GramStrips(const ColumnStrips& strips,
                          Eigen::MatrixXd* JJt) const;
  // ParameterGram likewise: n x strips.num_local().
  virtual void ParameterGramStrips(const ColumnStrips& strips,
                                   Eigen::MatrixXd* JtJ) const;

  // J: m x n. By default min(m, n) products with unit vectors.
  virtual void ToDense(Eigen::MatrixXd* J) const;

  // The lower triangle of J^T J: n x n. By default from the dense J.
  virtual void ParameterGram(Eigen::MatrixXd* JtJ) const;

  // The name of a row in messages: "row 12", and its sample or residual block
  // if known.
  virtual std::string RowName(int row) const;

  // The columns in groups, from the first to the last: the layers of a network,
  // the parameter blocks of a ceres::Problem. By default none. The blocks may
  // refer to this operator, which must outlive them.
  virtual std::vector<std::unique_ptr<const JacobianOperator>> ColumnBlocks()
      const;

  // The layers of a network that FactorsAlong knows; by default none.
  virtual std::vector<LayerColumns> FactorLayers() const;
  // Their factors for the covector w (m). Only with FactorLayers.
  virtual void FactorsAlong(const Eigen::VectorXd& /*w*/,
                            SampledFactors* /*factors*/) const {}
};

// J given by its two products.
class FunctionJacobian final : public JacobianOperator {
 public:
  // *out = J v, or J^T w; the functions set the size of *out.
  using Product =
      std::function<void(const Eigen::VectorXd& in, Eigen::VectorXd* out)>;

  FunctionJacobian(int rows, int cols, Product times, Product transpose_times);

  int rows() const override { return rows_; }
  int cols() const override { return cols_; }
  void Times(const Eigen::VectorXd& v, Eigen::VectorXd* Jv) const override;
  void TransposeTimes(const Eigen::VectorXd& w,
                      Eigen::VectorXd* Jtw) const override;

 private:
  int rows_;
  int cols_;
  Product times_;
  Product transpose_times_;
};

// J stored as a matrix: column-major, or in compressed rows, as for a
// ceres::Problem.
template <typename MatrixType>
class StoredJacobian final : public JacobianOperator {
 public:
  using Matrix = MatrixType;

  // Swaps J in, because Eigen's sparse matrices do not move. block_sizes: the
  // number of columns of each ColumnBlock; the blocks are copies and have all
  // rows of J. Empty, or their sum is n (CHECKed).
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

#endif  // INVGRAD_CORE_JACOBIAN_OPERATOR_H_
