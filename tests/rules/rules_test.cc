// Conformance of every row of the table of rules.
#include "invgrad/rules/rules.h"

#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/QR"
#include "gtest/gtest.h"
#include "invgrad/chain/network_jacobian.h"

namespace invgrad {
namespace rules_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

std::string CreationError(const std::string& text) {
  std::string error;
  EXPECT_EQ(MakeRule(text, &error), nullptr);
  return error;
}

// A as the Jacobian of a network of one linear unit over samples with one
// output each, row s is delta_s (a_s, 1): a J in which every rule finds what it
// needs. The last column of A must have no zero.
std::shared_ptr<const JacobianOperator> OneUnit(const MatrixXd& A) {
  const int num_inputs = static_cast<int>(A.cols()) - 1;
  const DenseNetwork network({num_inputs, 1}, Activation::kTanh);
  const VectorXd weights = VectorXd::Zero(A.cols());
  const VectorXd delta = A.col(num_inputs);
  DenseNetwork::Activations activations;
  network.Forward(
      weights,
      (delta.cwiseInverse().asDiagonal() * A.leftCols(num_inputs)).transpose(),
      false,
      &activations);
  return std::make_shared<NetworkJacobian>(
      network, weights, activations, delta.transpose());
}

// L = 1/2 |A x - b|^2.
class Quadratic {
 public:
  Quadratic(int m, int n) {
    std::mt19937 generator(100 * m + n);
    std::normal_distribution<double> normal;
    const auto next = [&]() { return normal(generator); };
    A_ = MatrixXd::NullaryExpr(m, n, next);
    b_ = VectorXd::NullaryExpr(m, next);
  }

  double Cost(const VectorXd& x) const {
    return 0.5 * (A_ * x - b_).squaredNorm();
  }

  Linearization At(const VectorXd& x) const {
    Linearization at_x;
    at_x.cost = Cost(x);
    at_x.loss_gradient = A_ * x - b_;
    at_x.jacobian = OneUnit(A_);
    at_x.gradient = A_.transpose() * at_x.loss_gradient;
    at_x.hessian = A_.transpose() * A_;
    return at_x;
  }

  const MatrixXd& A() const { return A_; }

 private:
  MatrixXd A_;  // m x n
  VectorXd b_;  // m
};

VectorXd StepOf(UpdateRule* rule, const Linearization& at_x) {
  VectorXd step;
  std::string error;
  EXPECT_TRUE(rule->ComputeStep(at_x, &step, &error)) << error;
  EXPECT_EQ(step.size(), at_x.gradient.size());
  return step;
}

VectorXd StepOf(const std::string& text, const Linearization& at_x) {
  return StepOf(MakeRule(text).get(), at_x);
}

// Those that decompose J.
const char* const kSpectralRules[] = {"power",
                                      "half_inverse",
                                      "gauss_newton",
                                      "levenberg_marquardt",
                                      "layer_half_inverse",
                                      "kfac_half_inverse"};

TEST(Rules, NamesAreUniqueAndRowsAreComplete) {
  std::set<std::string> names;
  for (const RuleRow& row : Rules()) {
    EXPECT_TRUE(names.insert(row.name).second) << row.name;
    EXPECT_FALSE(row.formula.empty()) << row.name;
    EXPECT_EQ(FindRule(row.name), &row);
    ASSERT_FALSE(row.options().empty()) << row.name;
    EXPECT_EQ(row.options()[0].name, "step_size") << row.name;
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
                                   "adaptive_power",
                                   "kfac_half_inverse",
                                   "krylov"}));
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
  EXPECT_EQ(defaults("kfac_half_inverse"),
            join({step_size, {{"kappa", "0.5"}}, kfac}));
  Values adaptive_power = join({step_size, {{"kappa", "0.5"}}, filter});
  adaptive_power[0].second = "auto";
  adaptive_power[9].second = "gain";
  EXPECT_EQ(defaults("adaptive_power"), join({adaptive_power, spectral}));
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
      const VectorXd step = StepOf(row.name + ":step_size=1e-3", problem.At(x));
      EXPECT_LT(problem.Cost(x + step), problem.Cost(x)) << row.name;
    }
  }
}

