// Conformance of every row of the table of rules.
#include "invgrad/rules.h"

#include <limits>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/linearization.h"
#include "invgrad/update_rule.h"
#include "tests/rules/quadratic.h"
#include "tests/rules/step_of.h"

namespace invgrad {
namespace rules_test {

using Eigen::VectorXd;

std::string CreationError(const std::string& text) {
  std::string error;
  EXPECT_EQ(MakeRule(text, &error), nullptr);
  return error;
}

// Two rules find the length of their steps themselves.
bool HasStepSize(const RuleRow& row) {
  return row.name != "geodesic" && row.name != "adaptive" &&
         row.name != "ssbroyden";
}

TEST(Rules, NamesAreUniqueAndRowsAreComplete) {
  std::set<std::string> names;
  for (const RuleRow& row : Rules()) {
    EXPECT_TRUE(names.insert(row.name).second) << row.name;
    EXPECT_FALSE(row.formula.empty()) << row.name;
    EXPECT_EQ(FindRule(row.name), &row);
    ASSERT_FALSE(row.options().empty()) << row.name;
    EXPECT_EQ(row.options()[0].name == "step_size", HasStepSize(row))
        << row.name;
    for (const OptionSet::Row& option : row.options()) {
      EXPECT_FALSE(option.help.empty()) << row.name << " " << option.name;
    }
  }
  EXPECT_EQ(FindRule("no such rule"), nullptr);
  EXPECT_EQ(names,
            (std::set<std::string>{"gradient_descent",
                                   "adam",
                                   "rmsprop",
                                   "adagrad",
                                   "adadelta",
                                   "newton",
                                   "saddle_free_newton",
                                   "power",
                                   "half_inverse",
                                   "gauss_newton",
                                   "levenberg_marquardt",
                                   "layer_half_inverse",
                                   "adaptive",
                                   "kfac_half_inverse",
                                   "kfac",
                                   "krylov",
                                   "hessian_free",
                                   "adahessian",
                                   "geodesic",
                                   "determined",
                                   "ssbroyden"}));
}

// Every default, set explicitly, changes nothing.
TEST(Rules, EveryDefaultIsAccepted) {
  const Quadratic problem(5, 3);
  const Linearization at_x = problem.At(VectorXd::Ones(3));
  for (const RuleRow& row : Rules()) {
    std::string text = row.name;
    for (const OptionSet::Row& option : row.options()) {
      text += ":" + option.name + "=" + option.default_value;
    }
    EXPECT_TRUE(StepOf(text, at_x) == StepOf(row.name, at_x)) << text;
  }
}

TEST(Rules, DefaultsOfTheSpectralRules) {
  const auto defaults = [](const std::string& name) {
    std::vector<std::pair<std::string, std::string>> values;
    for (const OptionSet::Row& option : FindRule(name)->options()) {
      values.emplace_back(option.name, option.default_value);
    }
    return values;
  };
  using Values = std::vector<std::pair<std::string, std::string>>;
  const Values step_size = {{"step_size", "1"},
                            {"schedule", "constant"},
                            {"final_fraction", "0.01"},
                            {"rho", "0.3"}};
  const Values spectral = {{"route", "auto"},
                           {"tolerance", "0.01"},
                           {"threshold_tolerance", "0.25"}};
  const Values filter = {{"truncation", "1e-06"},
                         {"clamp", "false"},
                         {"damping", "0"},
                         {"relative_damping", "0"},
                         {"control", "none"},
                         {"adapts", "exponent"}};
  const auto join = [](const std::vector<Values>& parts) {
    Values all;
    for (const Values& part : parts) {
      all.insert(all.end(), part.begin(), part.end());
    }
    return all;
  };
  EXPECT_EQ(defaults("half_inverse"), join({step_size, filter, spectral}));
  EXPECT_EQ(defaults("gauss_newton"), join({step_size, filter, spectral}));
  EXPECT_EQ(defaults("power"),
            join({step_size, {{"kappa", "0.5"}}, filter, spectral}));
  EXPECT_EQ(defaults("layer_half_inverse"), defaults("power"));
  Values levenberg_marquardt = filter;
  levenberg_marquardt[0].second = "0";
  levenberg_marquardt[3].second = "0.001";
  levenberg_marquardt[5].second = "damping";
  EXPECT_EQ(defaults("levenberg_marquardt"),
            join({step_size, levenberg_marquardt, spectral}));
  Values kfac = filter;
  kfac[0].second = "0.001";
  kfac[1].second = "true";
  kfac.insert(kfac.end(),
              {{"metric", "identity"},
               {"decay", "0"},
               {"interval", "1"},
               {"seed", "0"}});
  EXPECT_EQ(defaults("kfac_half_inverse"),
            join({step_size, {{"kappa", "0.5"}}, kfac}));
}

TEST(Rules, AdaptiveIsGeodesicWithALimitedStep) {
  const auto geodesic = FindRule("geodesic")->options();
  const auto adaptive = FindRule("adaptive")->options();
  ASSERT_EQ(adaptive.size(), geodesic.size());
  EXPECT_LE(adaptive.size(), 5u);
  for (size_t i = 0; i < adaptive.size(); ++i) {
    EXPECT_EQ(adaptive[i].name, geodesic[i].name);
    EXPECT_EQ(adaptive[i].default_value,
              adaptive[i].name == "max_relative_step"
                  ? "0.1"
                  : geodesic[i].default_value);
  }
  for (const RuleRow& row : Rules()) {
    EXPECT_EQ(row.races_batch_size, row.name == "adaptive") << row.name;
  }
}

TEST(Rules, ErrorsNameTheRuleAndWhatIsAllowed) {
  EXPECT_EQ(CreationError("adm"), "unknown rule 'adm'; did you mean adam?");
  EXPECT_EQ(CreationError("adam:step_size=-1"),
            "adam: step_size=-1 is out of range; allowed: (0, inf)");
  EXPECT_EQ(CreationError("adam:step_size=auto"),
            "adam: step_size=auto is not a finite number; allowed: (0, inf)");
  EXPECT_EQ(CreationError("half_inverse:step_size=0"),
            "half_inverse: step_size=0 is out of range; allowed: (0, inf) or "
            "auto");
  EXPECT_EQ(CreationError("half_inverse:truncaton=1"),
            "half_inverse: unknown option 'truncaton'; did you mean "
            "truncation?");
  EXPECT_EQ(CreationError("half_inverse:kappa=1"),
            "half_inverse: unknown option 'kappa'; known: step_size, schedule, "
            "final_fraction, rho, truncation, clamp, damping, "
            "relative_damping, control, adapts, route, tolerance, "
            "threshold_tolerance");
  EXPECT_EQ(CreationError("power:route=gradient"),
            "power: route=gradient is no choice; allowed: one of auto, gram, "
            "svd");
}

TEST(Rules, ASmallFirstStepDecreasesTheCost) {
  for (const auto& [m, n] : {std::pair(6, 4), std::pair(4, 6)}) {
    const Quadratic problem(m, n);
    const VectorXd x = VectorXd::Ones(n);
    for (const RuleRow& row : Rules()) {
      const VectorXd step =
          StepOf(row.name + (HasStepSize(row) ? ":step_size=1e-3" : ""),
                 problem.At(x));
      EXPECT_LT(problem.Cost(x + step), problem.Cost(x)) << row.name;
    }
  }
}

TEST(Rules, TheFirstStepIsProportionalToTheStepSize) {
  const Quadratic problem(6, 4);
  const Linearization at_x = problem.At(VectorXd::Ones(4));
  for (const RuleRow& row : Rules()) {
    if (!HasStepSize(row)) continue;
    const VectorXd one = StepOf(row.name + ":step_size=0.25", at_x);
    const VectorXd two = StepOf(row.name + ":step_size=0.5", at_x);
    EXPECT_LE((two - 2.0 * one).norm(), 1e-15 * two.norm()) << row.name;
    EXPECT_GT(one.norm(), 0.0) << row.name;
  }
}

TEST(Rules, SchedulesScaleTheStep) {
  const Quadratic problem(6, 4);
  Linearization at_x = problem.At(VectorXd::Ones(4));
  for (const RuleRow& row : Rules()) {
    if (!HasStepSize(row)) continue;
    at_x.progress = 0.0;
    const VectorXd full = StepOf(row.name, at_x);
    at_x.progress = 1.0;
    const VectorXd last =
        StepOf(row.name + ":schedule=cosine:final_fraction=0.25", at_x);
    EXPECT_LE((last - 0.25 * full).norm(), 1e-15 * full.norm()) << row.name;
  }
}

TEST(Rules, AZeroGradientGivesAZeroStep) {
  const Quadratic problem(6, 4);
  Linearization at_x = problem.At(VectorXd::Ones(4));
  at_x.loss_gradient.setZero();
  at_x.gradient.setZero();
  for (const RuleRow& row : Rules()) {
    EXPECT_TRUE(StepOf(row.name, at_x).isZero(0.0)) << row.name;
  }
  for (const std::string name : kSpectralRules) {
    EXPECT_TRUE(StepOf(name + ":step_size=auto", at_x).isZero(0.0)) << name;
  }
}

TEST(Rules, WhatIsNotFiniteIsRefused) {
  const Quadratic problem(6, 4);
  for (const RuleRow& row : Rules()) {
    for (const double bad : {std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity()}) {
      Linearization at_x = problem.At(VectorXd::Ones(4));
      at_x.loss_gradient[2] = bad;
      at_x.gradient[2] = bad;
      VectorXd step;
      std::string error;
      EXPECT_FALSE(MakeRule(row.name)->ComputeStep(at_x, &step, &error))
          << row.name;
      // "entry 2" of the gradient, "row 2 (sample 2, output 0)" of g.
      EXPECT_NE(error.find(" is not finite: "), std::string::npos)
          << row.name << ": " << error;
      EXPECT_NE(error.find(" 2 "), std::string::npos)
          << row.name << ": " << error;
    }
  }
}

// Rules compute only from the parts that they have asked for.
TEST(Rules, NeedsAreHonest) {
  const Quadratic problem(6, 4);
  const Linearization full = problem.At(VectorXd::Ones(4));
  for (const RuleRow& row : Rules()) {
    const std::unique_ptr<UpdateRule> rule = MakeRule(row.name);
    Linearization asked;
    asked.cost = full.cost;
    if (rule->Needs().after) asked.after = full.after;
    if (rule->Needs().gradient) asked.gradient = full.gradient;
    if (rule->Needs().hessian) asked.hessian = full.hessian;
    if (rule->Needs().hessian_times) asked.hessian_times = full.hessian_times;
    if (rule->Needs().jacobian) {
      asked.loss_gradient = full.loss_gradient;
      asked.jacobian = full.jacobian;
    }
    VectorXd step;
    std::string error;
    ASSERT_TRUE(rule->ComputeStep(asked, &step, &error)) << error;
    EXPECT_TRUE(step == StepOf(row.name, full)) << row.name;
  }
}

// A fresh rule that is given the arrays of one that has run goes on as that
// one would have, bit for bit.
TEST(Rules, StateIsComplete) {
  std::vector<std::string> texts = {
      "gradient_descent:momentum=0.9",
      "gradient_descent:momentum=0.9:nesterov=true:schedule=linear",
      "rmsprop:momentum=0.5",
      "adagrad:initial_sum=0.1",
      "half_inverse:step_size=auto:schedule=cosine",
      "gauss_newton:step_size=2.5:control=gain",
      "krylov:control=gain:adapts=exponent"};
  for (const RuleRow& row : Rules()) texts.push_back(row.name);
  const Quadratic problem(6, 4);
  constexpr int kNumSteps = 5;
  for (const std::string& text : texts) {
    SCOPED_TRACE(text);
    VectorXd x = VectorXd::Ones(4);
    const auto advance = [&](UpdateRule* rule, int k, VectorXd* at) {
      Linearization at_x = problem.At(*at);
      at_x.progress = k / (2.0 * kNumSteps);
      const VectorXd next = *at + StepOf(rule, at_x);
      if (rule->judge() == nullptr ||
          rule->judge()->KeepsStep(problem.Cost(next), 1.0)) {
        *at = next;
      }
    };
    const std::unique_ptr<UpdateRule> rule = MakeRule(text);
    for (int k = 0; k < kNumSteps; ++k) advance(rule.get(), k, &x);

    const std::unique_ptr<UpdateRule> resumed = MakeRule(text);
    const std::vector<VectorXd*> saved = rule->MutableState();
    const std::vector<VectorXd*> restored = resumed->MutableState();
    ASSERT_EQ(saved.size(), restored.size());
    for (size_t i = 0; i < saved.size(); ++i) *restored[i] = *saved[i];
    VectorXd resumed_x = x;
    for (int k = kNumSteps; k < 2 * kNumSteps; ++k) {
      advance(rule.get(), k, &x);
      advance(resumed.get(), k, &resumed_x);
      ASSERT_TRUE(x == resumed_x) << "step " << k;
    }
  }
}

// Whether or not it has a schedule, and one is a setting of every rule.
TEST(Rules, SayWhetherTheirStepsDependOnTheBudget) {
  const Quadratic problem(6, 4);
  for (const RuleRow& row : Rules()) {
    if (!HasStepSize(row)) continue;
    for (const char* schedule : {"constant", "linear"}) {
      const std::string text = row.name + ":schedule=" + schedule;
      SCOPED_TRACE(text);
      const auto step_at = [&](double progress) {
        Linearization at_x = problem.At(VectorXd::Ones(4));
        at_x.progress = progress;
        return StepOf(MakeRule(text).get(), at_x);
      };
      EXPECT_EQ(MakeRule(text)->Needs().progress, step_at(0.1) != step_at(0.9));
    }
  }
}

}  // namespace rules_test
}  // namespace invgrad
