#include "problems/estimation/formula.h"

#include <cmath>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "problems/estimation/nist_models.h"

namespace invgrad {
namespace formula_test {

Formula Parsed(const std::string& text) {
  Formula formula;
  std::string error;
  EXPECT_TRUE(Formula::Parse(text, &formula, &error)) << text << ": " << error;
  return formula;
}

// `values`: of the variables as they appear.
double Value(const std::string& text, const std::vector<double>& values = {}) {
  const Formula formula = Parsed(text);
  EXPECT_EQ(formula.variables().size(), values.size()) << text;
  return formula.Evaluate(values);
}

TEST(Formula, HasTheUsualPrecedences) {
  EXPECT_EQ(Value("2 + 3*4"), 14.0);
  EXPECT_EQ(Value("(2 + 3)*4"), 20.0);
  EXPECT_EQ(Value("9 - 3 - 2"), 4.0);
  EXPECT_EQ(Value("8/4/2"), 1.0);
  EXPECT_EQ(Value("2^3^2"), 512.0);
  EXPECT_EQ(Value("2**3**2"), 512.0);
  EXPECT_EQ(Value("-3^2"), -9.0);
  EXPECT_EQ(Value("(-3)^2"), 9.0);
  EXPECT_EQ(Value("2^-1"), 0.5);
  EXPECT_EQ(Value("2*-3"), -6.0);
  EXPECT_EQ(Value("1 - +2"), -1.0);
  EXPECT_EQ(Value("1 + 1 < 3"), 1.0);
  EXPECT_EQ(Value("1e3 + .5 + 1.5e-2"), 1000.515);
}

TEST(Formula, NamesItsVariablesAsTheyAppear) {
  const Formula formula = Parsed("b1*(1 - exp(-b2*x)) + b1*_k9");
  EXPECT_EQ(formula.variables(),
            (std::vector<std::string>{"b1", "b2", "x", "_k9"}));
  // A function's name is one only in front of a parenthesis.
  EXPECT_EQ(Value("exp*2", {3.0}), 6.0);
}

TEST(Formula, FunctionsAreThoseOfTheLibrary) {
  const double x = 0.3;
  const std::vector<std::pair<const char*, double>> functions = {
      {"exp", std::exp(x)},
      {"log", std::log(x)},
      {"log10", std::log10(x)},
      {"sqrt", std::sqrt(x)},
      {"sin", std::sin(x)},
      {"cos", std::cos(x)},
      {"tan", std::tan(x)},
      {"asin", std::asin(x)},
      {"acos", std::acos(x)},
      {"atan", std::atan(x)},
      {"sinh", std::sinh(x)},
      {"cosh", std::cosh(x)},
      {"tanh", std::tanh(x)},
      {"erf", std::erf(x)},
      {"abs", x}};
  for (const auto& [name, expected] : functions) {
    EXPECT_EQ(Value(std::string(name) + "(x)", {x}), expected) << name;
  }
  EXPECT_EQ(Value("abs(-x)", {x}), x);
  EXPECT_EQ(Value("atan2(y, x)", {1.0, -2.0}), std::atan2(1.0, -2.0));
  EXPECT_EQ(Value("pow(x, 3)", {-2.0}), -8.0);
  EXPECT_EQ(Value("min(x, y) + 10*max(x, y)", {1.0, 2.0}), 21.0);
  EXPECT_EQ(Value("2*pi"), 2.0 * M_PI);
  EXPECT_EQ(Value("if(x >= 1, x, -x)", {1.0}), 1.0);
  EXPECT_EQ(Value("if(x > 1, x, -x)", {1.0}), -1.0);
  EXPECT_EQ(Value("if(x <= 1, 1, 2)", {2.0}), 2.0);
}

// By symmetric differences; every operation at least once.
TEST(Formula, DerivativesAreExact) {
  using Jet = ceres::Jet<double, 1>;
  for (const char* text : {"x*x - 3/x + x^3 - x^-2 + 2^x + x^x + pow(x, 0.5)",
                           "exp(x) + log(x)*log10(x) - sqrt(x)",
                           "sin(x)*cos(x) + tan(x)",
                           "asin(x)*acos(x) + atan(x)",
                           "sinh(x) + cosh(x)*tanh(x)",
                           "erf(x) + abs(-x) + abs(x) + atan2(x, 2*x*x)",
                           "min(x, 2*x) + max(x, 2*x) + if(x < 2, x^2, 0)",
                           "-(-x)^2 + (x - 2)^2 + (x - 2)^3"}) {
    const Formula formula = Parsed(text);
    const double x = 0.4;
    const double h = 1e-5;
    std::vector<Jet> at;
    std::vector<double> above;
    std::vector<double> below;
    for (std::size_t i = 0; i < formula.variables().size(); ++i) {
      at.emplace_back(x, 0);
      above.push_back(x + h);
      below.push_back(x - h);
    }
    const Jet result = formula.Evaluate(at);
    EXPECT_EQ(result.a, formula.Evaluate(std::vector<double>(at.size(), x)))
        << text;
    const double difference =
        (formula.Evaluate(above) - formula.Evaluate(below)) / (2.0 * h);
    EXPECT_NEAR(result.v[0], difference, 1e-8 * (1.0 + std::abs(difference)))
        << text;
  }
}

// The branch that is not taken may be outside of its domain.
TEST(Formula, DerivativesAreThoseOfTheBranchTaken) {
  using Jet = ceres::Jet<double, 1>;
  const Jet result =
      Parsed("if(x > 0, sqrt(x), 3*x)").Evaluate(std::vector<Jet>{{-1.0, 0}});
  EXPECT_EQ(result.a, -3.0);
  EXPECT_EQ(result.v[0], 3.0);
}

// No operation hides that an operand is outside of its domain.
TEST(Formula, NanIsNanInEveryOperation) {
  using Jet = ceres::Jet<double, 1>;
  for (const char* text : {"if(log(x), 1, 2)",
                           "if(log(x) > 0, 1, 2)",
                           "log(x) < 1",
                           "1 <= log(x)",
                           "log(x) > 1",
                           "1 >= log(x)",
                           "min(0.1, log(x))",
                           "min(log(x), 0.1)",
                           "max(0.1, log(x))",
                           "max(log(x), 0.1)"}) {
    EXPECT_TRUE(std::isnan(Value(text, {-1.0}))) << text;
    const Jet result = Parsed(text).Evaluate(std::vector<Jet>{{-1.0, 0}});
    EXPECT_TRUE(std::isnan(result.a)) << text;
    EXPECT_TRUE(std::isnan(result.v[0])) << text;
  }
}

// The formulas of NIST's models, as --list shows them, agree with the models.
TEST(Formula, IsThatOfTheBuiltInModels) {
  struct Case {
    const char* name;
    const char* text;
  };
  for (const Case& known :
       {Case{"Misra1a", "b1*(1 - exp(-b2*x))"},
        {"Chwirut1", "exp(-b1*x)/(b2 + b3*x)"},
        {"Kirby2", "(b1 + b2*x + b3*x^2)/(1 + b4*x + b5*x^2)"},
        {"Rat43", "b1/(1 + exp(b2 - b3*x))^(1/b4)"},
        {"Eckerle4", "b1/b2*exp(-0.5*((x - b3)/b2)^2)"},
        {"Bennett5", "b1*(b2 + x)^(-1/b3)"}}) {
    const Formula formula = Parsed(known.text);
    for (const NistModel& model : NistModels()) {
      if (model.name != known.name) continue;
      const double x = 1.5;
      std::vector<double> b;
      for (int i = 0; i < model.num_parameters; ++i) b.push_back(0.7 + 0.2 * i);
      std::vector<double> values;
      for (const std::string& name : formula.variables()) {
        values.push_back(name == "x" ? x : b[std::stoi(name.substr(1)) - 1]);
      }
      const double expected = model.value(&x, b.data());
      EXPECT_NEAR(formula.Evaluate(values), expected, 1e-14) << known.name;
    }
  }
}

TEST(Formula, SaysWhatIsWrongAndWhere) {
  const std::vector<std::pair<const char*, const char*>> cases = {
      {"", "empty"},
      {"x +", "Unexpected end"},
      {"sin(x", "parenthesis"},
      {"x)", "character 2"},
      {"2x", "character 2"},
      {"x y", "character 3"},
      {"foo(x)", "functions are exp log"},
      {"sin()", "Too few parameters"},
      {"atan2(x)", "Too few parameters"},
      {"sin(x, x)", "Too many parameters"},
      {"a, b", "several formulas"},
      {"x ? 1 : 2", "if(condition, a, b)"},
      {"x && y", "'&'"},
      {"x = 2", "="},
      {"\"text\"", "'\"'"},
      {"a.b", "character 2"},
      {"1e999*x", "1e999"},
      {"\xC3\xA9*x", "character 1"}};
  for (const auto& [text, part] : cases) {
    Formula formula;
    std::string error;
    EXPECT_FALSE(Formula::Parse(text, &formula, &error)) << text;
    EXPECT_NE(error.find(part), std::string::npos) << text << ": " << error;
  }
}

TEST(Formula, LongTextsAreReadOrRefused) {
  EXPECT_EQ(Value(std::string(1000, '(') + "x" + std::string(1000, ')'), {2.0}),
            2.0);
  Formula formula;
  std::string error;
  EXPECT_FALSE(Formula::Parse(std::string(100000, '('), &formula, &error));
  EXPECT_FALSE(error.empty());
}

}  // namespace formula_test
}  // namespace invgrad
