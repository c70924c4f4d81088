#include "invgrad/rules/rules.h"

#include "invgrad/rules/adadelta.h"
#include "invgrad/rules/adagrad.h"
#include "invgrad/rules/adam.h"
#include "invgrad/rules/gradient_descent.h"
#include "invgrad/rules/kfac_rule.h"
#include "invgrad/rules/krylov_rule.h"
#include "invgrad/rules/newton.h"
#include "invgrad/rules/rmsprop.h"
#include "invgrad/rules/spectral_rule.h"

namespace invgrad {
namespace {

// A row whose settings start from `defaults`.
template <typename Rule>
RuleRow Row(const std::string& name,
            const std::string& formula,
            const typename Rule::Options& defaults) {
  RuleRow row;
  row.name = name;
  row.formula = formula;
  row.options = [defaults]() {
    typename Rule::Options options = defaults;
    OptionSet set;
    options.Describe(&set);
    return set.rows();
  };
  row.create = [name, defaults](
                   const Settings& settings,
                   std::string* error) -> std::unique_ptr<UpdateRule> {
    typename Rule::Options options = defaults;
    OptionSet set;
    options.Describe(&set);
    if (!set.SetAll(settings, error)) {
      *error = name + ": " + *error;
      return nullptr;
    }
    return std::make_unique<Rule>(options);
  };
  return row;
}

Newton::Options SaddleFree() {
  Newton::Options options;
  options.saddle_free = true;
  return options;
}

std::vector<RuleRow> MakeRules() {
  return {
      Row<GradientDescent>(
          "gradient_descent", "v <- mu v + gradient, step = -eta v", {}),
      Row<Adam>("adam",
                "step = -eta m / (sqrt(v) + epsilon), m and v the corrected "
                "means of gradient and gradient^2",
                {}),
      Row<RmsProp>("rmsprop",
                   "step = -eta gradient / (sqrt(v) + epsilon), v the mean of "
                   "gradient^2",
                   {}),
      Row<Adagrad>("adagrad",
                   "step = -eta gradient / (sqrt(v) + epsilon), v the sum of "
                   "gradient^2",
                   {}),
      Row<Adadelta>("adadelta",
                    "step = -eta sqrt((u + epsilon) / (v + epsilon)) gradient, "
                    "u and v the means of step^2 and gradient^2",
                    {}),
      Row<Newton>("newton", "step = -eta H^-1 gradient", {}),
      Row<Newton>(
          "saddle_free_newton", "step = -eta |H|^-1 gradient", SaddleFree()),
      Row<SpectralRule>("power",
                        "step = -eta V S^(-kappa) U^T g, s > tau s_max",
                        SpectralRule::Options::Power()),
      Row<SpectralRule>("half_inverse",
                        "step = -eta V S^(-1/2) U^T g, s > tau s_max",
                        SpectralRule::Options::HalfInverse()),
      Row<SpectralRule>("gauss_newton",
                        "step = -eta V S^-1 U^T g, s > tau s_max",
                        SpectralRule::Options::GaussNewton()),
      Row<SpectralRule>("levenberg_marquardt",
                        "step = -eta V S / (S^2 + lambda) U^T g",
                        SpectralRule::Options::LevenbergMarquardt()),
      Row<SpectralRule>("layer_half_inverse",
                        "step_l = -eta V_l S_l^(-kappa) U_l^T g, s > tau s_max "
                        "of the layer's columns of J",
                        SpectralRule::Options::LayerHalfInverse()),
      Row<SpectralRule>("adaptive_power",
                        "step = -eta V S^(-kappa) U^T g, s > tau s_max; kappa "
                        "follows the gain",
                        SpectralRule::Options::AdaptivePower()),
      Row<KfacRule>("kfac_half_inverse",
                    "step_l = -eta B^p A^(-p) G_l D^(-p), p = (1 + kappa) / 2, "
                    "J_l^T J_l ~ D (x) A / B",
                    KfacRule::Options()),
      Row<KrylovRule>("krylov",
                      "step = -eta V_k R_k^(-kappa) P_k^T g, k Golub-Kahan "
                      "iterations",
                      KrylovRule::Options()),
  };
}

}  // namespace

const std::vector<RuleRow>& Rules() {
  static const std::vector<RuleRow>& rules =
      *new std::vector<RuleRow>(MakeRules());
  return rules;
}

const RuleRow* FindRule(const std::string& name) {
  for (const RuleRow& row : Rules()) {
    if (row.name == name) return &row;
  }
  return nullptr;
}

std::unique_ptr<UpdateRule> CreateRule(const Specification& specification,
                                       std::string* error) {
  const RuleRow* row = FindRule(specification.name);
  if (row != nullptr) return row->create(specification.settings, error);
  std::vector<std::string> names;
  for (const RuleRow& other : Rules()) names.push_back(other.name);
  *error = UnknownNameMessage("rule", specification.name, names);
  return nullptr;
}

}  // namespace invgrad
