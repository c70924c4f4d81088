#include "invgrad/linear_simulator.h"

#include <mutex>
#include <utility>

#include "invgrad/core/small_svd.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/scratch.h"

namespace invgrad {

using Eigen::MatrixXd;
using Eigen::VectorXd;

struct LinearSimulator::Decomposition {
  std::once_flag once;
  SmallSvd svd;
};

LinearSimulator::LinearSimulator(const Matrix& A, VectorXd b)
    : A_(A),
      b_(std::move(b)),
      decomposition_(std::make_shared<Decomposition>()) {
  CHECK_EQ(A_.rows(), b_.size());
  CHECK_GT(A_.rows(), 0);
  CHECK_GT(A_.cols(), 0);
  A_.makeCompressed();
}

bool LinearSimulator::Evaluate(const double* x,
                               const double* /*context*/,
                               double* y,
                               double* jacobian) const {
  Eigen::Map<VectorXd> y_map(y, num_outputs());
  y_map = b_;
  y_map.noalias() += A_ * Eigen::Map<const VectorXd>(x, num_inputs());
  if (jacobian != nullptr) {
    Eigen::Map<
        Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
        jacobian, num_outputs(), num_inputs()) = A_;
  }
  return AllFinite(y, num_outputs());
}

bool LinearSimulator::Adjoint(const double* x,
                              const double* context,
                              const Covector& covector,
                              double* y,
                              double* x_bar) const {
  if (!Evaluate(x, context, y, nullptr)) return false;
  Scratch<double> w(num_outputs());
  if (!covector(y, w.data())) return false;
  Eigen::Map<VectorXd>(x_bar, num_inputs()).noalias() =
      A_.transpose() * Eigen::Map<const VectorXd>(w.data(), num_outputs());
  return AllFinite(x_bar, num_inputs());
}

bool LinearSimulator::WeightedHessian(const double* /*x*/,
                                      const double* /*context*/,
                                      const double* /*w*/,
                                      double* hessian) const {
  Eigen::Map<MatrixXd>(hessian, num_inputs(), num_inputs()).setZero();
  return true;
}

void LinearSimulator::InversePower(double kappa,
                                   double tau,
                                   const double* d_y,
                                   double* d_x) const {
  std::call_once(decomposition_->once,
                 [&]() { decomposition_->svd.Compute(MatrixXd(A_)); });
  Eigen::Map<VectorXd>(d_x, num_inputs()) =
      decomposition_->svd.InversePowerTimes(
          kappa, tau, Eigen::Map<const VectorXd>(d_y, num_outputs()));
}

}  // namespace invgrad
