#include "invgrad/rules/spectral_rule.h"

#include <algorithm>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "fmt/core.h"

namespace invgrad {
namespace {

// Summarizes the reports of the steps of all blocks.
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
    return report;
  }
};

}  // namespace

SpectralRule::Options SpectralRule::Options::Power() { return Options(); }

SpectralRule::Options SpectralRule::Options::HalfInverse() {
  Options options;
  options.kappa_is_a_setting = false;
  return options;
}

SpectralRule::Options SpectralRule::Options::GaussNewton() {
  Options options;
  options.filter.kappa = 1.0;
  options.kappa_is_a_setting = false;
  return options;
}

SpectralRule::Options SpectralRule::Options::LayerHalfInverse() {
  Options options;
  options.layerwise = true;
  return options;
}

SpectralRule::Options SpectralRule::Options::AdaptivePower() {
  Options options;
  options.step_size.step_size = std::nullopt;  // auto
  options.control.control = "gain";
  return options;
}

SpectralRule::Options SpectralRule::Options::LevenbergMarquardt() {
  Options options;
  options.filter = SpectralFilter::LevenbergMarquardt(0.0, 1e-3);
  options.control.adapts = "damping";
  options.kappa_is_a_setting = false;
  return options;
}

void SpectralRule::Options::Describe(OptionSet* set) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  DescribeJoint(set);
  std::vector<std::string> names;
  for (const SpectralRoute candidate : GeneralSpectralRoutes()) {
    names.emplace_back(SpectralRouteName(candidate));
  }
  set->Add("route", &route, names, "how the step is computed");
  set->Add("tolerance",
           &tolerance,
           {0.0, kInfinity, true},
           "largest estimated relative error of a step by the Gram matrix");
  set->Add("threshold_tolerance",
           &threshold_tolerance,
           {0.0, kInfinity},
           "largest relative error of its truncation");
}

SpectralRule::SpectralRule(const Options& options)
    : JointRule(options), layerwise_(options.layerwise) {
  CheckOptions(options);
  spectral_options_.tolerance = options.tolerance;
  spectral_options_.threshold_tolerance = options.threshold_tolerance;
  for (const SpectralRoute candidate : GeneralSpectralRoutes()) {
    if (options.route == SpectralRouteName(candidate)) {
      spectral_options_.route = candidate;
    }
  }
}

std::vector<Eigen::VectorXd*> SpectralRule::MutableState() {
  std::vector<Eigen::VectorXd*> state = JointRule::MutableState();
  state.push_back(&histories_);
  return state;
}

std::vector<MemoryPart> SpectralRule::StepMemory(const JacobianSizes& J) const {
  const auto of_step = [this](double rows, double cols) -> MemoryPart {
    SpectralRoute route = spectral_options_.route;
    std::string name = "route ";
    if (route == SpectralRoute::kAuto) {
      // SpectralStep checks the memory again before it uses a route that needs
      // more.
      name = "at least route ";
      route = joint_options().filter.IsGradientDescent()
                  ? SpectralRoute::kGradient
                  : SpectralRoute::kGram;
    }
    return {name + SpectralRouteName(route),
            SpectralStepBytes(route,
                              static_cast<Eigen::Index>(rows),
                              static_cast<Eigen::Index>(cols))};
  };
  MemoryPart step;
  if (layerwise_ && !J.layers.empty()) {
    // The layers' steps are computed one after the other, in the same memory.
    for (const JacobianSizes::Layer& layer : J.layers) {
      const MemoryPart part = of_step(J.rows, layer.fan_in * layer.fan_out);
      if (part.bytes > step.bytes) step = part;
    }
  } else {
    step = of_step(J.rows, J.cols);
  }
  std::vector<MemoryPart> parts = UpdateRule::StepMemory(J);
  parts.push_back(step);
  parts.push_back({"factors of J", J.factor_bytes});
  return parts;
}

bool SpectralRule::ComputeDirection(const Linearization& at_x,
                                    const SpectralFilter& filter,
                                    Eigen::VectorXd* direction,
                                    std::string* report,
                                    std::string* error) {
  const JacobianOperator& J = *at_x.jacobian;
  std::vector<std::unique_ptr<const JacobianOperator>> column_blocks;
  if (layerwise_) column_blocks = J.ColumnBlocks();
  std::vector<const JacobianOperator*> blocks;
  blocks.reserve(column_blocks.size());
  for (const auto& block : column_blocks) blocks.push_back(block.get());
  if (blocks.empty()) blocks.push_back(&J);

  direction->resize(J.cols());
  Totals totals;
  Eigen::Index column = 0;
  constexpr Eigen::Index kHistory = SpectralWorkspace::kHistorySize;
  const auto num_blocks = static_cast<Eigen::Index>(blocks.size());
  if (histories_.size() != kHistory * num_blocks) {
    histories_.setZero(kHistory * num_blocks);
  }
  Eigen::Index index = -1;
  for (const JacobianOperator* block : blocks) {
    ++index;
    // The tangent space of a parameter block may have dimension zero.
    if (block->cols() == 0) continue;
    workspace_.history = histories_.segment(kHistory * index, kHistory);
    SpectralStepSummary summary;
    if (!SpectralStep(*block,
                      at_x.loss_gradient,
                      filter,
                      spectral_options_,
                      &workspace_,
                      &d_,
                      &summary)) {
      *error = summary.message;
      if (blocks.size() > 1) {
        *error = fmt::format("columns from {}: {}", column, *error);
      }
      return false;
    }
    histories_.segment(kHistory * index, kHistory) = workspace_.history;
    direction->segment(column, d_.size()) = d_;
    column += d_.size();
    totals.Add(*block, summary);
  }
  *report = totals.Report();
  if (!totals.message.empty()) *report += " (" + totals.message + ")";
  return true;
}

}  // namespace invgrad
