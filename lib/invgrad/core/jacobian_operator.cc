#include "invgrad/jacobian_operator.h"

#include <utility>

#include "invgrad/internal/blas.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::MatrixXd;
using Eigen::VectorXd;

void JacobianOperator::Gram(MatrixXd* JJt) const {
  MatrixXd J;
  ToDense(&J);
  JJt->resize(rows(), rows());
  Syrk(Op::kNone, 1.0, J, 0.0, *JJt);
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

void JacobianOperator::ParameterGram(MatrixXd* JtJ) const {
  MatrixXd J;
  ToDense(&J);
  JtJ->resize(cols(), cols());
  Syrk(Op::kTranspose, 1.0, J, 0.0, *JtJ);
}

std::string JacobianOperator::RowName(int row) const {
  return "row " + std::to_string(row);
}

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

}  // namespace invgrad
