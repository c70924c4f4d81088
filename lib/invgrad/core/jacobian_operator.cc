#include "invgrad/core/jacobian_operator.h"

#include <numeric>
#include <utility>

#include "glog/logging.h"
#include "invgrad/core/blas.h"

namespace invgrad {
namespace {

void CheckProductSizes(const JacobianOperator& J,
                       Eigen::Index operand_size,
                       bool transposed) {
  CHECK_EQ(operand_size, transposed ? J.rows() : J.cols())
      << (transposed ? "J^T w" : "J v") << " with J " << J.rows() << " x "
      << J.cols();
}

// *G = the lower triangle of op(A) op(A)^T.
void DenseGram(const Eigen::MatrixXd& A, Op op, Eigen::MatrixXd* G) {
  const Eigen::Index size = op == Op::kNone ? A.rows() : A.cols();
  G->resize(size, size);
  Syrk(op, 1.0, A, 0.0, *G);
}

void CheckBlockSizes(const JacobianOperator& J,
                     const std::vector<int>& block_sizes) {
  if (block_sizes.empty()) return;
  CHECK_EQ(std::accumulate(block_sizes.begin(), block_sizes.end(), 0), J.cols())
      << "Blocks of columns hold all columns.";
}

}  // namespace

void JacobianOperator::ParameterGram(Eigen::MatrixXd* JtJ) const {
  Eigen::MatrixXd J;
  ToDense(&J);
  DenseGram(J, Op::kTranspose, JtJ);
}

std::string JacobianOperator::RowName(int row) const {
  return "row " + std::to_string(row);
}

std::vector<std::unique_ptr<const JacobianOperator>>
JacobianOperator::ColumnBlocks() const {
  return {};
}

DenseJacobian::DenseJacobian(Eigen::MatrixXd J, std::vector<int> block_sizes)
    : J_(std::move(J)), block_sizes_(std::move(block_sizes)) {
  CheckBlockSizes(*this, block_sizes_);
}

void DenseJacobian::Times(const Eigen::VectorXd& v, Eigen::VectorXd* Jv) const {
  CheckProductSizes(*this, v.size(), false);
  Jv->resize(rows());
  Gemv(Op::kNone, 1.0, J_, v, 0.0, *Jv);
}

void DenseJacobian::TransposeTimes(const Eigen::VectorXd& w,
                                   Eigen::VectorXd* Jtw) const {
  CheckProductSizes(*this, w.size(), true);
  Jtw->resize(cols());
  Gemv(Op::kTranspose, 1.0, J_, w, 0.0, *Jtw);
}

void DenseJacobian::Gram(Eigen::MatrixXd* JJt) const {
  DenseGram(J_, Op::kNone, JJt);
}

void DenseJacobian::ParameterGram(Eigen::MatrixXd* JtJ) const {
  DenseGram(J_, Op::kTranspose, JtJ);
}

std::vector<std::unique_ptr<const JacobianOperator>>
DenseJacobian::ColumnBlocks() const {
  std::vector<std::unique_ptr<const JacobianOperator>> blocks;
  int column = 0;
  for (const int size : block_sizes_) {
    blocks.push_back(
        std::make_unique<DenseJacobian>(J_.middleCols(column, size)));
    column += size;
  }
  return blocks;
}

SparseJacobian::SparseJacobian(Matrix J, std::vector<int> block_sizes)
    : block_sizes_(std::move(block_sizes)) {
  J_.swap(J);
  CheckBlockSizes(*this, block_sizes_);
}

void SparseJacobian::Times(const Eigen::VectorXd& v,
                           Eigen::VectorXd* Jv) const {
  CheckProductSizes(*this, v.size(), false);
  *Jv = J_ * v;
}

void SparseJacobian::TransposeTimes(const Eigen::VectorXd& w,
                                    Eigen::VectorXd* Jtw) const {
  CheckProductSizes(*this, w.size(), true);
  *Jtw = J_.transpose() * w;
}

void SparseJacobian::Gram(Eigen::MatrixXd* JJt) const {
  const Matrix transpose = J_.transpose();
  const Matrix product = J_ * transpose;
  *JJt = product;
}

void SparseJacobian::ParameterGram(Eigen::MatrixXd* JtJ) const {
  const Matrix transpose = J_.transpose();
  const Matrix product = transpose * J_;
  *JtJ = product;
}

std::vector<std::unique_ptr<const JacobianOperator>>
SparseJacobian::ColumnBlocks() const {
  // In compressed columns a block is a range of entries.
  const Eigen::SparseMatrix<double> by_columns = J_;
  std::vector<std::unique_ptr<const JacobianOperator>> blocks;
  int column = 0;
  for (const int size : block_sizes_) {
    blocks.push_back(std::make_unique<SparseJacobian>(
        Matrix(by_columns.middleCols(column, size))));
    column += size;
  }
  return blocks;
}

}  // namespace invgrad
