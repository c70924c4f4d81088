// A half-inverse step for each layer of a network, with K-FAC's approximation
// of J_l^T J_l: two small eigenproblems for each layer instead of one for J.
//
//   J_l^T J_l = sum_s D_s (x) a_s a_s^T ~ (1 / B) D (x) A,
//   A = sum_s a_s a_s^T = P diag(lambda) P^T,
//   D = sum_s D_s = Q diag(mu) Q^T,   D_s = sum_j delta_{s,j} delta_{s,j}^T
//
//   step_l = -eta P [phi(s_ik) / s_ik * (P^T G_l Q)_ik] Q^T,
//   s_ik = sqrt(lambda_i mu_k / B),   phi(s) = max(s, tau s_max)^-kappa
//
// so that, without clamped values, step_l = -eta B^p A^-p G_l D^-p with p = (1 + kappa) / 2: 3/4 for
// half-inverse, 1 for the Gauss-Newton step of K-FAC [1]. G_l is the gradient
// J_l^T g in the layer's weights as a matrix, a_s and delta_{s,j} the factors
// of layer_jacobian.h, tau and s_max (of each layer) as in spectral_filter.h.
// A value counts as zero if its lambda_i or mu_k is zero up to rounding.
//
// The approximation drops the coupling of the layers and the correlation of D_s
// and a_s a_s^T over the batch. The second is exact for one sample with one
// output, and if all samples have the same D_s (the last layer in front of a
// linear simulator).
//
// Shapes:  A: fan_in x fan_in;  D: fan_out x fan_out;  G_l, step_l: fan_in x
//          fan_out, with the bias in the last row.
// Units:   as half-inverse: (g, J) -> c (g, J) multiplies the step by
//          c^(1 - kappa). A full step in each of L layers overshoots: choose
//          eta smaller than for half_inverse, or auto.
// Cost:    B sum (fan_in^2 + |y| fan_out^2) + O(sum fan_in^3 + fan_out^3), and
//          the deltas of network_jacobian.h; step_size=auto adds one product.
//          Ranks share the B samples and the eigenproblems; a rank sends about
//          3 sum (fan_in^2 + fan_out^2) numbers.
// Fails:   returns false if J has no layers (a network in front of a simulator
//          has; a ceres::Problem has none), if g, J^T g or the step is not
//          finite, if a factorization does not converge, or if there is no
//          automatic step size.
//
// [1] Martens, Grosse. Optimizing Neural Networks with Kronecker-factored
//     Approximate Curvature. ICML 2015, sections 3 and 4.2 (block diagonal).
//     arXiv 1503.05671. In [1], D_s = E[g_z g_z^T] includes the loss, and
//     damping is added (damped_kfac_rule.cc); here the metric of y is the
//     identity, as in every joint rule.
#include <lapacke.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "fmt/core.h"
#include "invgrad/core/blas.h"
#include "invgrad/core/finite.h"
#include "invgrad/core/layer_jacobian.h"
#include "invgrad/core/layered_jacobian.h"
#include "invgrad/core/shared_jacobian.h"
#include "invgrad/rules/joint_rule.h"
#include "invgrad/rules/kfac_layers.h"
#include "invgrad/rules/rule_rows.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// X X^T = unit^2 U diag(lambda) U^T = s_max^2 U diag(root^2) U^T, root in
// [0, 1].
struct Factor {
  MatrixXd U;  // first X X^T / unit^2, the lower triangle
  double unit = 0.0;
  VectorXd lambda;
  VectorXd root;
  double s_max = 0.0;
};

// The largest entry of X, of all ranks.
double LargestEntry(const MatrixXd& X, const Communicator* ranks) {
  const double own = X.cwiseAbs().maxCoeff();
  if (ranks == nullptr) return own;
  VectorXd all(ranks->size());
  ranks->Gather(&own, ranks->SharedSizes(ranks->size(), 1), all.data());
  return all.maxCoeff();
}

// Begins a factor of the matrix whose columns the ranks share.
Factor GramOf(const MatrixXd& X, const Communicator* ranks) {
  const Index size = X.rows();
  Factor factor;
  // Scaled by the largest entry, because its square may over- or underflow.
  factor.unit = LargestEntry(X, ranks);
  factor.lambda.setZero(size);
  factor.root.setZero(size);
  if (factor.unit == 0.0) {
    factor.U.setIdentity(size, size);
    return factor;
  }
  factor.U.setZero(size, size);
  Syrk(Op::kNone, 1.0, X / factor.unit, 0.0, factor.U);
  if (ranks != nullptr) ranks->Sum(factor.U.data(), factor.U.size());
  return factor;
}

// Sets U and lambda.
bool Decompose(Factor* factor, std::string* error) {
  const Index size = factor->U.rows();
  if (factor->unit == 0.0 || LAPACKE_dsyevd(LAPACK_COL_MAJOR,
                                            'V',
                                            'L',
                                            size,
                                            factor->U.data(),
                                            size,
                                            factor->lambda.data()) == 0) {
    return true;
  }
  *error = "the eigenvalues of a factor (dsyevd) did not converge";
  return false;
}

