// The regression of a user's own formula on a table or on a file of NIST's form.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "fmt/ranges.h"
#include "invgrad/core/specification.h"
#include "invgrad/io/atomic_file.h"
#include "problems/estimation/data_table.h"
#include "problems/estimation/estimation.h"
#include "problems/estimation/formula_model.h"
#include "problems/estimation/named_values.h"
#include "problems/estimation/nist_file.h"
#include "problems/estimation/nist_models.h"
#include "problems/estimation/regression_estimation.h"
#include "problems/estimation/text_cursor.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// The file, as a table, and what a file of NIST's form has more.
struct Input {
  std::string path;
  DataTable table;
  std::optional<NistData> nist;
};

// y, x or y, x1, x2, ...
DataTable TableOf(const NistData& data) {
  DataTable table;
  table.names = {"y"};
  const Index p = data.predictors.cols();
  for (Index k = 1; k <= p; ++k) {
    table.names.push_back(p == 1 ? "x" : fmt::format("x{}", k));
  }
  for (Index i = 0; i < data.responses.size(); ++i) {
    table.rows.push_back({fmt::format("{}", data.responses[i])});
    for (const double x : data.predictors.row(i)) {
      table.rows.back().push_back(fmt::format("{}", x));
    }
    table.line_numbers.push_back(i + 1);
  }
  return table;
}

bool ReadInput(const std::string& path, Input* input, std::string* error) {
  input->path = path;
  std::string text;
  if (!ReadFile(path, &text, error)) return false;
  if (text.find("Dataset Name:") == std::string::npos) {
    return ParseTable(text, path, &input->table, error);
  }
  NistData data;
  if (!ParseNist(text, path, &data, error)) return false;
  input->table = TableOf(data);
  input->nist = std::move(data);
  return true;
}

bool ParseNamedFormula(const std::string& flag,
                       const std::string& text,
                       Formula* formula,
                       std::string* error) {
  if (Formula::Parse(text, formula, error)) return true;
  *error = fmt::format("--{}={}: {}", flag, Printable(text, 200), *error);
  return false;
}

// The values of a formula of columns, for every row.
bool EvaluateColumns(const Input& input,
                     const std::string& flag,
                     const std::string& text,
                     VectorXd* result,
                     std::string* error) {
  Formula formula;
  if (!ParseNamedFormula(flag, text, &formula, error)) return false;
  std::vector<VectorXd> columns;
  for (const std::string& name : formula.variables()) {
    const int column = input.table.FindColumn(name);
    if (column < 0) {
      *error = fmt::format("--{}={}: there is no column '{}'; there are {}",
                           flag,
                           Printable(text, 200),
                           name,
                           fmt::join(input.table.names, ", "));
      return false;
    }
    columns.emplace_back();
    if (!ReadColumn(input.table, column, input.path, &columns.back(), error)) {
      return false;
    }
  }
  const auto m = static_cast<Index>(input.table.rows.size());
  result->resize(m);
  std::vector<double> values(columns.size());
  for (Index i = 0; i < m; ++i) {
    for (std::size_t k = 0; k < columns.size(); ++k) values[k] = columns[k][i];
    (*result)[i] = formula.Evaluate(values);
    if (std::isfinite((*result)[i])) continue;
    *error = fmt::format("{}:{}: {} is not finite",
                         input.path,
                         input.table.line_numbers[i],
                         Printable(text, 200));
    return false;
  }
  return true;
}

// "y = b1*x" -> "y", "b1*x"; "b1*x" -> "", "b1*x".
std::pair<std::string, std::string> SplitModel(const std::string& model) {
  for (std::size_t i = 0; i < model.size(); ++i) {
    if (model[i] != '=') continue;
    const bool is_comparison =
        i > 0 && (model[i - 1] == '<' || model[i - 1] == '>');
    if (!is_comparison) {
      return {std::string(Trimmed(std::string_view(model).substr(0, i))),
              std::string(Trimmed(std::string_view(model).substr(i + 1)))};
    }
  }
  return {"", std::string(Trimmed(model))};
}

