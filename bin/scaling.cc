/*
Shows how the first step of each rule scales with the loss and with units.

  L = c (y_0 + y_1),   y = (u_0 x_0, u_1 x_1)

The first column is p if the step is proportional to c^p. The other columns are
the exponents of the step along x_0 when the unit of x_0 changes, and when only
the unit of x_1 changes: the last exponent is not zero if a rule mixes units.

Sample runs:

  scaling
  scaling --rules=adam,half_inverse,power:kappa=0.75
*/

#include <cmath>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "bin/support/program.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/core/hessian_times.h"
#include "invgrad/minimize/chain_objective.h"
#include "invgrad/rules/rules.h"
#include "problems/problems.h"
#include "report/table.h"

DEFINE_string(rules,
              "",
              "update rules, name[:key=value...],...; empty: all of them");

namespace invgrad {
namespace {

// The first step, with step size one unless the rule specifies another one.
bool FirstStep(const Specification& rule_text,
               double c,
               double unit_0,
               double unit_1,
               Eigen::VectorXd* step,
               std::string* error) {
  PhysicsProblem problem;
  const std::string text =
      fmt::format("linear_scale:c={}:unit_0={}:unit_1={}", c, unit_0, unit_1);
  const std::unique_ptr<UpdateRule> rule = MakeRule(rule_text, error);
  if (rule == nullptr || !CreateProblem(text, nullptr, &problem, error)) {
    return false;
  }
  ChainObjective objective = problem.point->MakeObjective();
  Linearization at_start;
  if (!objective.Linearize(rule->Needs(), &at_start, error)) return false;
  AddProductsAndTrials(
      rule->Needs(), objective.State(), AfterOf(&objective), &at_start);
  return rule->ComputeStep(at_start, step, error);
}

// p in |a / b| = 2^p.
std::string Exponent(double a, double b) {
  const double exponent = std::log2(std::abs(a / b));
  // Maps minus zero and rounding errors to zero.
  return fmt::format("{:.3g}", std::abs(exponent) < 1e-6 ? 0.0 : exponent);
}

bool Run(RunCounts* /*counts*/, std::string* error) {
  std::vector<Specification> rules;
  if (!FLAGS_rules.empty() &&
      !ParseFlag("rules", ParseSpecifications, &rules, error)) {
    return false;
  }
  if (FLAGS_rules.empty()) {
    for (const RuleRow& row : Rules()) {
      rules.push_back({row.name, row.name, {}});
    }
  }
  std::string refusals;
  Table table({{"rule", Table::Align::kLeft},
               {"loss x 2: step x 2^"},
               {"unit of x_0 x 2: its step x 2^"},
               {"unit of x_1 x 2: step of x_0 x 2^"}});
  for (const Specification& rule : rules) {
    Eigen::VectorXd step, double_loss, double_unit_0, double_unit_1;
    if (!FirstStep(rule, 1.0, 1.0, 1.0, &step, error) ||
        !FirstStep(rule, 2.0, 1.0, 1.0, &double_loss, error) ||
        !FirstStep(rule, 1.0, 2.0, 1.0, &double_unit_0, error) ||
        !FirstStep(rule, 1.0, 1.0, 2.0, &double_unit_1, error)) {
      *error = rule.text + ": " + *error;
      // The rule needs parts that the problem does not have: an error only if
      // the user named the rule.
      if (!FLAGS_rules.empty()) return NameFlag("rules", false, error);
      table.AddRow({rule.text, "-", "-", "-"});
      refusals += *error + "\n";
      continue;
    }
    table.AddRow({rule.text,
                  Exponent(double_loss[0], step[0]),
                  Exponent(double_unit_0[0], step[0]),
                  Exponent(double_unit_1[0], step[0])});
  }
  std::cout << table.ToText() << refusals;
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgram(
      argc,
      argv,
      "shows how the first step of each rule scales with "
      "the loss and with units",
      invgrad::Run);
}
