#include "invgrad/rank/decompositions.h"

#include <lapacke.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "invgrad/core/dense_svd.h"
#include "invgrad/core/lapack_sizes.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

}  // namespace

RightSvd ComputeRightSvd(MatrixXd A) {
  const Index m = A.rows();
  const Index n = A.cols();
  if (m < n) {
    A.conservativeResize(n, n);
    A.bottomRows(n - m).setZero();
  }
  DenseSvd svd;
  *svd.mutable_matrix() = std::move(A);
  if (svd.Compute()) return {svd.s(), svd.Vt().transpose()};
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  return {VectorXd::Constant(n, kNan), MatrixXd::Constant(n, n, kNan)};
}

bool Extend(const VectorXd& v, MatrixXd* Q) {
  VectorXd new_part = v;
  for (int pass = 0; pass < 2; ++pass) {
    new_part -= *Q * (Q->transpose() * new_part);
  }
  constexpr double kNew = 1e-4;
  if (!(new_part.norm() > kNew)) return false;
  Q->conservativeResize(Eigen::NoChange, Q->cols() + 1);
  Q->rightCols<1>() = new_part.normalized();
  return true;
}

std::vector<int> PivotOrder(MatrixXd A) {
  std::vector<lapack_int> order(static_cast<std::size_t>(A.cols()), 0);
  VectorXd tau(std::min(A.rows(), A.cols()));
  CHECK_EQ(LAPACKE_dgeqp3(LAPACK_COL_MAJOR,
                          LapackSize(A.rows()),
                          LapackSize(A.cols()),
                          A.data(),
                          LeadingDimension(A),
                          order.data(),
                          tau.data()),
           0);
  for (lapack_int& column : order) --column;  // LAPACK counts from 1
  return {order.begin(), order.end()};
}

}  // namespace invgrad
