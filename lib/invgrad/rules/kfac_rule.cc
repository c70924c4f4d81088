// A step for each layer of a network with K-FAC's approximation of the layer's
// curvature: two small eigenproblems a layer, in place of one for J.
//
//   J_l^T M J_l ~ A (x) D,   A = P diag(alpha) P^T,   D = Q diag(beta) Q^T
//
//   step_l = -eta P [phi(s_ik) / s_ik * (P^T G_l Q)_ik] Q^T
//   s_ik^2 = (alpha_i + pi sqrt(lambda)) (beta_k + sqrt(lambda) / pi)
//   pi^2 = (tr A / fan_in) / (tr D / fan_out)
//
// so that, if no value is truncated or clamped,
//
//   step_l = -eta (A + pi sqrt(lambda))^-p G_l (D + sqrt(lambda) / pi)^-p
//
// with p = (1 + kappa) / 2: 3/4 for half-inverse, 1 for K-FAC as published [1].
// G_l is the gradient J_l^T g in the layer's weights as a matrix, A and D as in
// kfac_factors.h, phi of spectral.h, lambda its `damping`, and tau in units
// of the layer's largest s_ik. A value counts as zero if its alpha_i or beta_k,
// with damping, is zero up to rounding or negative.
//
// In the k-th update, every `interval` steps, the factors become the averages
//
//   A <- e A + (1 - e) A of the batch,   e = min(1 - 1 / k, decay),
//
// and D likewise. Sampled factors (convolutions count as dense layers of their
// patches [2]) draw their covector in step k = 0, 1, .. after
// np.random.seed(seed + k). The weights of no layer (batch normalization) then
// take
//
//   step_i = -eta G_i phi(s_i) / s_i,   s_i^2 = d_i + lambda
//
// where d_i averages (J^T w)_i^2, whose mean over w is the diagonal of J^T M J.
//
// With M = H_L, step_size=auto and rho = 1 it is the rescaling of [1]: the
// minimizer along the direction of the Gauss-Newton model with the whole J and
// the damping lambda. [1] also adapts lambda and adds momentum; here lambda is
// constant and there is no momentum.
//
// The approximation drops the coupling of the layers and the correlation of
// a_s a_s^T and delta_s delta_s^T over the batch. The second is exact for one
// sample with one output, and if all samples have the same delta_s (the last
// layer in front of a linear simulator).
//
// Shapes:  G_l, step_l: fan_in x fan_out, with the bias in the last row.
// Units:   M = 1: as half-inverse, (g, J) -> c (g, J) multiplies the step by
//          c^(1 - kappa). M = H_L: lambda in [L] / [theta]^2; for kappa = 1 eta
//          is a number. A full step in each of L layers overshoots: choose eta
//          smaller than for half_inverse, or auto.
// Cost:    that of kfac_factors.h, and the deltas of network_jacobian.h; at
//          steps between two updates, the products with P and Q alone.
//          step_size=auto adds one product.
// Fails:   returns false if J has no layers (a network in front of a simulator
//          has; a ceres::Problem has none), if g, J^T g or the step is not
//          finite, if a factorization does not converge, or if there is no
//          automatic step size.
//
// [1] Martens, Grosse. Optimizing Neural Networks with Kronecker-factored
//     Approximate Curvature. ICML 2015, sections 3, 4.2 (block diagonal), 5,
//     6.3 and 6.4. arXiv 1503.05671. For a squared norm, the Fisher matrix of
//     [1] is the Gauss-Newton matrix.
// [2] Grosse, Martens. A Kronecker-factored approximate Fisher matrix for
//     convolution layers. ICML 2016. arXiv 1602.01407.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "fmt/core.h"
#include "invgrad/core/finite.h"
#include "invgrad/core/layer_jacobian.h"
#include "invgrad/core/shared_jacobian.h"
#include "invgrad/internal/blas.h"
#include "invgrad/internal/layered_jacobian.h"
#include "invgrad/internal/logging.h"
#include "invgrad/rules/joint_rule.h"
#include "invgrad/rules/kfac_factors.h"
#include "invgrad/rules/rule_rows.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The square roots of a factor's damped eigenvalues, largest * relative.
struct Roots {
  VectorXd relative;  // in [0, 1]
  double largest = 0.0;

  Roots(const KfacFactor& factor, double damping) {
    const VectorXd values = factor.values.array() +
                            damping * factor.count / factor.unit / factor.unit;
    const Index size = values.size();
    const double highest = values[size - 1];
    const double zero = size * std::numeric_limits<double>::epsilon() * highest;
    relative.setZero(size);
    for (Index i = 0; i < size; ++i) {
      if (values[i] > zero) relative[i] = std::sqrt(values[i] / highest);
    }
    largest = factor.unit * std::sqrt(std::max(0.0, highest));
  }
};

