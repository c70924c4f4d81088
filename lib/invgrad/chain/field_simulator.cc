#include "invgrad/field_simulator.h"

#include <algorithm>

namespace invgrad {

using Eigen::MatrixXd;
using Eigen::VectorXd;

bool FieldSimulator::Evaluate(const double* x,
                              const double* context,
                              double* y,
                              double* jacobian) const {
  if (jacobian == nullptr) return Value(x, context, y);
  const auto J = Linearize(x, context, y);
  if (J == nullptr) return false;
  MatrixXd dense;
  J->ToDense(&dense);
  // A row-major J is a column-major J^T.
  Eigen::Map<MatrixXd>(jacobian, num_inputs(), num_outputs()) =
      dense.transpose();
  return dense.allFinite();
}

bool FieldSimulator::Adjoint(const double* x,
                             const double* context,
                             const Covector& covector,
                             double* y,
                             double* x_bar) const {
  const auto J = Linearize(x, context, y);
  VectorXd w(num_outputs());
  if (J == nullptr || !covector(y, w.data())) return false;
  VectorXd pulled;
  J->TransposeTimes(w, &pulled);
  std::copy_n(pulled.data(), num_inputs(), x_bar);
  return pulled.allFinite();
}

}  // namespace invgrad
