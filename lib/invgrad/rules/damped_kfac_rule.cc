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
// update, every `interval` steps, the factors become the averages
//
//   A <- e A + (1 - e) A of the batch,   e = min(1 - 1 / k, decay),
//
// and D likewise. step_size=auto with rho = 1 is the rescaling of [1]: the
// minimizer along the direction of the Gauss-Newton model with the whole J and
// the damping lambda. [1] also adapts lambda and adds momentum; here lambda is
// constant and there is no momentum.
//
// A Jacobian that is given by products (a network of libtorch, or a simulator of
// fields) has sampled factors (sampled_factors.h): convolutions count as dense
// layers of their patches [2], with the cells as further samples, and
//
//   D = sum_t delta_t delta_t^T   for a random covector w ~ N(0, H_L) of y,
//
// whose mean over w is the D above: a gradient of the loss at a target drawn from
// its Gauss-Newton model, as in [1]; step k = 0, 1, .. draws after
// np.random.seed(seed + k). The weights of no layer (batch normalization) take
//
//   step_i = -eta G_i / (d_i + lambda)
//
// where d_i averages (J^T w)_i^2, whose mean over w is the diagonal of J^T H_L J.
//
// With one linear layer, a linear simulator, and a loss of constant H_L, J_l^T
// H_L J_l is the Kronecker product itself: without damping and with eta = 1, the
// step is the Gauss-Newton (natural gradient) step.
//
// Shapes:  A: fan_in x fan_in;  D: fan_out x fan_out;  G_l, step_l: fan_in x
//          fan_out, with the bias in the last row.
// Units:   lambda in [L] / [theta]^2; eta is a number.
// Cost:    as kfac_rule.cc, with Cholesky factorizations in place of the
//          eigenproblems, which every rank makes, and fan_out products with H_L
//          a layer. Sampled: one product with J^T, and N (fan_in^2 + fan_out^2)
//          a layer, where N also counts the cells.
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
// [2] Grosse, Martens. A Kronecker-factored approximate Fisher matrix for
//     convolution layers. ICML 2016. arXiv 1602.01407.
#include <lapacke.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "fmt/core.h"
#include "invgrad/core/blas.h"
#include "invgrad/core/finite.h"
#include "invgrad/core/layer_jacobian.h"
#include "invgrad/internal/logging.h"
#include "invgrad/rules/kfac_layers.h"
#include "invgrad/rules/rule_rows.h"
#include "invgrad/rules/step_size.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Eigen::VectorXi;

