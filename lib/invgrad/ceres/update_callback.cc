#include "invgrad/update_callback.h"

#include <algorithm>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <tuple>
#include <utility>

#include "fmt/core.h"
#include "invgrad/ceres/bounds.h"
#include "invgrad/ceres/domain_failure.h"
#include "invgrad/ceres/problem_linearizer.h"
#include "invgrad/ceres/proposal.h"
#include "invgrad/ceres/solve_with_proposals.h"
#include "invgrad/ceres/staged_step.h"
#include "invgrad/ceres/work_limit.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/model_decrease.h"

namespace invgrad {

// What several solves share.
class UpdateCallback::State {
 public:
  State(const Options& options, Proposer proposer, ceres::Problem* problem)
      : options_(Resolved(options)),
        proposer_(std::move(proposer)),
        problem_(problem),
        linearizer_(problem, {{}, true, options.evaluation_callback, true}) {
    std::string error;
    CHECK(StagedStep::IsSupported(
        options_.max_block_size, linearizer_.structure(), &error))
        << error;
    staged_.emplace(
        linearizer_.structure(), options_.manifold_ownership, problem);
  }

  void AddTo(ceres::Solver::Options* options) {
    Remove(options);
    summary_ = Summary();
    staged_->Clear();  // a step of the last solve, which owns it
    solve_.reset();
    has_begun_ = false;
    if (!options->IsValid(&summary_.message)) {  // Ceres refuses them
      staged_->Unwrap();
      return;
    }
    const WorkLimit work(
        options_.max_relative_work,
        options_.compare_with_plain,
        proposer_.Needs(),
        proposer_.rule == nullptr ? options_.iterations_of_function : 0.0,
        *options,
        linearizer_.structure());
    if (!work.IsStepPossible()) {
      // The solve is then the one without a callback.
      summary_.message = work.Message();
      staged_->Unwrap();
      return;
    }
    auto& entry = entries_[TolerancesOf(*options)];
    if (entry == nullptr) entry = std::make_unique<Entry>(this);
    staged_->Wrap();
    bounds_.emplace(*problem_, linearizer_.structure());
    solve_.emplace(options_,
                   work,
                   proposer_,
                   &*bounds_,
                   problem_,
                   &linearizer_,
                   &*staged_,
                   options);
    options->callbacks.push_back(entry.get());
    options->update_state_every_iteration = true;
  }

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) {
    if (iteration.iteration == 0 && has_begun_) {
      summary_.message =
          "call UpdateCallback::AddTo before each solve, again for a second "
          "one";
      LOG(ERROR) << summary_.message;
      solve_.reset();
    }
    if (!solve_) return ceres::SOLVER_ABORT;
    has_begun_ = true;
    return (*solve_)(iteration);
  }

  Summary summary() const {
    Summary summary = solve_ ? solve_->summary() : summary_;
    // Ceres calls no callback if it cannot evaluate the problem at the start.
    DomainFailure failure;
    if (!has_begun_ &&
        ExplainInvalidStart({options_.block_name, options_.evaluation_callback},
                            linearizer_.structure(),
                            &failure)) {
      summary.num_outside_domain = 1;
      summary.first_outside_domain = std::move(failure);
    }
    return summary;
  }

 private:
  static Options Resolved(Options options) {
    if (options.only_proposals) {
      options.by_merit = false;
      options.compare_with_plain = false;
      options.max_relative_work = std::numeric_limits<double>::infinity();
    }
    return options;
  }

  // What SolveWithProposals changes in the options.
  using Tolerances = std::tuple<double, double, double, int>;
  static Tolerances TolerancesOf(const ceres::Solver::Options& options) {
    return {options.function_tolerance,
            options.gradient_tolerance,
            options.parameter_tolerance,
            options.max_num_line_search_step_size_iterations};
  }

  // What stands among the callbacks of options, and of their copies.
  class Entry final : public ceres::IterationCallback {
   public:
    explicit Entry(State* state) : state_(*state) {}
    ceres::CallbackReturnType operator()(
        const ceres::IterationSummary& iteration) override {
      return state_(iteration);
    }

   private:
    State& state_;
  };