// Weights of residuals: from weights of their squares, or from deviations.
bool ReadWeights(const Input& input,
                 const RegressionOptions& options,
                 VectorXd* weights,
                 std::string* error) {
  weights->setOnes(static_cast<Index>(input.table.rows.size()));
  if (!options.weights.empty() && !options.deviations.empty()) {
    *error = "--weights and --deviations: expected one of them";
    return false;
  }
  const bool is_weight = options.deviations.empty();
  const std::string& text = is_weight ? options.weights : options.deviations;
  if (text.empty()) return true;
  const std::string flag = is_weight ? "weights" : "deviations";
  if (!EvaluateColumns(input, flag, text, weights, error)) return false;
  for (Index i = 0; i < weights->size(); ++i) {
    double& weight = (*weights)[i];
    if (is_weight ? weight < 0.0 : weight <= 0.0) {
      *error = fmt::format("{}:{}: --{}={} is {}; expected {}",
                           input.path,
                           input.table.line_numbers[i],
                           flag,
                           Printable(text, 200),
                           weight,
                           is_weight ? "0 or more" : "a positive number");
      return false;
    }
    weight = is_weight ? std::sqrt(weight) : 1.0 / weight;
  }
  return true;
}

// Splits the variables of the formula into predictors, whose columns are read,
// and parameters, whose names are returned. Those of a file of NIST's form are
// b1, b2, ..., in its order.
bool ReadVariables(const Input& input,
                   FormulaModel* model,
                   Regression* regression,
                   std::string* error) {
  std::vector<VectorXd> columns;
  for (const std::string& name : model->formula.variables()) {
    const int column = input.table.FindColumn(name);
    if (column < 0) {
      regression->names.push_back(name);
      continue;
    }
    columns.emplace_back();
    regression->x_label = name;
    if (!ReadColumn(input.table, column, input.path, &columns.back(), error)) {
      return false;
    }
  }
  if (input.nist) {
    std::stable_sort(regression->names.begin(),
                     regression->names.end(),
                     [](const std::string& a, const std::string& b) {
                       return std::pair(a.size(), a) < std::pair(b.size(), b);
                     });
  }
  int num_predictors = 0;
  for (const std::string& name : model->formula.variables()) {
    const auto parameter =
        std::find(regression->names.begin(), regression->names.end(), name);
    model->sources.push_back(
        parameter == regression->names.end()
            ? num_predictors++
            : -1 - static_cast<int>(parameter - regression->names.begin()));
  }
  std::vector<bool> are_predictors;
  for (const int source : model->sources) are_predictors.push_back(source >= 0);
  model->formula.SetConstants(are_predictors);
  regression->predictors.resize(static_cast<Index>(input.table.rows.size()),
                                num_predictors);
  for (int k = 0; k < num_predictors; ++k) {
    regression->predictors.col(k) = columns[k];
  }
  return true;
}

// Whether the parameters are those of the file of NIST's form.
bool HasNistParameters(const Input& input, const Regression& regression) {
  if (!input.nist || static_cast<int>(regression.names.size()) !=
                         input.nist->num_parameters()) {
    return false;
  }
  for (std::size_t i = 0; i < regression.names.size(); ++i) {
    if (regression.names[i] != fmt::format("b{}", i + 1)) return false;
  }
  return true;
}

bool ReadStarts(const Input& input,
                const RegressionOptions& options,
                Regression* regression,
                std::string* error) {
  const auto n = static_cast<Index>(regression->names.size());
  if (n == 0) {
    *error = fmt::format(
        "--model={}: there is no parameter; every name is a column of {}",
        Printable(options.model, 200),
        input.path);
    return false;
  }
  if (options.start_values.empty() && HasNistParameters(input, *regression)) {
    regression->starts = input.nist->starts;
  } else {
    regression->starts.resize(n, 1);
    if (!ReadStartValues(options.start_values,
                         regression->names,
                         fmt::format("{}", fmt::join(input.table.names, ", ")),
                         regression->starts.data(),
                         error)) {
      return false;
    }
  }
  if (options.bounds.empty()) return true;
  return ReadBounds(options.bounds,
                    regression->names,
                    regression->starts,
                    &regression->lower_bounds,
                    &regression->upper_bounds,
                    error);
}

// The certified values of a file of NIST's form, if the model has these
// parameters and, for them, the certified sum of squares.
void SetCertificate(const Input& input,
                    const RegressionOptions& options,
                    Regression* regression) {
  const bool has_weights =
      !options.weights.empty() || !options.deviations.empty();
  if (has_weights || !HasNistParameters(input, *regression)) return;
  double sum = 0.0;
  for (Index i = 0; i < regression->responses.size(); ++i) {
    const VectorXd x = regression->predictors.row(i);
    const double residual =
        regression->responses[i] -
        regression->value(x.data(), input.nist->certified.data());
    sum += residual * residual;
  }
  if (!HasCertifiedSum(*input.nist, regression->responses, sum)) return;
  regression->certified = input.nist->certified;
  regression->certified_deviations = input.nist->standard_deviations;
}

