// K-FAC as published: a Gauss-Newton step for each layer of a network, with
// Kronecker factors of the curvature, averaged over the steps and damped.
//
//   J_l^T H_L J_l ~ A (x) D,   A = 1/N sum_s a_s a_s^T
//   D = sum_s sum_jk delta_{s,j} (H_L)_{sj,sk} delta_{s,k}^T
//   step_l = -eta (A + pi sqrt(lambda))^-1 G_l (D + sqrt(lambda) / pi)^-1
//   pi^2 = (tr A / fan_in) / (tr D / fan_out)
//
// G_l is the gradient J_l^T g in the layer's weights as a matrix, a_s and
// delta_{s,j} the factors of layer_jacobian.h, N the number of a_s. In the k-th
// step the factors are the averages
//
//   A <- e A + (1 - e) A of the batch,   e = min(1 - 1 / k, decay),
//
// and D likewise. step_size=auto with rho = 1 is the rescaling of [1]: the
// minimizer along the direction of the Gauss-Newton model with the whole J and
// the damping lambda. [1] also adapts lambda and adds momentum; here lambda is
// constant and there is no momentum.
//
// With one linear layer, a linear simulator, and a loss of constant H_L, J_l^T
// H_L J_l is the Kronecker product itself: without damping and with eta = 1, the
// step is the Gauss-Newton (natural gradient) step.
//
// Shapes:  A: fan_in x fan_in;  D: fan_out x fan_out;  G_l, step_l: fan_in x
//          fan_out, with the bias in the last row.
// Units:   lambda in [L] / [theta]^2; eta is a number.
// Cost:    as kfac_rule.cc, with Cholesky factorizations in place of the
//          eigenproblems, and fan_out products with H_L a layer.
// Fails:   returns false if J has no layers (a network in front of a simulator
//          has; a ceres::Problem has none), if g, J^T g or the step is not
//          finite, if a damped factor is not positive definite (no damping, or
//          a loss with negative curvature), or if there is no automatic step
//          size.
//
// [1] Martens, Grosse. Optimizing Neural Networks with Kronecker-factored
//     Approximate Curvature. ICML 2015, sections 3, 4.2 (block diagonal), 5,
//     6.3 and 6.4. arXiv 1503.05671. For a squared norm, the Fisher matrix of
//     [1] is the Gauss-Newton matrix.
#include <lapacke.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/core/blas.h"
#include "invgrad/core/finite.h"
#include "invgrad/core/layer_jacobian.h"
#include "invgrad/rules/kfac_layers.h"
#include "invgrad/rules/rule_rows.h"
#include "invgrad/rules/step_size.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The deltas times H_L, row by row.
MatrixXd CurvedDeltas(const LayerJacobian& layer, const Linearization& at_x) {
  MatrixXd curved = layer.deltas();
  if (!at_x.loss_hessian_times) return curved;
  const Index num_calls = layer.num_calls();
  const Index fan_out = curved.rows();
  for (Index unit = 0; unit < fan_out; ++unit) {
    for (Index call = 0; call < num_calls; ++call) {
      Map<VectorXd, 0, Eigen::InnerStride<>> row(
          curved.data() + call * fan_out + unit,
          layer.rows(),
          Eigen::InnerStride<>(fan_out * num_calls));
      row = at_x.loss_hessian_times(VectorXd(row));
    }
  }
  return curved;
}

// *X = (factor + damping)^-1 *X. Returns false if that is not positive definite.
bool SolveDamped(MatrixXd factor, double damping, MatrixXd* X) {
  factor.diagonal().array() += damping;
  return LAPACKE_dposv(LAPACK_COL_MAJOR,
                       'L',
                       factor.rows(),
                       X->cols(),
                       factor.data(),
                       factor.rows(),
                       X->data(),
                       X->rows()) == 0;
}

class DampedKfacRule final : public UpdateRule {
 public:
  struct Options {
    StepSizeOptions step_size{/*step_size=*/std::nullopt};
    double damping = 1e-3;
    double decay = 0.95;

    Options() { step_size.rho = 1.0; }
    void Describe(OptionSet* set) {
      step_size.Describe(/*allow_auto=*/true, set);
      set->Add("damping",
               &damping,
               {0.0, std::numeric_limits<double>::infinity()},
               "lambda, in units of the Hessian");
      set->Add("decay",
               &decay,
               {0.0, 1.0, false, true},
               "memory of the factors, at most; 0: those of the batch alone");
    }
  };

  explicit DampedKfacRule(const Options& options) : options_(options) {}

  LinearizationParts Needs() const override {
    return LinearizationParts::Jacobian();
  }

  bool ComputeStep(const Linearization& at_x,
                   VectorXd* step,
                   std::string* error) override {
    CHECK(at_x.jacobian != nullptr);
    report_.clear();
    const JacobianOperator& J = *at_x.jacobian;
    const auto blocks = J.ColumnBlocks();
    std::vector<const LayerJacobian*> layers;
    if (!FindLayers(blocks, &layers, error)) return false;
    if (!CheckFinite("g", at_x.loss_gradient, error)) return false;
    VectorXd direction;
    J.TransposeTimes(at_x.loss_gradient, &direction);
    if (!CheckFinite("J^T g", direction, error)) return false;
    const bool is_zero = direction.isZero(0.0);
    if (!Precondition(at_x, layers, &direction, error)) return false;
    double eta = options_.step_size.step_size.value_or(0.0);
    if (options_.step_size.is_auto() && !is_zero &&
        !FindStepSize(at_x, direction, &eta, error)) {
      return false;
    }
    eta *= options_.step_size.ScheduleFactor(at_x.progress);
    *step = -eta * direction;
    report_ = fmt::format("{} layers, step size {:.2g}", layers.size(), eta);
    return CheckFinite("the step", *step, error);
  }