  static void Restore(const Tolerances& tolerances,
                      ceres::Solver::Options* options) {
    const auto restore = [](auto value, auto* option) {
      if (*option == 0) *option = value;
    };
    const auto& [function, gradient, parameter, line_search] = tolerances;
    restore(function, &options->function_tolerance);
    restore(gradient, &options->gradient_tolerance);
    restore(parameter, &options->parameter_tolerance);
    restore(line_search, &options->max_num_line_search_step_size_iterations);
  }

  // Takes back what an earlier AddTo did to these options, or to those that they
  // are a copy of.
  void Remove(ceres::Solver::Options* options) {
    auto& callbacks = options->callbacks;
    for (const auto& [tolerances, entry] : entries_) {
      const auto found =
          std::find(callbacks.begin(), callbacks.end(), entry.get());
      if (found == callbacks.end()) continue;
      callbacks.erase(found);
      Restore(tolerances, options);
      return;
    }
  }

  const Options options_;
  const Proposer proposer_;
  ceres::Problem* problem_;
  ProblemLinearizer linearizer_;
  std::optional<Bounds> bounds_;  // at the last AddTo
  std::optional<StagedStep> staged_;
  // One for all options that had the same tolerances.
  std::map<Tolerances, std::unique_ptr<Entry>> entries_;
  std::optional<SolveWithProposals> solve_;  // none: no proposals
  bool has_begun_ = false;                   // solve_
  Summary summary_;                          // without solve_
};

bool UpdateCallback::IsSupported(const Options& options,
                                 const ceres::Problem& problem,
                                 std::string* error) {
  return StagedStep::IsSupported(
      options.max_block_size, ReadStructure(problem, {}), error);
}

UpdateCallback::UpdateCallback(UpdateRule* rule, ceres::Problem* problem)
    : UpdateCallback(rule, problem, Options()) {}

UpdateCallback::UpdateCallback(UpdateRule* rule,
                               ceres::Problem* problem,
                               const Options& options) {
  CHECK(rule != nullptr)
      << "MakeRule(specification, &error) returns no rule for an invalid "
         "specification; its error gives the reason.";
  CHECK(problem != nullptr);
  state_ = std::make_unique<State>(options, Proposer{rule, nullptr}, problem);
}

UpdateCallback::UpdateCallback(ProposalFunction function,
                               ceres::Problem* problem)
    : UpdateCallback(std::move(function), problem, Options()) {}

UpdateCallback::UpdateCallback(ProposalFunction function,
                               ceres::Problem* problem,
                               const Options& options) {
  CHECK(function != nullptr) << "The proposal function is empty.";
  CHECK(problem != nullptr);
  state_ = std::make_unique<State>(
      options, Proposer{nullptr, std::move(function)}, problem);
}

UpdateCallback::~UpdateCallback() = default;

void UpdateCallback::AddTo(ceres::Solver::Options* options) {
  CHECK(options != nullptr);
  state_->AddTo(options);
}

UpdateCallback::Summary UpdateCallback::summary() const {
  return state_->summary();
}

std::string UpdateCallback::Summary::BriefReport() const {
  std::string report =
      fmt::format("{} proposed, {} accepted, {} rejected, {} steps of Ceres",
                  num_proposed,
                  num_accepted,
                  num_rejected,
                  num_ceres_steps);
  if (num_withheld > 0) report += fmt::format("; {} withheld", num_withheld);
  if (num_outside_domain > 0) {
    report += fmt::format("; {} outside the domain", num_outside_domain);
    if (first_outside_domain) report += ": " + first_outside_domain->ToText();
  }
  if (num_proposed == 0 && !message.empty()) report += "; " + message;
  if (ended_on_proposal) report += "; the run ended on a proposal";
  report += NoMinimumText(predicted_decrease);
  // After good steps Ceres widens the region, whether or not it was the limit;
  // but where it is not, a few steps of Gauss-Newton are enough.
  constexpr int kLeastSteps = 8;
  const int num_steps =
      num_plain_iterations > 0 ? num_plain_iterations : num_ceres_steps;
  if (num_limited_steps >= kLeastSteps &&
      4 * num_limited_steps >= 3 * num_steps) {
    report += fmt::format(
        "; Ceres widened the trust region after {} of {} steps: a larger "
        "initial_trust_region_radius may save some",
        num_limited_steps,
        num_steps);
  }
  if (took_plain_result) {
    report += "; the result is that of the solve without proposals";
  }
  return report;
}

}  // namespace invgrad
