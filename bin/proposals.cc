/*
Counts what proposals of each rule change inside ceres::Solve: 19 problems of
More, Garbow and Hillstrom (or the ten of them that have bounds), three starts
each, from several trust regions.

  lost     solved by Levenberg-Marquardt alone, not with proposals
  gained   the reverse
  work     iterations of the run and of the comparison beside it, over the
           iterations of Levenberg-Marquardt alone: the median of all runs

Sample runs:

  proposals
  proposals --rules=half_inverse:step_size=auto:rho=1 --radii=1e4 \
    --tolerance=1e-14
  proposals --bounded
*/

#include <algorithm>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "bin/support/program.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/core/specification.h"
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"
#include "problems/more_garbow_hillstrom.h"
#include "report/table.h"

DEFINE_string(rules,
              "",
              "update rules, name[:key=value...],...; empty: all of them");
DEFINE_string(radii, "1,1e2,1e4,1e6", "initial radii of the trust region");
DEFINE_double(tolerance,
              0.0,
              "all three tolerances of Ceres; 0: Ceres' defaults");
DEFINE_bool(bounded, false, "the ten problems with bounds, not all without");
DEFINE_bool(compare,
            true,
            "whether the callback compares with the solve without proposals");

namespace invgrad {
namespace {

constexpr int kMaxNumIterations = 1000;

struct Outcome {
  bool is_solved = false;
  int num_iterations = 0;  // the comparison's included
};

// Solves from factor * start; rule_text = null: without proposals.
Outcome Solve(const MoreGarbowHillstromRow& row,
              double factor,
              double radius,
              const Specification* rule_text) {
  std::vector<double> x = row.start;
  for (double& value : x) value *= factor;
  const std::unique_ptr<ceres::Problem> problem =
      MakeMoreGarbowHillstrom(row, &x);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = kMaxNumIterations;
  options.initial_trust_region_radius = radius;
  options.logging_type = ceres::SILENT;
  if (FLAGS_tolerance > 0.0) {
    options.function_tolerance = FLAGS_tolerance;
    options.gradient_tolerance = FLAGS_tolerance;
    options.parameter_tolerance = FLAGS_tolerance;
  }
  ceres::Solver::Summary summary;
  Outcome outcome;
  if (rule_text == nullptr) {
    ceres::Solve(options, problem.get(), &summary);
  } else {
    std::string error;
    const std::unique_ptr<UpdateRule> rule = MakeRule(*rule_text, &error);
    UpdateCallback::Options callback_options;
    callback_options.compare_with_plain = FLAGS_compare;
    UpdateCallback callback(rule.get(), problem.get(), callback_options);
    callback.AddTo(&options);
    ceres::Solve(options, problem.get(), &summary);
    outcome.num_iterations = callback.summary().num_plain_iterations;
  }
  outcome.num_iterations += static_cast<int>(summary.iterations.size()) - 1;
  outcome.is_solved = summary.IsSolutionUsable() &&
                      IsSolution(row, SumOfSquares(problem.get()));
  return outcome;
}

// All problems, starts and radii, in one order.
std::vector<Outcome> SolveAll(const std::vector<double>& radii,
                              const Specification* rule_text) {
  std::vector<Outcome> outcomes;
  const auto& rows =
      FLAGS_bounded ? BoundedMoreGarbowHillstrom() : MoreGarbowHillstrom();
  for (const double radius : radii) {
    for (const MoreGarbowHillstromRow& row : rows) {
      for (const double factor : {1.0, 10.0, 100.0}) {
        outcomes.push_back(Solve(row, factor, radius, rule_text));
      }
    }
  }
  return outcomes;
}

bool Run(RunCounts* /*counts*/, std::string* error) {
  std::vector<Specification> rules;
  std::vector<double> radii;
  if (!CheckFlags({{"tolerance", {0.0, 1.0}}}, error) ||
      !ParseFlag("radii", ParseNumbers, &radii, error) ||
      (!FLAGS_rules.empty() &&
       !ParseFlag("rules", ParseSpecifications, &rules, error))) {
    return false;
  }
  if (FLAGS_rules.empty()) {
    for (const RuleRow& row : Rules()) {
      rules.push_back({row.name, row.name, {}});
    }
  }
  for (const Specification& rule : rules) {
    if (!NameFlag("rules", MakeRule(rule, error) != nullptr, error)) {
      return false;
    }
  }
  if (radii.empty()) {
    *error = "--radii: expected a number";
    return false;
  }
  const std::vector<Outcome> plain = SolveAll(radii, nullptr);
  const auto num_solved = [](const std::vector<Outcome>& outcomes) {
    return std::count_if(
        outcomes.begin(), outcomes.end(), [](const Outcome& outcome) {
          return outcome.is_solved;
        });
  };
  Table table({{"rule", Table::Align::kLeft},
               {"solved"},
               {"lost"},
               {"gained"},
               {"work"}});
  table.AddRow({"none",
                fmt::format("{} of {}", num_solved(plain), plain.size()),
                "",
                "",
                "1"});
  for (const Specification& rule : rules) {
    const std::vector<Outcome> outcomes = SolveAll(radii, &rule);
    int num_lost = 0;
    int num_gained = 0;
    std::vector<double> work;
    for (std::size_t i = 0; i < outcomes.size(); ++i) {
      num_lost += plain[i].is_solved && !outcomes[i].is_solved;
      num_gained += !plain[i].is_solved && outcomes[i].is_solved;
      work.push_back(static_cast<double>(outcomes[i].num_iterations) /
                     std::max(plain[i].num_iterations, 1));
    }
    std::nth_element(work.begin(), work.begin() + work.size() / 2, work.end());
    table.AddRow({rule.text,
                  fmt::format("{} of {}", num_solved(outcomes), plain.size()),
                  fmt::format("{}", num_lost),
                  fmt::format("{}", num_gained),
                  fmt::format("{:.3g}", work[work.size() / 2])});
  }
  std::cout << table.ToText();
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgram(
      argc,
      argv,
      "counts what proposals of rules change inside ceres::Solve",
      invgrad::Run);
}
