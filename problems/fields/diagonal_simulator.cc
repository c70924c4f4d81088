#include "problems/fields/diagonal_simulator.h"

#include <algorithm>
#include <utility>

#include "invgrad/internal/scratch.h"

namespace invgrad {

using Eigen::ArrayXd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

DiagonalSimulator::DiagonalSimulator(int num_cells, ArrayXd eigenvalues)
    : num_cells_(num_cells), eigenvalues_(std::move(eigenvalues)) {}

bool DiagonalSimulator::Evaluate(const double* x,
                                 const double* /*context*/,
                                 double* y,
                                 double* jacobian) const {
  Filter(eigenvalues_, x, y);
  if (!AllFinite(y, num_cells_)) return false;
  if (jacobian == nullptr) return true;
  if (!forms_jacobian()) {
    FormJacobian(jacobian);
    return true;
  }
  std::call_once(once_, [this]() {
    jacobian_.resize(num_cells_, num_cells_);
    FormJacobian(jacobian_.data());
  });
  std::copy_n(jacobian_.data(), jacobian_.size(), jacobian);
  return true;
}

std::unique_ptr<const JacobianOperator> DiagonalSimulator::Linearize(
    const double* x, const double* /*context*/, double* y) const {
  Filter(eigenvalues_, x, y);
  if (!AllFinite(y, num_cells_)) return nullptr;
  const auto product = [this](const VectorXd& in, VectorXd* out) {
    out->resize(num_cells_);
    Filter(eigenvalues_, in.data(), out->data());
  };
  return std::make_unique<FunctionJacobian>(
      num_cells_, num_cells_, product, product);
}

bool DiagonalSimulator::Adjoint(const double* x,
                                const double* /*context*/,
                                const Covector& covector,
                                double* y,
                                double* x_bar) const {
  Filter(eigenvalues_, x, y);
  if (!AllFinite(y, num_cells_)) return false;
  Scratch<double> w(num_cells_);
  if (!covector(y, w.data())) return false;
  Filter(eigenvalues_, w.data(), x_bar);
  return AllFinite(x_bar, num_cells_);
}

bool DiagonalSimulator::WeightedHessian(const double* /*x*/,
                                        const double* /*context*/,
                                        const double* /*w*/,
                                        double* hessian) const {
  Eigen::Map<MatrixXd>(hessian, num_cells_, num_cells_).setZero();
  return true;
}

void DiagonalSimulator::InversePower(double kappa,
                                     double tau,
                                     const double* d_y,
                                     double* d_x) const {
  const ArrayXd s = eigenvalues_.abs();
  const ArrayXd factors =
      (s > tau * s.maxCoeff()).select(eigenvalues_.sign() * s.pow(-kappa), 0.0);
  Filter(factors, d_y, d_x);
}

void DiagonalSimulator::FormJacobian(double* jacobian) const {
  // J is symmetric: rows are columns.
  VectorXd unit = VectorXd::Zero(num_cells_);
  for (int i = 0; i < num_cells_; ++i) {
    unit[i] = 1.0;
    Filter(eigenvalues_,
           unit.data(),
           jacobian + static_cast<std::ptrdiff_t>(i) * num_cells_);
    unit[i] = 0.0;
  }
}

}  // namespace invgrad
