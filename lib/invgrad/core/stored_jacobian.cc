#include "invgrad/stored_jacobian.h"

#include <numeric>
#include <utility>

#include "invgrad/internal/blas.h"
#include "invgrad/internal/logging.h"
#include "invgrad/jacobian_operator.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Sparse = SparseJacobian::Matrix;

// *y = op(J) x.
void Multiply(const MatrixXd& J, Op op, const VectorXd& x, VectorXd* y) {
  y->resize(op == Op::kNone ? J.rows() : J.cols());
  Gemv(op, 1.0, J, x, 0.0, *y);
}
void Multiply(const Sparse& J, Op op, const VectorXd& x, VectorXd* y) {
  if (op == Op::kNone) {
    *y = J * x;
  } else {
    *y = J.transpose() * x;
  }
}

// *G = op(J) op(J)^T, the lower triangle.
void MakeGram(const MatrixXd& J, Op op, MatrixXd* G) {
  const Eigen::Index size = op == Op::kNone ? J.rows() : J.cols();
  G->resize(size, size);
  Syrk(op, 1.0, J, 0.0, *G);
}
void MakeGram(const Sparse& J, Op op, MatrixXd* G) {
  const Sparse transpose = J.transpose();
  const Sparse product =
      op == Op::kNone ? Sparse(J * transpose) : Sparse(transpose * J);
  *G = product;
}

// J in a form whose columns are contiguous.
const MatrixXd& ByColumns(const MatrixXd& J) { return J; }
Eigen::SparseMatrix<double> ByColumns(const Sparse& J) { return J; }

}  // namespace

template <typename Matrix>
StoredJacobian<Matrix>::StoredJacobian(Matrix J, std::vector<int> block_sizes)
    : block_sizes_(std::move(block_sizes)) {
  J_.swap(J);
  if (block_sizes_.empty()) return;
  CHECK_EQ(std::accumulate(block_sizes_.begin(), block_sizes_.end(), 0), cols())
      << "Blocks of columns hold all columns.";
}

template <typename Matrix>
void StoredJacobian<Matrix>::Times(const VectorXd& v, VectorXd* Jv) const {
  CHECK_EQ(v.size(), cols()) << "J v with J " << rows() << " x " << cols();
  Multiply(J_, Op::kNone, v, Jv);
}

template <typename Matrix>
void StoredJacobian<Matrix>::TransposeTimes(const VectorXd& w,
                                            VectorXd* Jtw) const {
  CHECK_EQ(w.size(), rows()) << "J^T w with J " << rows() << " x " << cols();
  Multiply(J_, Op::kTranspose, w, Jtw);
}

template <typename Matrix>
void StoredJacobian<Matrix>::Gram(MatrixXd* JJt) const {
  MakeGram(J_, Op::kNone, JJt);
}

template <typename Matrix>
void StoredJacobian<Matrix>::ParameterGram(MatrixXd* JtJ) const {
  MakeGram(J_, Op::kTranspose, JtJ);
}

template <typename Matrix>
std::vector<std::unique_ptr<const JacobianOperator>>
StoredJacobian<Matrix>::ColumnBlocks() const {
  const auto& columns = ByColumns(J_);
  std::vector<std::unique_ptr<const JacobianOperator>> blocks;
  int column = 0;
  for (const int size : block_sizes_) {
    blocks.push_back(std::make_unique<StoredJacobian>(
        Matrix(columns.middleCols(column, size))));
    column += size;
  }
  return blocks;
}

template class StoredJacobian<MatrixXd>;
template class StoredJacobian<Sparse>;

}  // namespace invgrad