TEST(Rules, TheFirstStepIsProportionalToTheStepSize) {
  const Quadratic problem(6, 4);
  const Linearization at_x = problem.At(VectorXd::Ones(4));
  for (const RuleRow& row : Rules()) {
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
    if (rule->Needs().gradient) asked.gradient = full.gradient;
    if (rule->Needs().hessian) asked.hessian = full.hessian;
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
      if (!rule->JudgesSteps() || rule->KeepsStep(problem.Cost(next), 1.0)) {
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

// (g, J) -> c (g, J) multiplies the step by c^(1 - kappa).
TEST(SpectralRules, ScalingLaw) {
  const Quadratic problem(5, 7);
  const Linearization at_x = problem.At(VectorXd::Ones(7));
  const double c = 7.0;
  Linearization scaled = at_x;
  scaled.loss_gradient = c * at_x.loss_gradient;
  scaled.jacobian = OneUnit(c * problem.A());
  const std::vector<std::pair<std::string, double>> cases = {
      {"half_inverse", 0.5},
      {"gauss_newton", 1.0},
      {"power:kappa=-1", -1.0},
      {"power:kappa=0.75", 0.75},
      {"levenberg_marquardt", 1.0},
      {"layer_half_inverse", 0.5},
      {"kfac_half_inverse", 0.5},
      {"kfac_half_inverse:kappa=1", 1.0}};
  for (const auto& [text, kappa] : cases) {
    const VectorXd step = std::pow(c, 1.0 - kappa) * StepOf(text, at_x);
    EXPECT_LE((StepOf(text, scaled) - step).norm(), 1e-12 * step.norm())
        << text;
  }
}

// The automatic step size undoes the factor: no step depends on it.
TEST(SpectralRules, AutomaticStepsDoNotDependOnTheScaleOfTheLoss) {
  const Quadratic problem(5, 7);
  const Linearization at_x = problem.At(VectorXd::Ones(7));
  Linearization scaled = at_x;
  scaled.loss_gradient = 7.0 * at_x.loss_gradient;
  scaled.jacobian = OneUnit(7.0 * problem.A());
  for (const std::string name : kSpectralRules) {
    const VectorXd step = StepOf(name + ":step_size=auto", at_x);
    EXPECT_LE((StepOf(name + ":step_size=auto", scaled) - step).norm(),
              1e-12 * step.norm())
        << name;
  }
  // Gauss-Newton's linear model is solved by a full step, so auto is rho.
  const VectorXd full = StepOf("gauss_newton", at_x);
  EXPECT_LE(
      (StepOf("gauss_newton:step_size=auto:rho=0.5", at_x) - 0.5 * full).norm(),
      1e-12 * full.norm());
}

TEST(SpectralRules, GaussNewtonIsLeastSquares) {
  for (const auto& [m, n] : {std::pair(7, 5), std::pair(5, 7)}) {
    const Quadratic problem(m, n);
    const Linearization at_x = problem.At(VectorXd::Ones(n));
    const VectorXd least_squares =
        -problem.A().completeOrthogonalDecomposition().solve(
            at_x.loss_gradient);
    EXPECT_LE((StepOf("gauss_newton:route=svd", at_x) - least_squares).norm(),
              1e-13 * least_squares.norm());
    EXPECT_LE((StepOf("power:kappa=1", at_x) - least_squares).norm(),
              1e-12 * least_squares.norm());
    EXPECT_LE(
        (StepOf("levenberg_marquardt:relative_damping=0", at_x) - least_squares)
            .norm(),
        1e-12 * least_squares.norm());
  }
}

TEST(SpectralRules, KappaMinusOneIsGradientDescent) {
  const Quadratic problem(5, 7);
  const Linearization at_x = problem.At(VectorXd::Ones(7));
  const VectorXd step = StepOf("gradient_descent:step_size=0.1", at_x);
  for (const std::string route : {"auto:truncation=0", "svd", "gram"}) {
    EXPECT_LE(
        (StepOf("power:kappa=-1:step_size=0.1:route=" + route, at_x) - step)
            .norm(),
        1e-14 * step.norm())
        << route;
  }
}

TEST(SpectralRules, LevenbergMarquardtLimits) {
  const Quadratic problem(5, 7);
  const Linearization at_x = problem.At(VectorXd::Ones(7));
  const auto damped = [&](const std::string& damping) {
    return StepOf("levenberg_marquardt:relative_damping=0:damping=" + damping,
                  at_x);
  };
  const VectorXd gauss_newton = StepOf("gauss_newton", at_x);
  EXPECT_LE((damped("1e-10") - gauss_newton).norm(),
            1e-8 * gauss_newton.norm());
  const VectorXd gradient = at_x.gradient;
  EXPECT_LE((1e10 * damped("1e10") + gradient).norm(), 1e-8 * gradient.norm());
  EXPECT_GE((damped("1.0") - gauss_newton).norm(), 1e-2 * gauss_newton.norm());
}

TEST(SpectralRules, ReportsSayWhatWasDone) {
  const Quadratic problem(5, 7);
  const Linearization at_x = problem.At(VectorXd::Ones(7));
  const auto report = [&](const std::string& text) {
    const std::unique_ptr<UpdateRule> rule = MakeRule(text);
    EXPECT_EQ(rule->LastStepReport(), "");
    StepOf(rule.get(), at_x);
    return rule->LastStepReport();
  };
  EXPECT_EQ(report("half_inverse"), "route gram, rank 5 of 5");
  EXPECT_EQ(report("half_inverse:route=svd"), "route svd, rank 5 of 5");
  EXPECT_EQ(report("power:kappa=-1:truncation=0"), "route gradient");
  EXPECT_EQ(report("gauss_newton:step_size=auto"),
            "route gram, rank 5 of 5, step size 0.3");
  const std::string fallback = report("half_inverse:tolerance=1e-16");
  EXPECT_EQ(fallback.rfind("route svd, rank 5 of 5 (gram: estimated error ", 0),
            0u)
      << fallback;
}

}  // namespace rules_test
}  // namespace invgrad
