// Gauss-Newton on the directions that the residuals determine; the others are
// left alone.
//
//   A = J D^-1 = U S V^T,   step = -eta D^-1 V S^-1 U^T g,   s > tau s_max
//
// D, the groups, the threshold and the hysteresis are those of
// determined_step.h: the threshold has no unit.
//
//   groups=columns   every unknown has a scale of its own
//   groups=blocks    one scale for each parameter block of a ceres::Problem, or
//                    each layer: for blocks whose entries have one unit and one
//                    coordinate frame, such as a position, or a rotation with a
//                    manifold
//
// LastStepReport lists what was left alone: s / s_max, and the motion by the
// unknowns' positions, in their units.
//
// Shapes:  as linearization.h. H_L counts as c I; step_size=auto finds 1 / c.
// Cost:    J^T J (m n^2), and 25 n^3; 6 n^2 doubles.
// Fails:   returns false if J or g is not finite, or if there is no automatic
//          step size. tau is at least 1e-6, because J^T J has the squares of
//          the singular values.
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/finite.h"
#include "invgrad/determined_step.h"
#include "invgrad/internal/layered_jacobian.h"
#include "invgrad/internal/logging.h"
#include "invgrad/rules/rule_rows.h"
#include "invgrad/rules/step_size.h"
#include "invgrad/stored_jacobian.h"

namespace invgrad {
namespace {

class DeterminedRule final : public UpdateRule {
 public:
  struct Options {
    StepSizeOptions step_size;
    // The weak threshold of the rank report.
    double truncation = 1e-4;
    double release = std::sqrt(2.0);
    std::string groups = "columns";

    void Describe(OptionSet* set) {
      step_size.Describe(/*allow_auto=*/true, set);
      set->Add("truncation",
               &truncation,
               {1e-6, 0.5},
               "tau: directions with s <= tau s_max are left alone");
      set->Add("release",
               &release,
               {1.0, 2.0},
               "of a direction that was left alone: above this multiple of tau "
               "it is determined again");
      set->Add("groups",
               &groups,
               {"columns", "blocks"},
               "the unknowns that share a scale");
    }
  };

  explicit DeterminedRule(const Options& options) : options_(options) {}

  LinearizationParts Needs() const override {
    LinearizationParts parts = LinearizationParts::Jacobian();
    parts.progress = options_.step_size.has_schedule();
    parts.factorization = true;
    parts.by_parameter_gram = true;
    parts.num_squares = 4;
    return parts;
  }
  std::vector<Eigen::VectorXd*> MutableState() override { return {&memory_}; }
  std::string LastStepReport() const override { return report_; }

  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) override {
    const JacobianOperator& J = *at_x.jacobian;
    const Eigen::VectorXd& g = at_x.loss_gradient;
    CHECK_EQ(g.size(), J.rows());
    if (!CheckFinite("the gradient of the loss in y", g, error)) return false;
    Begin(J);
    J.ParameterGram(&gram_);
    J.TransposeTimes(g, &gradient_);
    if (memory_.size() > 0) {
      determined_->SetMemory(Eigen::Map<const Eigen::MatrixXd>(
          memory_.data(), J.cols(), memory_.size() / J.cols()));
    } else {
      determined_->Reset();
    }
    if (!determined_->Compute(gram_, gradient_, step, error)) return false;
    memory_ = determined_->left_alone().reshaped();
    report_ = determined_->Report();

    const StepSizeOptions& options = options_.step_size;
    double eta = options.step_size.value_or(1.0);
    if (options.is_auto() && !step->isZero(0.0)) {
      AlongDirection model;
      if (!ModelAlong(at_x, *step, &model, error)) return false;
      if (model.IsAtMinimum()) {
        step->setZero();
      } else if (!AutoStepSize(model, options.rho, &eta, error)) {
        return false;
      }
    }
    *step *= eta * options.ScheduleFactor(at_x.progress);
    return CheckFinite("the step", *step, error);
  }

 private:
  // Of a stored J, as of a ceres::Problem; else null.
  static const std::vector<int>* StoredSizes(const JacobianOperator& J) {
    if (const auto* dense = dynamic_cast<const DenseJacobian*>(&J)) {
      return &dense->block_sizes();
    }
    const auto* sparse = dynamic_cast<const SparseJacobian*>(&J);
    return sparse == nullptr ? nullptr : &sparse->block_sizes();
  }

  // Begins again if the unknowns are others than those of the last step.
  void Begin(const JacobianOperator& J) {
    const std::vector<int>* const stored = StoredSizes(J);
    if (determined_.has_value() && num_unknowns_ == J.cols() &&
        (stored == nullptr || *stored == stored_sizes_)) {
      return;
    }
    stored_sizes_ = stored == nullptr ? std::vector<int>() : *stored;
    // The memory is of other unknowns, or of a checkpoint.
    if (determined_.has_value()) memory_.resize(0);
    num_unknowns_ = J.cols();
    DeterminedStepOptions options;
    options.tau = options_.truncation;
    options.tau_high = std::min(options_.truncation * options_.release, 1.0);
    if (options_.groups == "blocks") {
      for (const auto& block : ColumnBlocksOf(J)) {
        if (block->cols() > 0) options.group_sizes.push_back(block->cols());
      }
    }
    determined_.emplace(options);
  }

  const Options options_;
  int num_unknowns_ = 0;
  std::vector<int> stored_sizes_;
  std::optional<DeterminedStepOfAnySize> determined_;
  Eigen::VectorXd memory_;  // the motions left alone, one after the other
  Eigen::MatrixXd gram_;    // lower triangle
  Eigen::VectorXd gradient_;
  std::string report_;
};

}  // namespace

std::vector<RuleRow> DeterminedRuleRows() {
  return {MakeRuleRow<DeterminedRule>(
      "determined",
      "step = -eta D^-1 V S^-1 U^T g, J D^-1 = U S V^T, s > tau s_max; the "
      "other directions are left alone")};
}

}  // namespace invgrad
