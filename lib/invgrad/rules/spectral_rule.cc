// Applies a spectral filter of J to the loss gradient: of all of J, or of the
// columns of one layer at a time.
//
//   step = -eta V phi(S) U^T g,             J = U S V^T,   g = dL/dy     [1]
//   step_l = -eta V_l phi(S_l) U_l^T g,     J_l = U_l S_l V_l^T    (layerwise)
//
// The rows at the end of this file differ in their defaults. Every row has the
// settings truncation and damping of the filter (spectral.h); with
// control=gain, kappa, lambda or both follow the gain (gain_control.h) and
// start from the row's values.
//
// The J_l are the column blocks of J (layered_jacobian.h): a network's layers,
// or the parameter blocks of a ceres::Problem that are not constant. The rule
// neglects the coupling between blocks: if each of L layers can correct the
// outputs, the sum of their full steps (kappa = 1) overshoots L times. If J has
// no column blocks, J is the only block.
//
// Shapes:  g: m;  J: m x n;  step: n.
// Units:   (g, J) -> c (g, J) multiplies the step by c^(1 - kappa): the
//          half-inverse step depends on the units of y, on a factor 1/2 in the
//          loss, and on sum or mean over a batch. damping has the units of s^2.
// Cost:    one spectral step, see spectral.h; step_size=auto adds two
//          products. Layerwise: one step for each layer, of size min(m, n_l).
//          This is cheaper than the joint step if most layers have n_l < m
//          (large batches): n_l^3 each instead of min(m, n)^3. For n_l >= m it
//          is L times the work.
// Fails:   returns false if g, J or the step is not finite, if a factorization
//          does not converge, or if there is no automatic step size.
//
// [1] Schnell, Holl, Thuerey. Half-Inverse Gradients for Physical Deep
//     Learning. ICLR 2022. arXiv 2203.10131. Its eta is 1 for the oscillators.
#include <algorithm>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "fmt/core.h"
#include "invgrad/internal/layered_jacobian.h"
#include "invgrad/rules/joint_rule.h"
#include "invgrad/rules/rule_rows.h"
#include "invgrad/spectral.h"

namespace invgrad {
namespace {

// Summarizes the steps of all blocks.
struct Totals {
  std::map<SpectralRoute, int> num_blocks;
  int rank = 0;
  int max_rank = 0;
  int num_undecided = 0;
  std::string message;  // the first

  void Add(const JacobianOperator& J, const SpectralStepSummary& summary) {
    ++num_blocks[summary.route];
    if (summary.route != SpectralRoute::kGradient) {
      rank += summary.rank;
      max_rank += std::min(J.rows(), J.cols());
    }
    num_undecided += summary.num_undecided;
    if (message.empty()) message = summary.message;
  }

  // "route gram, rank 97 of 128", "route gram 3, svd 1, rank 211 of 300".
  std::string Report() const {
    const bool single =
        num_blocks.size() == 1 && num_blocks.begin()->second == 1;
    std::string report;
    for (const auto& [route, count] : num_blocks) {
      report += report.empty() ? "route " : ", ";
      report += SpectralRouteName(route);
      if (!single) report += fmt::format(" {}", count);
    }
    if (max_rank > 0) report += fmt::format(", rank {} of {}", rank, max_rank);
    if (num_undecided > 0) {
      report += fmt::format(", {} undecided", num_undecided);
    }
    if (!message.empty()) report += fmt::format(" ({})", message);
    return report;
  }
};

class SpectralRule final : public JointRule {
 public:
  struct Options : JointRule::Options {
    bool layerwise = false;  // selects the rule; not a setting
    std::string route = SpectralRouteName(SpectralRoute::kAuto);
    SpectralStepOptions step = SpectralStepOptions::ForTraining();

    void Describe(OptionSet* set) {
      constexpr double kInfinity = std::numeric_limits<double>::infinity();
      JointRule::Options::Describe(set);
      std::vector<std::string> names;
      for (const SpectralRoute candidate : kGeneralSpectralRoutes) {
        names.emplace_back(SpectralRouteName(candidate));
      }
      set->Add("route", &route, names, "how the step is computed");
      set->Add("tolerance",
               &step.tolerance,
               {0.0, kInfinity, true},
               "largest estimated relative error of a step by the Gram matrix");
      set->Add("threshold_tolerance",
               &step.threshold_tolerance,
               {0.0, kInfinity},
               "largest relative error of its truncation");
    }
  };