  bool ReadsProgress() const override {
    return options_.step_size.has_schedule();
  }

  std::vector<VectorXd*> MutableState() override { return {&factors_, &k_}; }
  std::string LastStepReport() const override { return report_; }

  std::vector<MemoryPart> StepMemory(const JacobianSizes& J) const override {
    double squares = 0.0;
    double largest = 0.0;
    for (const JacobianSizes::Layer& layer : J.layers) {
      squares += layer.fan_in * layer.fan_in + layer.fan_out * layer.fan_out;
      largest = std::max(largest,
                         2.0 * layer.fan_in * layer.fan_in +
                             2.0 * layer.fan_out * layer.fan_out +
                             layer.fan_out * J.rows);
    }
    std::vector<MemoryPart> parts = UpdateRule::StepMemory(J);
    parts.push_back({"factors of J", J.factor_bytes});
    parts.push_back({"averaged factors", sizeof(double) * squares});
    parts.push_back({"factorizations of a layer", sizeof(double) * largest});
    return parts;
  }

 private:
  // Updates the factors, and multiplies the gradient by their damped inverses.
  bool Precondition(const Linearization& at_x,
                    const std::vector<const LayerJacobian*>& layers,
                    VectorXd* gradient,
                    std::string* error) {
    Index size = 0;
    for (const LayerJacobian* layer : layers) {
      const Index fan_in = layer->inputs().rows();
      const Index fan_out = layer->deltas().rows();
      size += fan_in * fan_in + fan_out * fan_out;
    }
    if (factors_.size() == 0) factors_.setZero(size);
    CHECK_EQ(factors_.size(), size)
        << "The network has changed; use a new update rule for each run.";
    k_[0] += 1.0;
    const double memory = std::min(1.0 - 1.0 / k_[0], options_.decay);
    double* next = factors_.data();
    Index column = 0;
    for (std::size_t l = 0; l < layers.size(); ++l) {
      const LayerJacobian& layer = *layers[l];
      const Index fan_in = layer.inputs().rows();
      const Index fan_out = layer.deltas().rows();
      Map<MatrixXd> A(next, fan_in, fan_in);
      Map<MatrixXd> D(next + A.size(), fan_out, fan_out);
      Gemm(Op::kNone,
           Op::kTranspose,
           (1.0 - memory) / static_cast<double>(layer.inputs().cols()),
           layer.inputs(),
           layer.inputs(),
           memory,
           A);
      Gemm(Op::kNone,
           Op::kTranspose,
           1.0 - memory,
           CurvedDeltas(layer, at_x),
           layer.deltas(),
           memory,
           D);
      if (!PreconditionLayer(A, D, gradient->segment(column, layer.cols()))) {
        *error = fmt::format(
            "layer {}: a damped factor is not positive definite; a larger "
            "damping may help",
            l);
        return false;
      }
      next += A.size() + D.size();
      column += layer.cols();
    }
    return true;
  }

  bool PreconditionLayer(const Eigen::Ref<const MatrixXd>& A,
                         const Eigen::Ref<const MatrixXd>& D,
                         Eigen::Ref<VectorXd> gradient) const {
    const double mean_A = A.trace() / static_cast<double>(A.rows());
    const double mean_D = D.trace() / static_cast<double>(D.rows());
    // Without a trace there is nothing to balance.
    const double pi =
        mean_A > 0.0 && mean_D > 0.0 ? std::sqrt(mean_A / mean_D) : 1.0;
    const double damping = std::sqrt(options_.damping);
    Map<MatrixXd> G(gradient.data(), A.rows(), D.rows());
    if (G.isZero(0.0)) return true;  // a dead layer has no curvature
    MatrixXd X = G;
    if (!SolveDamped(A, pi * damping, &X)) return false;
    X.transposeInPlace();
    if (!SolveDamped(D, damping / pi, &X)) return false;
    G = X.transpose();
    return true;
  }

  bool FindStepSize(const Linearization& at_x,
                    const VectorXd& direction,
                    double* eta,
                    std::string* error) const {
    AlongDirection model;
    if (!ModelAlong(at_x, -direction, &model, error)) return false;
    const double length = direction.norm() / model.unit;
    model.curvature += options_.damping * length * length;
    return AutoStepSize(model, options_.step_size.rho, eta, error);
  }

  const Options options_;
  VectorXd factors_;  // A and D of each layer
  VectorXd k_ = VectorXd::Zero(1);
  std::string report_;
};

}  // namespace

std::vector<RuleRow> DampedKfacRuleRows() {
  return {MakeRuleRow<DampedKfacRule>(
      "kfac",
      "step_l = -eta (A + pi sqrt(lambda))^-1 G_l (D + sqrt(lambda) / pi)^-1, "
      "J_l^T H_L J_l ~ A (x) D")};
}

}  // namespace invgrad