class KfacRule final : public JointRule {
 public:
  struct Options : JointRule::Options {
    std::string metric = "identity";
    double decay = 0.0;
    int interval = 1;
    int seed = 0;

    void Describe(OptionSet* set) {
      JointRule::Options::Describe(set);
      set->Add("metric",
               &metric,
               {"identity", "loss"},
               "of the outputs: factors of J_l^T J_l, or of J_l^T H_L J_l");
      set->Add("decay",
               &decay,
               {0.0, 1.0, false, true},
               "memory of the factors, at most; 0: those of the batch alone");
      set->Add("interval",
               &interval,
               {1.0, 1e6},
               "steps from one update of the factors to the next");
      set->Add("seed",
               &seed,
               {0.0, std::numeric_limits<int>::max()},
               "of the sampled factors, where J is given by products");
    }
  };

  explicit KfacRule(const Options& options)
      : JointRule(options), options_(options) {}

  std::vector<VectorXd*> MutableState() override {
    curvature_ = KfacCurvature();  // who sets the state changes the factors
    std::vector<VectorXd*> state = JointRule::MutableState();
    state.push_back(&factors_);
    state.push_back(&k_);
    return state;
  }

 private:
  bool KeepsFactors() const {
    return options_.decay > 0.0 || options_.interval > 1;
  }
  bool IsOfLoss() const { return options_.metric == "loss"; }

  double CurvatureDamping() const override {
    return IsOfLoss() ? options_.filter.damping : 0.0;
  }

  bool ComputeDirection(const Linearization& at_x,
                        const SpectralFilter& filter,
                        VectorXd* direction,
                        std::string* report,
                        std::string* error) override {
    const JacobianOperator& J = *at_x.jacobian;
    const auto blocks = ColumnBlocksOf(*OwnPart(at_x).jacobian);
    std::vector<const LayerJacobian*> layers;
    std::vector<LayerColumns> columns = FactorLayersOf(J);
    if (columns.empty()) {
      if (!FindLayers(blocks, &layers, error)) return false;
      columns = ColumnsOf(layers);
    }
    if (!CheckFinite("g", at_x.loss_gradient, error)) return false;
    J.TransposeTimes(at_x.loss_gradient, direction);
    if (!CheckFinite("J^T g", *direction, error)) return false;
    *report = fmt::format("{} layers", columns.size());
    if (filter.IsGradientDescent()) return true;
    if (!UpdateFactors(at_x, layers, columns, error)) {
      curvature_ = KfacCurvature();
      return false;
    }
    int rank = 0;
    for (std::size_t l = 0; l < columns.size(); ++l) {
      FilterLayer(columns[l],
                  curvature_.factors[2 * l],
                  curvature_.factors[2 * l + 1],
                  filter,
                  direction,
                  &rank);
    }
    if (layers.empty()) FilterOthers(columns, filter, direction, &rank);
    *report += fmt::format(", rank {} of {}", rank, direction->size());
    return true;
  }

  // Sets curvature_ for a step. `layers` are empty if J has sampled factors.
  bool UpdateFactors(const Linearization& at_x,
                     const std::vector<const LayerJacobian*>& layers,
                     const std::vector<LayerColumns>& columns,
                     std::string* error) {
    const JacobianOperator& J = *at_x.jacobian;
    const auto k = static_cast<long>(k_[0]);
    const bool is_due = k % options_.interval == 0;
    if (is_due || curvature_.factors.empty()) {
      curvature_ = KfacCurvature(columns, layers.empty() ? J.cols() : 0);
      double memory = 1.0;
      if (is_due) {
        const long num_updates = k / options_.interval + 1;
        memory = std::min(1.0 - 1.0 / static_cast<double>(num_updates),
                          options_.decay);
        // A resumed run needs only k.
        const std::uint32_t seed = static_cast<std::uint32_t>(options_.seed) +
                                   static_cast<std::uint32_t>(k);
        if (!layers.empty()) {
          SumFactors(at_x, layers, IsOfLoss(), &curvature_);
        } else if (!SampleFactors(at_x, IsOfLoss(), seed, &curvature_, error)) {
          return false;
        }
      }
      if (KeepsFactors()) Average(memory);
      if (!DecomposeFactors(RanksOf(J), &curvature_, error)) return false;
    }
    k_[0] += 1.0;
    return true;
  }

