#include "invgrad/linalg/jacobian_operator.h"

#include <cblas.h>

#include <algorithm>
#include <numeric>
#include <utility>

#include "glog/logging.h"

namespace invgrad {
namespace {

void CheckProductSizes(const JacobianOperator& J,
                       Eigen::Index operand_size,
                       bool transposed) {
  CHECK_EQ(operand_size, transposed ? J.rows() : J.cols())
      << (transposed ? "J^T w" : "J v") << " with J " << J.rows() << " x "
      << J.cols();
}

// *y = A x, or A^T x.
void DenseTimes(const Eigen::MatrixXd& A,
                CBLAS_TRANSPOSE transpose,
                const Eigen::VectorXd& x,
                Eigen::VectorXd* y) {
  CHECK_NE(&x, y) << "A product cannot be computed in place.";
  y->setZero(transpose == CblasNoTrans ? A.rows() : A.cols());
  // BLAS leaves y untouched where A has no rows or columns.
  if (A.size() == 0) return;
  cblas_dgemv(CblasColMajor,
              transpose,
              A.rows(),
              A.cols(),
              1.0,
              A.data(),
              A.rows(),
              x.data(),
              1,
              0.0,
              y->data(),
              1);
}

// *G = A A^T, or A^T A with CblasTrans; both triangles.
void DenseGram(const Eigen::MatrixXd& A,
               CBLAS_TRANSPOSE transpose,
               Eigen::MatrixXd* G) {
  const bool rows = transpose == CblasNoTrans;
  const Eigen::Index size = rows ? A.rows() : A.cols();
  G->setZero(size, size);
  if (A.size() == 0) return;
  cblas_dsyrk(CblasColMajor,
              CblasLower,
              transpose,
              size,
              rows ? A.cols() : A.rows(),
              1.0,
              A.data(),
              A.rows(),
              0.0,
              G->data(),
              size);
  // By blocks, so that neither triangle is walked across the cache for long.
  constexpr Eigen::Index kBlock = 32;
  for (Eigen::Index j = 0; j < size; j += kBlock) {
    const Eigen::Index width = std::min(kBlock, size - j);
    G->block(j, j, width, width).triangularView<Eigen::StrictlyUpper>() =
        G->block(j, j, width, width).transpose();
    for (Eigen::Index i = j + kBlock; i < size; i += kBlock) {
      const Eigen::Index height = std::min(kBlock, size - i);
      G->block(j, i, width, height) = G->block(i, j, height, width).transpose();
    }
  }
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
  DenseGram(J, CblasTrans, JtJ);
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
  DenseTimes(J_, CblasNoTrans, v, Jv);
}

void DenseJacobian::TransposeTimes(const Eigen::VectorXd& w,
                                   Eigen::VectorXd* Jtw) const {
  CheckProductSizes(*this, w.size(), true);
  DenseTimes(J_, CblasTrans, w, Jtw);
}

void DenseJacobian::Gram(Eigen::MatrixXd* JJt) const {
  DenseGram(J_, CblasNoTrans, JJt);
}

void DenseJacobian::ParameterGram(Eigen::MatrixXd* JtJ) const {
  DenseGram(J_, CblasTrans, JtJ);
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