// Sets root and s_max.
void Complete(Factor* factor) {
  const Index size = factor->lambda.size();
  const double largest = factor->lambda[size - 1];
  factor->s_max = factor->unit * std::sqrt(largest);
  const double zero = size * std::numeric_limits<double>::epsilon() * largest;
  for (Index i = 0; i < size; ++i) {
    const double lambda = factor->lambda[i];
    if (lambda > zero) factor->root[i] = std::sqrt(lambda / largest);
  }
}

// The factors of inputs and deltas, layer after layer. The ranks decompose them
// in turn.
bool Factorize(const std::vector<const LayerJacobian*>& layers,
               const Communicator* ranks,
               std::vector<Factor>* factors,
               std::string* error) {
  for (const LayerJacobian* layer : layers) {
    factors->push_back(GramOf(layer->inputs(), ranks));
    factors->push_back(GramOf(layer->deltas(), ranks));
  }
  const auto owner = [&](std::size_t i) {
    return ranks == nullptr ? 0 : static_cast<int>(i) % ranks->size();
  };
  bool is_done = true;
  for (std::size_t i = 0; i < factors->size() && is_done; ++i) {
    if (ranks != nullptr && owner(i) != ranks->rank()) continue;
    is_done = Decompose(&(*factors)[i], error);
    if (!is_done) *error = fmt::format("layer {}: {}", i / 2, *error);
  }
  if (ranks != nullptr) is_done = ranks->Agree(is_done, error);
  if (!is_done) return false;
  for (std::size_t i = 0; i < factors->size(); ++i) {
    Factor& factor = (*factors)[i];
    if (ranks != nullptr) {
      ranks->Broadcast(owner(i), factor.U.data(), factor.U.size());
      ranks->Broadcast(owner(i), factor.lambda.data(), factor.lambda.size());
    }
    Complete(&factor);
  }
  return true;
}

// Multiplies a layer's gradient by phi(S_l) / S_l, and adds the number of kept
// singular values to *rank. B: the number of inputs.
void FilterGradient(const Factor& of_inputs,
                    const Factor& of_deltas,
                    double B,
                    const SpectralFilter& filter,
                    Eigen::Ref<VectorXd> gradient,
                    int* rank) {
  const MatrixXd& P = of_inputs.U;
  const MatrixXd& Q = of_deltas.U;
  const double s_max = of_inputs.s_max * of_deltas.s_max / std::sqrt(B);
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
}

class KfacRule final : public JointRule {
 public:
  using Options = JointRule::Options;
  explicit KfacRule(const Options& options) : JointRule(options) {}

  std::vector<MemoryPart> StepMemory(const JacobianSizes& J) const override {
    // Eigenvectors, and for the largest layer dsyevd's two matrices and a copy
    // of the deltas.
    double sum = 0.0;
    double largest = 0.0;
    for (const JacobianSizes::Layer& layer : J.layers) {
      const double squares =
          layer.fan_in * layer.fan_in + layer.fan_out * layer.fan_out;
      sum += squares;
      largest = std::max(largest,
                         2.0 * squares + layer.fan_out * J.rows / J.num_ranks);
    }
    std::vector<MemoryPart> parts = UpdateRule::StepMemory(J);
    parts.push_back({"factors of J", J.factor_bytes / J.num_ranks});
    parts.push_back(
        {"eigenproblems of the layers", sizeof(double) * (sum + largest)});
    return parts;
  }

 private:
  bool ComputeDirection(const Linearization& at_x,
                        const SpectralFilter& filter,
                        VectorXd* direction,
                        std::string* report,
                        std::string* error) override {
    const JacobianOperator& J = *at_x.jacobian;
    const auto blocks = ColumnBlocksOf(*OwnPart(at_x).jacobian);
    std::vector<const LayerJacobian*> layers;
    if (!FindLayers(blocks, &layers, error)) return false;
    if (!CheckFinite("g", at_x.loss_gradient, error)) return false;
    J.TransposeTimes(at_x.loss_gradient, direction);
    if (!CheckFinite("J^T g", *direction, error)) return false;
    *report = fmt::format("{} layers", layers.size());
    if (!filter.IsGradientDescent()) {
      std::vector<Factor> factors;
      if (!Factorize(layers, RanksOf(J), &factors, error)) return false;
      int rank = 0;
      Index column = 0;
      for (std::size_t l = 0; l < layers.size(); ++l) {
        const LayerJacobian& layer = *layers[l];
        FilterGradient(factors[2 * l],
                       factors[2 * l + 1],
                       static_cast<double>(layer.inputs().cols()) * J.rows() /
                           layer.rows(),
                       filter,
                       direction->segment(column, layer.cols()),
                       &rank);
        column += layer.cols();
      }
      *report += fmt::format(", rank {} of {}", rank, column);
    }
    return true;
  }
};

}  // namespace

std::vector<RuleRow> KfacRuleRows() {
  // Values below 1e-3 s_max are clamped, similar to K-FAC's damping, not
  // dropped: docs/results/layerwise.md.
  KfacRule::Options half_inverse;
  half_inverse.filter = SpectralFilter::HalfInverse(1e-3);
  half_inverse.filter.clamp = true;
  return {MakeRuleRow<KfacRule>(
      "kfac_half_inverse",
      "step_l = -eta B^p A^(-p) G_l D^(-p), p = (1 + kappa) / 2, "
      "J_l^T J_l ~ D (x) A / B",
      half_inverse)};
}

}  // namespace invgrad