  // Takes the averages with what is kept, and keeps them.
  void Average(double memory) {
    std::vector<Eigen::Map<VectorXd>> parts;
    Index size = 0;
    const auto add = [&](auto* part) {
      parts.emplace_back(part->data(), part->size());
      size += part->size();
    };
    add(&curvature_.others);
    for (KfacFactor& factor : curvature_.factors) {
      factor.TakeUnits();
      add(&factor.U);
    }
    if (factors_.size() == 0) factors_.setZero(size);
    CHECK_EQ(factors_.size(), size)
        << "The network has changed; use a new update rule for each run.";
    Index first = 0;
    for (Eigen::Map<VectorXd>& part : parts) {
      auto kept = factors_.segment(first, part.size());
      kept = memory * kept + (1.0 - memory) * part;
      part = kept;
      first += part.size();
    }
  }

  // Multiplies a layer's gradient by phi(S_l) / S_l, and adds the number of
  // kept singular values to *rank.
  static void FilterLayer(const LayerColumns& columns,
                          const KfacFactor& A,
                          const KfacFactor& D,
                          SpectralFilter filter,
                          VectorXd* gradient,
                          int* rank) {
    const double damping = std::sqrt(filter.damping);
    filter.damping = 0.0;
    double pi = 1.0;
    // Without a trace there is nothing to balance.
    if (damping > 0.0 && A.mean_value() > 0.0 && D.mean_value() > 0.0) {
      pi = std::sqrt(A.mean_value() / D.mean_value());
    }
    const Roots of_inputs(A, pi * damping);
    const Roots of_deltas(D, damping / pi);
    const double s_max =
        of_inputs.largest * of_deltas.largest / std::sqrt(A.count);
    MatrixXd G = (*gradient)(columns.reshaped())
                     .reshaped(columns.rows(), columns.cols());
    MatrixXd GQ(G.rows(), G.cols());
    Gemm(Op::kNone, Op::kNone, 1.0, G, D.U, 0.0, GQ);
    Gemm(Op::kTranspose, Op::kNone, 1.0, A.U, GQ, 0.0, G);
    for (Index k = 0; k < G.cols(); ++k) {
      for (Index i = 0; i < G.rows(); ++i) {
        const double s = s_max * of_inputs.relative[i] * of_deltas.relative[k];
        const double phi = filter(s, s_max);
        // Not phi / s, which may over- or underflow although the result does
        // not.
        G(i, k) = phi == 0.0 ? 0.0 : G(i, k) * phi / s;
        if (filter.Keeps(s, s_max)) ++*rank;
      }
    }
    Gemm(Op::kNone, Op::kNone, 1.0, A.U, G, 0.0, GQ);
    Gemm(Op::kNone, Op::kTranspose, 1.0, GQ, D.U, 0.0, G);
    (*gradient)(columns.reshaped()) = G.reshaped();
  }

  // The same for the weights of no layer.
  void FilterOthers(const std::vector<LayerColumns>& layers,
                    SpectralFilter filter,
                    VectorXd* gradient,
                    int* rank) const {
    VectorXd s = (curvature_.others.array() + filter.damping).sqrt();
    filter.damping = 0.0;
    for (const LayerColumns& layer : layers)
      s(layer.reshaped()).setConstant(-1.0);
    const double s_max = s.maxCoeff();
    for (Index i = 0; i < s.size(); ++i) {
      if (s[i] < 0.0) continue;  // of a layer
      const double phi = filter(s[i], s_max);
      (*gradient)[i] = phi == 0.0 ? 0.0 : (*gradient)[i] * phi / s[i];
      if (filter.Keeps(s[i], s_max)) ++*rank;
    }
  }

  const Options options_;
  VectorXd factors_;  // KfacCurvature's `others` and the averaged matrices
  VectorXd k_ = VectorXd::Zero(1);
  KfacCurvature curvature_;  // decomposed; empty: to be made
};

}  // namespace

std::vector<RuleRow> KfacRuleRows() {
  // Values below 1e-3 s_max are clamped, similar to K-FAC's damping, not
  // dropped: docs/results/settings.md.
  KfacRule::Options half_inverse;
  half_inverse.filter = SpectralFilter::HalfInverse(1e-3);
  half_inverse.filter.clamp = true;
  KfacRule::Options published;
  published.step_size.step_size = std::nullopt;  // auto
  published.step_size.rho = 1.0;
  published.filter = SpectralFilter::GaussNewton(0.0);
  published.filter.damping = 1e-3;
  published.metric = "loss";
  published.decay = 0.95;
  return {
      MakeRuleRow<KfacRule>(
          "kfac_half_inverse",
          "step_l = -eta A^(-p) G_l D^(-p), p = (1 + kappa) / 2, "
          "J_l^T J_l ~ A (x) D",
          half_inverse),
      MakeRuleRow<KfacRule>(
          "kfac",
          "step_l = -eta (A + pi sqrt(lambda))^(-p) G_l (D + sqrt(lambda) / "
          "pi)^(-p), p = (1 + kappa) / 2, J_l^T H_L J_l ~ A (x) D",
          published)};
}

}  // namespace invgrad
