#include "invgrad/linalg/jacobian_operator.h"

#include "glog/logging.h"
#include "invgrad/linalg/blas.h"

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

}  // namespace

void JacobianOperator::ParameterGram(Eigen::MatrixXd* JtJ) const {
  Eigen::MatrixXd J;
  ToDense(&J);
  DenseGram(J, Op::kTranspose, JtJ);
}

std::string JacobianOperator::RowName(int row) const {
  return "row " + std::to_string(row);
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

}  // namespace invgrad