  explicit SpectralRule(const Options& options)
      : JointRule(options),
        layerwise_(options.layerwise),
        options_(options.step) {
    for (const SpectralRoute candidate : kGeneralSpectralRoutes) {
      if (options.route == SpectralRouteName(candidate)) {
        options_.route = candidate;
      }
    }
  }

  // Includes the routes' histories, which choose the next step's routes.
  std::vector<Eigen::VectorXd*> MutableState() override {
    std::vector<Eigen::VectorXd*> state = JointRule::MutableState();
    state.push_back(&histories_);
    return state;
  }

  LinearizationParts Needs() const override {
    LinearizationParts parts = JointRule::Needs();
    parts.factorization = !joint_options().filter.IsGradientDescent();
    return parts;
  }

 private:
  bool ComputeDirection(const Linearization& at_x,
                        const SpectralFilter& filter,
                        Eigen::VectorXd* direction,
                        std::string* report,
                        std::string* error) override {
    const JacobianOperator& J = *at_x.jacobian;
    std::vector<std::unique_ptr<const JacobianOperator>> blocks;
    if (layerwise_) blocks = ColumnBlocksOf(J);
    const std::size_t num_blocks = std::max<std::size_t>(1, blocks.size());
    constexpr Eigen::Index kHistory = SpectralWorkspace::kHistorySize;
    if (histories_.size() != kHistory * static_cast<Eigen::Index>(num_blocks)) {
      histories_.setZero(kHistory * num_blocks);
    }
    direction->resize(J.cols());
    Totals totals;
    Eigen::Index column = 0;
    for (std::size_t i = 0; i < num_blocks; ++i) {
      const JacobianOperator& block = blocks.empty() ? J : *blocks[i];
      // The tangent space of a parameter block may have dimension zero.
      if (block.cols() == 0) continue;
      workspace_.history = histories_.segment<kHistory>(kHistory * i);
      SpectralStepSummary summary;
      if (!SpectralStep(block,
                        at_x.loss_gradient,
                        filter,
                        options_,
                        &workspace_,
                        &d_,
                        &summary)) {
        *error =
            num_blocks == 1
                ? summary.message
                : fmt::format("columns from {}: {}", column, summary.message);
        return false;
      }
      histories_.segment<kHistory>(kHistory * i) = workspace_.history;
      direction->segment(column, d_.size()) = d_;
      column += d_.size();
      totals.Add(block, summary);
    }
    *report = totals.Report();
    return true;
  }

  const bool layerwise_;
  SpectralStepOptions options_;
  SpectralWorkspace workspace_;
  Eigen::VectorXd histories_;  // one per block, zero before the first step
  Eigen::VectorXd d_;          // of a block
};

}  // namespace

std::vector<RuleRow> SpectralRuleRows() {
  const SpectralRule::Options power;
  SpectralRule::Options half_inverse;
  half_inverse.kappa_is_a_setting = false;
  SpectralRule::Options gauss_newton = half_inverse;
  gauss_newton.filter.kappa = 1.0;
  SpectralRule::Options levenberg_marquardt = half_inverse;
  levenberg_marquardt.filter = SpectralFilter::LevenbergMarquardt(0.0, 1e-3);
  levenberg_marquardt.control.adapts = "damping";
  SpectralRule::Options layer_half_inverse;
  layer_half_inverse.layerwise = true;
  return {
      MakeRuleRow<SpectralRule>(
          "power", "step = -eta V S^(-kappa) U^T g, s > tau s_max", power),
      MakeRuleRow<SpectralRule>("half_inverse",
                                "step = -eta V S^(-1/2) U^T g, s > tau s_max",
                                half_inverse),
      MakeRuleRow<SpectralRule>("gauss_newton",
                                "step = -eta V S^-1 U^T g, s > tau s_max",
                                gauss_newton),
      MakeRuleRow<SpectralRule>("levenberg_marquardt",
                                "step = -eta V S / (S^2 + lambda) U^T g",
                                levenberg_marquardt),
      MakeRuleRow<SpectralRule>("layer_half_inverse",
                                "step_l = -eta V_l S_l^(-kappa) U_l^T g, "
                                "s > tau s_max of the layer's columns of J",
                                layer_half_inverse),
  };
}

}  // namespace invgrad
