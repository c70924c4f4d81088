#include "invgrad/output_layer/tall_svd.h"

#include <lapacke.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace invgrad {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;

bool TallSvd::Compute(MatrixXd J) {
  if (!J.allFinite()) return false;
  qr_ = std::move(J);
  const Index size = std::min(qr_.rows(), qr_.cols());
  const auto m = static_cast<lapack_int>(qr_.rows());
  const auto p = static_cast<lapack_int>(qr_.cols());
  const auto k = static_cast<lapack_int>(size);
  tau_.resize(size);
  LAPACKE_dgeqrf(LAPACK_COL_MAJOR, m, p, qr_.data(), m, tau_.data());
  MatrixXd R = qr_.topRows(size).triangularView<Eigen::Upper>();
  W_.resize(size, size);
  s_.resize(size);
  Vt_.resize(size, qr_.cols());
  return LAPACKE_dgesdd(LAPACK_COL_MAJOR,
                        'S',
                        k,
                        p,
                        R.data(),
                        k,
                        s_.data(),
                        W_.data(),
                        k,
                        Vt_.data(),
                        k) == 0;
}

MatrixXd TallSvd::U() const {
  MatrixXd U = MatrixXd::Zero(qr_.rows(), s_.size());
  U.topRows(s_.size()) = W_;
  ApplyQ('N', &U);
  return U;
}

MatrixXd TallSvd::Coefficients(MatrixXd d) const {
  ApplyQ('T', &d);
  return W_.transpose() * d.topRows(s_.size());
}

ArrayXd TallSvd::Shares(double root) const {
  const ArrayXd squares = s_.array().square();
  return (squares > 0.0)
      .select(squares / (squares + std::pow(root * s_[0], 2)), 0.0);
}

void TallSvd::ApplyQ(char op, MatrixXd* columns) const {
  const auto m = static_cast<lapack_int>(qr_.rows());
  LAPACKE_dormqr(LAPACK_COL_MAJOR,
                 'L',
                 op,
                 m,
                 static_cast<lapack_int>(columns->cols()),
                 static_cast<lapack_int>(tau_.size()),
                 qr_.data(),
                 m,
                 tau_.data(),
                 columns->data(),
                 m);
}

}  // namespace invgrad
