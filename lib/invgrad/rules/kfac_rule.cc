#include "invgrad/rules/kfac_rule.h"

#include <lapacke.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "fmt/core.h"
#include "invgrad/core/blas.h"
#include "invgrad/core/finite.h"
#include "invgrad/core/layer_jacobian.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// X X^T = s_max^2 U diag(root^2) U^T, root in [0, 1].
struct Factor {
  MatrixXd U;
  VectorXd root;
  double s_max = 0.0;
};

bool Factorize(const MatrixXd& X, Factor* factor, std::string* error) {
  const Index size = X.rows();
  // Scaled by the largest entry, because its square may over- or underflow.
  const double unit = X.cwiseAbs().maxCoeff();
  factor->root.setZero(size);
  if (unit == 0.0) {
    factor->U.setIdentity(size, size);
    factor->s_max = 0.0;
    return true;
  }
  factor->U.resize(size, size);
  Syrk(Op::kNone, 1.0, X / unit, 0.0, factor->U);
  VectorXd lambda(size);
  if (LAPACKE_dsyevd(LAPACK_COL_MAJOR,
                     'V',
                     'L',
                     size,
                     factor->U.data(),
                     size,
                     lambda.data()) != 0) {
    *error = "the eigenvalues of a factor (dsyevd) did not converge";
    return false;
  }
  const double largest = lambda[size - 1];
  factor->s_max = unit * std::sqrt(largest);
  const double zero = size * std::numeric_limits<double>::epsilon() * largest;
  for (Index i = 0; i < size; ++i) {
    if (lambda[i] > zero) factor->root[i] = std::sqrt(lambda[i] / largest);
  }
  return true;
}

// Multiplies a layer's gradient by phi(S_l) / S_l, and adds the number of kept
// singular values to *rank.
bool FilterGradient(const LayerJacobian& layer,
                    const SpectralFilter& filter,
                    Eigen::Ref<VectorXd> gradient,
                    int* rank,
                    std::string* error) {
  Factor of_inputs;
  Factor of_deltas;
  if (!Factorize(layer.inputs(), &of_inputs, error) ||
      !Factorize(layer.deltas(), &of_deltas, error)) {
    return false;
  }
  const MatrixXd& P = of_inputs.U;
  const MatrixXd& Q = of_deltas.U;
  const double s_max = of_inputs.s_max * of_deltas.s_max /
                       std::sqrt(static_cast<double>(layer.inputs().cols()));
  Eigen::Map<MatrixXd> G(gradient.data(), P.rows(), Q.rows());
  MatrixXd GQ(P.rows(), Q.rows());
  Gemm(Op::kNone, Op::kNone, 1.0, G, Q, 0.0, GQ);
  Gemm(Op::kTranspose, Op::kNone, 1.0, P, GQ, 0.0, G);
  for (Index k = 0; k < Q.rows(); ++k) {
    for (Index i = 0; i < P.rows(); ++i) {
      const double s = s_max * of_inputs.root[i] * of_deltas.root[k];
      const double phi = filter(s, s_max);
      // Not phi / s, which may over- or underflow although the result does not.
      G(i, k) = phi == 0.0 ? 0.0 : G(i, k) * phi / s;
      if (filter.Keeps(s, s_max)) ++*rank;
    }
  }
  Gemm(Op::kNone, Op::kNone, 1.0, P, G, 0.0, GQ);
  Gemm(Op::kNone, Op::kTranspose, 1.0, GQ, Q, 0.0, G);
  return true;
}

}  // namespace

KfacRule::Options::Options() {
  filter = SpectralFilter::HalfInverse(1e-3);
  filter.clamp = true;
}

void KfacRule::Options::Describe(OptionSet* set) { DescribeJoint(set); }

KfacRule::KfacRule(const Options& options) : JointRule(options) {
  CheckOptions(options);
}

std::vector<MemoryPart> KfacRule::StepMemory(const JacobianSizes& J) const {
  // For the largest layer: eigenvectors, dsyevd's two matrices, and a copy of
  // the deltas.
  double largest = 0.0;
  for (const JacobianSizes::Layer& layer : J.layers) {
    const double squares =
        layer.fan_in * layer.fan_in + layer.fan_out * layer.fan_out;
    largest = std::max(
        largest, sizeof(double) * (3.0 * squares + layer.fan_out * J.rows));
  }
  std::vector<MemoryPart> parts = UpdateRule::StepMemory(J);
  parts.push_back({"factors of J", J.factor_bytes});
  parts.push_back({"eigenproblems of a layer", largest});
  return parts;
}

bool KfacRule::ComputeDirection(const Linearization& at_x,
                                const SpectralFilter& filter,
                                VectorXd* direction,
                                std::string* report,
                                std::string* error) {
  const JacobianOperator& J = *at_x.jacobian;
  const std::vector<std::unique_ptr<const JacobianOperator>> blocks =
      J.ColumnBlocks();
  std::vector<const LayerJacobian*> layers;
  for (const auto& block : blocks) {
    layers.push_back(dynamic_cast<const LayerJacobian*>(block.get()));
    if (layers.back() == nullptr) break;
  }
  if (layers.empty() || layers.back() == nullptr) {
    *error =
        "K-FAC needs the Jacobian of a network's layers, which this problem "
        "does not have; half_inverse and layer_half_inverse work with any "
        "Jacobian";
    return false;
  }
  if (!CheckFinite("g", at_x.loss_gradient, error)) return false;
  J.TransposeTimes(at_x.loss_gradient, direction);
  if (!CheckFinite("J^T g", *direction, error)) return false;
  *report = fmt::format("{} layers", layers.size());
  if (!filter.IsGradientDescent()) {
    int rank = 0;
    Index column = 0;
    for (std::size_t l = 0; l < layers.size(); ++l) {
      if (!FilterGradient(*layers[l],
                          filter,
                          direction->segment(column, layers[l]->cols()),
                          &rank,
                          error)) {
        *error = fmt::format("layer {}: {}", l, *error);
        return false;
      }
      column += layers[l]->cols();
    }
    *report += fmt::format(", rank {} of {}", rank, column);
  }
  return true;
}

}  // namespace invgrad
