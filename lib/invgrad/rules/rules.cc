#include "invgrad/rules/rules.h"

#include <utility>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/rules/first_order_rules.h"
#include "invgrad/rules/kfac_rule.h"
#include "invgrad/rules/krylov_rule.h"
#include "invgrad/rules/newton.h"
#include "invgrad/rules/spectral_rule.h"

namespace invgrad {
namespace {

Newton::Options SaddleFree() {
  Newton::Options options;
  options.saddle_free = true;
  return options;
}

std::deque<RuleRow> MakeTable() {
  return {
      MakeRuleRow<GradientDescent>("gradient_descent",
                                   "v <- mu v + gradient, step = -eta v"),
      MakeRuleRow<Adam>(
          "adam",
          "step = -eta m / (sqrt(v) + epsilon), m and v the corrected "
          "means of gradient and gradient^2"),
      MakeRuleRow<RmsProp>(
          "rmsprop",
          "step = -eta gradient / (sqrt(v) + epsilon), v the mean of "
          "gradient^2"),
      MakeRuleRow<Adagrad>(
          "adagrad",
          "step = -eta gradient / (sqrt(v) + epsilon), v the sum of "
          "gradient^2"),
      MakeRuleRow<Adadelta>(
          "adadelta",
          "step = -eta sqrt((u + epsilon) / (v + epsilon)) gradient, "
          "u and v the means of step^2 and gradient^2"),
      MakeRuleRow<Newton>("newton", "step = -eta H^-1 gradient"),
      MakeRuleRow<Newton>(
          "saddle_free_newton", "step = -eta |H|^-1 gradient", SaddleFree()),
      MakeRuleRow<SpectralRule>("power",
                                "step = -eta V S^(-kappa) U^T g, s > tau s_max",
                                SpectralRule::Options::Power()),
      MakeRuleRow<SpectralRule>("half_inverse",
                                "step = -eta V S^(-1/2) U^T g, s > tau s_max",
                                SpectralRule::Options::HalfInverse()),
      MakeRuleRow<SpectralRule>("gauss_newton",
                                "step = -eta V S^-1 U^T g, s > tau s_max",
                                SpectralRule::Options::GaussNewton()),
      MakeRuleRow<SpectralRule>("levenberg_marquardt",
                                "step = -eta V S / (S^2 + lambda) U^T g",
                                SpectralRule::Options::LevenbergMarquardt()),
      MakeRuleRow<SpectralRule>(
          "layer_half_inverse",
          "step_l = -eta V_l S_l^(-kappa) U_l^T g, s > tau s_max "
          "of the layer's columns of J",
          SpectralRule::Options::LayerHalfInverse()),
      MakeRuleRow<SpectralRule>(
          "adaptive_power",
          "step = -eta V S^(-kappa) U^T g, s > tau s_max; kappa "
          "follows the gain",
          SpectralRule::Options::AdaptivePower()),
      MakeRuleRow<KfacRule>(
          "kfac_half_inverse",
          "step_l = -eta B^p A^(-p) G_l D^(-p), p = (1 + kappa) / 2, "
          "J_l^T J_l ~ D (x) A / B",
          KfacRule::Options()),
      MakeRuleRow<KrylovRule>(
          "krylov",
          "step = -eta V_k R_k^(-kappa) P_k^T g, k Golub-Kahan "
          "iterations",
          KrylovRule::Options()),
  };
}

std::deque<RuleRow>& Table() {
  static std::deque<RuleRow>& table = *new std::deque<RuleRow>(MakeTable());
  return table;
}

}  // namespace

std::unique_ptr<UpdateRule> MakeRule(const std::string& text) {
  std::string error;
  std::unique_ptr<UpdateRule> rule = MakeRule(text, &error);
  CHECK(rule != nullptr) << error;
  return rule;
}

std::unique_ptr<UpdateRule> MakeRule(const std::string& text,
                                     std::string* error) {
  CHECK(error != nullptr);
  std::vector<Specification> specifications;
  if (!ParseSpecifications(text, &specifications, error)) return nullptr;
  if (specifications.size() != 1) {
    *error = fmt::format(
        "'{}' describes {} rules; expected one", text, specifications.size());
    return nullptr;
  }
  return MakeRule(specifications[0], error);
}

std::unique_ptr<UpdateRule> MakeRule(const Specification& specification,
                                     std::string* error) {
  CHECK(error != nullptr);
  const RuleRow* row = FindRule(specification.name);
  if (row != nullptr) return row->create(specification.settings, error);
  std::vector<std::string> names;
  for (const RuleRow& other : Rules()) names.push_back(other.name);
  *error = UnknownNameMessage("rule", specification.name, names);
  return nullptr;
}

const std::deque<RuleRow>& Rules() { return Table(); }

const RuleRow* FindRule(const std::string& name) {
  for (const RuleRow& row : Rules()) {
    if (row.name == name) return &row;
  }
  return nullptr;
}

void RegisterRule(RuleRow row) {
  CHECK(!row.name.empty() &&
        row.name.find_first_of(":=,/+> \t\n") == std::string::npos)
      << "'" << row.name << "' cannot be the name of a rule.";
  CHECK(FindRule(row.name) == nullptr)
      << "There is already a rule '" << row.name << "'.";
  CHECK(row.options != nullptr && row.create != nullptr)
      << "The row of rule '" << row.name << "' is incomplete.";
  Table().push_back(std::move(row));
}

}  // namespace invgrad