// The table, with the parameters as comments, the fit and the residuals.
bool WriteFit(const Input& input,
              const Regression& regression,
              const std::string& path,
              const VectorXd& b,
              std::string* error) {
  DataTable table = input.table;
  for (const char* name : {"fit", "residual"}) {
    table.names.push_back(table.NewName(name));
  }
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const auto row = static_cast<Index>(i);
    const VectorXd x = regression.predictors.row(row);
    const double fit = regression.value(x.data(), b.data());
    table.rows[i].push_back(fmt::format("{}", fit));
    table.rows[i].push_back(fmt::format("{}", regression.responses[row] - fit));
  }
  std::string text;
  for (std::size_t k = 0; k < regression.names.size(); ++k) {
    const double value = b[static_cast<Index>(k)];
    if (!std::isfinite(value)) {
      *error =
          fmt::format("cannot write {}: {} is {}; expected a finite double",
                      path,
                      regression.names[k],
                      value);
      return false;
    }
    text += fmt::format("# {} = {}\n", regression.names[k], value);
  }
  return WriteFile(path, text + TableText(table), error);
}

}  // namespace

std::unique_ptr<Estimation> ReadFormulaEstimation(
    const std::string& path,
    const ReadEstimationOptions& options,
    std::string* error) {
  const RegressionOptions& given = options.regression;
  if (given.model.empty()) {
    *error = path +
             ": expected --model, the formula of the response, such as "
             "--model=\"y = b1*(1 - exp(-b2*x))\"";
    return nullptr;
  }
  Input input;
  if (!ReadInput(path, &input, error)) return nullptr;
  auto [response, right_side] = SplitModel(given.model);
  if (response.empty()) response = "y";
  if (response == "y" && input.table.FindColumn(response) < 0) {
    *error = fmt::format(
        "--model={}: there is no column y in {}; expected --model=\"COLUMN = "
        "...\" with one of {}",
        Printable(given.model, 200),
        path,
        fmt::join(input.table.names, ", "));
    return nullptr;
  }
  auto model = std::make_shared<FormulaModel>();
  Regression regression;
  if (!EvaluateColumns(
          input, "model", response, &regression.responses, error) ||
      !ParseNamedFormula("model", right_side, &model->formula, error) ||
      !ReadVariables(input, model.get(), &regression, error) ||
      !ReadStarts(input, given, &regression, error) ||
      !ReadWeights(input, given, &regression.weights, error)) {
    return nullptr;
  }
  const auto m = (regression.weights.array() > 0.0).count();
  const auto n = static_cast<Index>(regression.names.size());
  const auto num_ignored = regression.weights.size() - m;
  const std::string ignored =
      num_ignored > 0 ? fmt::format(" (and {} of weight 0)", num_ignored) : "";
  if (m < n) {
    *error =
        fmt::format("{}: {} rows{}; expected no fewer than the {} parameters",
                    path,
                    m,
                    ignored,
                    n);
    return nullptr;
  }
  regression.title = input.nist
                         ? input.nist->name
                         : std::filesystem::path(path).filename().string();
  regression.y_label = response;
  regression.value = [model](const double* x, const double* b) {
    return model->Evaluate<double>(x, [b](int k) { return b[k]; });
  };
  regression.make_cost = [model, n](const double* x, double y, double weight) {
    return MakeFormulaCost(model, n, x, y, weight);
  };
  SetCertificate(input, given, &regression);
  EstimationTraits traits;
  traits.description = fmt::format("{} observations{}, {} parameters; {} = {}",
                                   m,
                                   ignored,
                                   n,
                                   response,
                                   right_side);
  if (HasNistParameters(input, regression) &&
      regression.certified.size() == 0) {
    traits.description += "; the certified values are not of this model";
  }
  traits.has_unit_variance = !given.deviations.empty();
  if (HasNistParameters(input, regression)) {
    traits.extension = ".dat";
    regression.write = NistWriter(*input.nist);
  } else {
    traits.extension = ".fit.csv";
    regression.write = [input, regression](const std::string& to,
                                           const VectorXd& b,
                                           std::string* why) {
      return WriteFit(input, regression, to, b, why);
    };
  }
  return MakeRegressionEstimation(std::move(traits), std::move(regression));
}

}  // namespace invgrad
