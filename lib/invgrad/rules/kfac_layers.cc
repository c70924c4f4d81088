#include "invgrad/rules/kfac_layers.h"

#include <limits>

#include "Eigen/Eigenvalues"
#include "invgrad/io/numpy_random.h"

namespace invgrad {

using Eigen::MatrixXd;
using Eigen::VectorXd;

bool FindLayers(
    const std::vector<std::unique_ptr<const JacobianOperator>>& blocks,
    std::vector<const LayerJacobian*>* layers,
    std::string* error) {
  layers->clear();
  for (const auto& block : blocks) {
    layers->push_back(dynamic_cast<const LayerJacobian*>(block.get()));
    if (layers->back() == nullptr) break;
  }
  if (!layers->empty() && layers->back() != nullptr) return true;
  *error =
      "K-FAC needs the Jacobian of a network's layers, which this problem "
      "does not have; half_inverse and layer_half_inverse work with any "
      "Jacobian";
  return false;
}

void DrawCovector(const Linearization& at_x, std::uint32_t seed, VectorXd* w) {
  *w = NumpyRandom(seed).Normal(at_x.jacobian->rows());
  if (!at_x.loss_hessian_times) return;
  constexpr int kIterations = 30;
  constexpr double kRounding = 1e-10;
  const double length = w->norm();
  std::vector<VectorXd> basis = {*w / length};
  // H_L in the basis is tridiagonal.
  VectorXd diagonal(kIterations);
  VectorXd beside(kIterations);
  int k = 0;
  while (true) {
    VectorXd next = at_x.loss_hessian_times(basis[k]);
    diagonal[k] = next.dot(basis[k]);
    next -= diagonal[k] * basis[k];
    if (k > 0) next -= beside[k - 1] * basis[k - 1];
    beside[k] = next.norm();
    ++k;
    // Written so that NaN ends the loop.
    const double scale = diagonal.head(k).cwiseAbs().maxCoeff();
    if (k == kIterations || !(beside[k - 1] > kRounding * scale)) break;
    basis.push_back(next / beside[k - 1]);
  }
  if (!diagonal.head(k).allFinite() || !beside.head(k - 1).allFinite()) {
    w->setConstant(std::numeric_limits<double>::quiet_NaN());
    return;
  }
  Eigen::SelfAdjointEigenSolver<MatrixXd> eigen;
  eigen.computeFromTridiagonal(diagonal.head(k), beside.head(k - 1));
  const VectorXd root =
      eigen.eigenvectors() *
      eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().cwiseProduct(
          eigen.eigenvectors().row(0).transpose());
  w->setZero();
  for (int i = 0; i < k; ++i) *w += length * root[i] * basis[i];
}

}  // namespace invgrad
