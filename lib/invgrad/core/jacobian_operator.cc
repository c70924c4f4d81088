#include "invgrad/core/jacobian_operator.h"

#include <numeric>
#include <utility>

#include "invgrad/core/blas.h"
#include "invgrad/internal/logging.h"

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

void JacobianOperator::Gram(MatrixXd* JJt) const {
  MatrixXd J;
  ToDense(&J);
  MakeGram(J, Op::kNone, JJt);
}

void JacobianOperator::ToDense(MatrixXd* J) const {
  J->resize(rows(), cols());
  VectorXd product;
  if (rows() < cols()) {
    for (int i = 0; i < rows(); ++i) {
      TransposeTimes(VectorXd::Unit(rows(), i), &product);
      J->row(i) = product.transpose();
    }
    return;
  }
  for (int j = 0; j < cols(); ++j) {
    Times(VectorXd::Unit(cols(), j), &product);
    J->col(j) = product;
  }
}

void JacobianOperator::GramStrips(const ColumnStrips& /*strips*/,
                                  MatrixXd* /*JJt*/) const {
  LOG(FATAL) << "This process knows all rows of J: use Gram.";
}

void JacobianOperator::ParameterGramStrips(const ColumnStrips& /*strips*/,
                                           MatrixXd* /*JtJ*/) const {
  LOG(FATAL) << "This process knows all rows of J: use ParameterGram.";
}

void JacobianOperator::ParameterGram(MatrixXd* JtJ) const {
  MatrixXd J;
  ToDense(&J);
  MakeGram(J, Op::kTranspose, JtJ);
}

std::string JacobianOperator::RowName(int row) const {
  return "row " + std::to_string(row);
}

std::vector<std::unique_ptr<const JacobianOperator>>
JacobianOperator::ColumnBlocks() const {
  return {};
}

std::vector<LayerColumns> JacobianOperator::FactorLayers() const { return {}; }

FunctionJacobian::FunctionJacobian(int rows,
                                   int cols,
                                   Product times,
                                   Product transpose_times)
    : rows_(rows),
      cols_(cols),
      times_(std::move(times)),
      transpose_times_(std::move(transpose_times)) {}

void FunctionJacobian::Times(const VectorXd& v, VectorXd* Jv) const {
  CHECK_EQ(v.size(), cols()) << "J v with J " << rows() << " x " << cols();
  times_(v, Jv);
  CHECK_EQ(Jv->size(), rows());
}

void FunctionJacobian::TransposeTimes(const VectorXd& w, VectorXd* Jtw) const {
  CHECK_EQ(w.size(), rows()) << "J^T w with J " << rows() << " x " << cols();
  transpose_times_(w, Jtw);
  CHECK_EQ(Jtw->size(), cols());
}

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