// The deltas times H_L, row by row.
MatrixXd CurvedDeltas(const LayerJacobian& layer, const Linearization& own) {
  MatrixXd curved = layer.deltas();
  if (!own.loss_hessian_times) return curved;
  const Index num_calls = layer.num_calls();
  const Index fan_out = curved.rows();
  for (Index unit = 0; unit < fan_out; ++unit) {
    for (Index call = 0; call < num_calls; ++call) {
      Map<VectorXd, 0, Eigen::InnerStride<>> row(
          curved.data() + call * fan_out + unit,
          layer.rows(),
          Eigen::InnerStride<>(fan_out * num_calls));
      row = own.loss_hessian_times(VectorXd(row));
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
    int interval = 1;
    int seed = 0;

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
    const Linearization& own = OwnPart(at_x);
    const auto blocks = own.jacobian->ColumnBlocks();
    std::vector<const LayerJacobian*> layers;
    std::vector<LayerColumns> columns = J.FactorLayers();
    const bool is_sampled = !columns.empty();
    if (!is_sampled) {
      if (!FindLayers(blocks, &layers, error)) return false;
      columns = ColumnsOf(layers);
    }
    if (!CheckFinite("g", at_x.loss_gradient, error)) return false;
    VectorXd direction;
    J.TransposeTimes(at_x.loss_gradient, &direction);
    if (!CheckFinite("J^T g", direction, error)) return false;
    const bool is_zero = direction.isZero(0.0);
    const std::vector<Factors> factors =
        FactorsOf(columns, is_sampled ? J.cols() : 0);
    const long k = static_cast<long>(k_[0]);
    if (k % options_.interval == 0) {
      const long num_updates = k / options_.interval + 1;
      const double memory = std::min(
          1.0 - 1.0 / static_cast<double>(num_updates), options_.decay);
      if (!is_sampled) {
        Average(own, layers, memory, J, factors);
      } else if (!Sample(at_x, memory, factors, error)) {
        return false;
      }
    }
    k_[0] += 1.0;
    if (!Precondition(columns, factors, &direction, error)) return false;
    if (is_sampled) PreconditionOthers(columns, &direction);
    double eta = options_.step_size.step_size.value_or(0.0);
    if (options_.step_size.is_auto() && !is_zero &&
        !FindStepSize(at_x, direction, &eta, error)) {
      return false;
    }
    eta *= options_.step_size.ScheduleFactor(at_x.progress);
    *step = -eta * direction;
    report_ = fmt::format("{} layers, step size {:.2g}", columns.size(), eta);
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
    const auto add = [&](const JacobianSizes::Layer& layer, double curved) {
      const double of_layer =
          layer.fan_in * layer.fan_in + layer.fan_out * layer.fan_out;
      squares += of_layer;
      largest = std::max(largest, 2.0 * of_layer + curved);
    };
    for (const auto& layer : J.layers) {
      add(layer, layer.fan_out * J.rows / J.num_ranks);
    }
    // Random covectors, and factors before they are averaged.
    for (const auto& layer : J.sampled_layers) add(layer, 4.0 * J.rows);
    if (!J.sampled_layers.empty()) squares = 2.0 * squares + J.cols;
    std::vector<MemoryPart> parts = UpdateRule::StepMemory(J);
    parts.push_back({"factors of J",
                     J.factor_bytes / J.num_ranks + J.sampled_factor_bytes});
    parts.push_back({"averaged factors", sizeof(double) * squares});
    parts.push_back({"factorizations of a layer", sizeof(double) * largest});
    return parts;
  }

 private:
  // The averaged factors of a layer.
  struct Factors {
    Map<MatrixXd> A;
    Map<MatrixXd> D;
  };

  static std::vector<LayerColumns> ColumnsOf(
      const std::vector<const LayerJacobian*>& layers) {
    std::vector<LayerColumns> columns;
    int first = 0;
    for (const LayerJacobian* layer : layers) {
      const int size = layer->cols();
      columns.push_back(
          VectorXi::LinSpaced(size, first, first + size - 1)
              .reshaped(layer->inputs().rows(), layer->deltas().rows()));
      first += size;
    }
    return columns;
  }

  // The parts of factors_, after its first `num_others` entries.
  std::vector<Factors> FactorsOf(const std::vector<LayerColumns>& layers,
                                 Index num_others) {
    Index size = num_others;
    for (const LayerColumns& layer : layers) {
      size += layer.rows() * layer.rows() + layer.cols() * layer.cols();
    }
    if (factors_.size() == 0) factors_.setZero(size);
    CHECK_EQ(factors_.size(), size)
        << "The network has changed; use a new update rule for each run.";
    double* next = factors_.data() + num_others;
    std::vector<Factors> factors;
    for (const LayerColumns& layer : layers) {
      Map<MatrixXd> A(next, layer.rows(), layer.rows());
      next += A.size();
      Map<MatrixXd> D(next, layer.cols(), layer.cols());
      next += D.size();
      factors.push_back({A, D});
    }
    return factors;
  }

  // Sums over the ranks that share J, of which the first adds the memory.
  void Average(const Linearization& own,
               const std::vector<const LayerJacobian*>& layers,
               double memory,
               const JacobianOperator& J,
               std::vector<Factors> factors) {
    const Communicator* const ranks = J.communicator();
    const double own_memory =
        ranks == nullptr || ranks->rank() == 0 ? memory : 0.0;
    for (std::size_t l = 0; l < layers.size(); ++l) {
      const LayerJacobian& layer = *layers[l];
      const double N =
          static_cast<double>(layer.inputs().cols()) * J.rows() / layer.rows();
      Gemm(Op::kNone,
           Op::kTranspose,
           (1.0 - memory) / N,
           layer.inputs(),
           layer.inputs(),
           own_memory,
           factors[l].A);
      Gemm(Op::kNone,
           Op::kTranspose,
           1.0 - memory,
           CurvedDeltas(layer, own),
           layer.deltas(),
           own_memory,
           factors[l].D);
    }
    if (ranks != nullptr) ranks->Sum(factors_.data(), factors_.size());
  }

  bool Sample(const Linearization& at_x,
              double memory,
              std::vector<Factors> factors,
              std::string* error) {
    // A resumed run needs only k.
    VectorXd w;
    DrawCovector(at_x,
                 static_cast<std::uint32_t>(options_.seed) +
                     static_cast<std::uint32_t>(k_[0]),
                 &w);
    if (!CheckFinite("a random covector", w, error)) return false;
    SampledFactors sampled;
    at_x.jacobian->FactorsAlong(w, &sampled);
    if (!CheckFinite("J^T w", sampled.others, error)) return false;
    CHECK_EQ(sampled.layers.size(), factors.size());
    auto others = factors_.head(sampled.others.size());
    others = memory * others + (1.0 - memory) * sampled.others.cwiseAbs2();
    for (std::size_t l = 0; l < factors.size(); ++l) {
      const SampledFactors::Layer& layer = sampled.layers[l];
      factors[l].A = memory * factors[l].A + (1.0 - memory) * layer.A;
      factors[l].D = memory * factors[l].D + (1.0 - memory) * layer.D;
    }
    return true;
  }

  // Multiplies the layers' gradient by their damped inverse factors.
  bool Precondition(const std::vector<LayerColumns>& layers,
                    const std::vector<Factors>& factors,
                    VectorXd* gradient,
                    std::string* error) const {
    for (std::size_t l = 0; l < layers.size(); ++l) {
      const auto columns = layers[l].reshaped();
      MatrixXd G =
          (*gradient)(columns).reshaped(layers[l].rows(), layers[l].cols());
      if (!PreconditionLayer(factors[l].A, factors[l].D, &G)) {
        *error = fmt::format(
            "layer {}: a damped factor is not positive definite; a larger "
            "damping may help",
            l);
        return false;
      }
      (*gradient)(columns) = G.reshaped();
    }
    return true;
  }

  // The weights of no layer.
  void PreconditionOthers(const std::vector<LayerColumns>& layers,
                          VectorXd* gradient) const {
    VectorXd others =
        factors_.head(gradient->size()).array() + options_.damping;
    for (const LayerColumns& layer : layers) others(layer.reshaped()).setOnes();
    // Without damping, a weight without influence stays.
    for (Index i = 0; i < others.size(); ++i) {
      if ((*gradient)[i] != 0.0) (*gradient)[i] /= others[i];
    }
  }

  bool PreconditionLayer(const Eigen::Ref<const MatrixXd>& A,
                         const Eigen::Ref<const MatrixXd>& D,
                         MatrixXd* G) const {
    const double mean_A = A.trace() / static_cast<double>(A.rows());
    const double mean_D = D.trace() / static_cast<double>(D.rows());
    // Without a trace there is nothing to balance.
    const double pi =
        mean_A > 0.0 && mean_D > 0.0 ? std::sqrt(mean_A / mean_D) : 1.0;
    const double damping = std::sqrt(options_.damping);
    if (G->isZero(0.0)) return true;  // a dead layer has no curvature
    if (!SolveDamped(A, pi * damping, G)) return false;
    G->transposeInPlace();
    if (!SolveDamped(D, damping / pi, G)) return false;
    G->transposeInPlace();
    return true;
  }

  bool FindStepSize(const Linearization& at_x,
                    const VectorXd& direction,
                    double* eta,
                    std::string* error) const {
    AlongDirection model;
    if (!ModelAlong(at_x, -direction, &model, error)) return false;
    const double length = direction.norm() / model.unit;
    model.damping = options_.damping * length * length;
    return AutoStepSize(model, options_.step_size.rho, eta, error);
  }

  const Options options_;
  VectorXd factors_;  // sampled: d; A and D of each layer
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
