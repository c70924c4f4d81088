#include "invgrad/equation.h"

#include <cmath>

#include "fmt/core.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/dense_network.h"
#include "invgrad/equations/equation_simulator.h"
#include "invgrad/internal/logging.h"
#include "invgrad/loss.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

std::shared_ptr<const EquationSimulator> MakeSimulator(
    const Equation& equation) {
  CHECK(equation.trial.derivatives != nullptr)
      << "the equation has no trial.derivatives";
  CHECK(!equation.terms.empty()) << "the equation has no terms";
  std::vector<EquationResidual> residuals;
  for (const EquationTerm& term : equation.terms) {
    CHECK(term.residual != nullptr) << term.name << ": it has no residual";
    residuals.push_back({term.name, term.residual});
  }
  return std::make_shared<EquationSimulator>(
      equation.trial,
      std::move(residuals),
      static_cast<int>(equation.coefficients.size()));
}

bool CheckMemory(const TrialFunction& trial,
                 double num_points,
                 std::string* error) {
  const double per_point =
      trial.NumInputs() * trial.derivatives->num_channels() +
      trial.ConditionSize();
  return FitsInMemory(
      fmt::format("{:g} points", num_points),
      {{"their jets", 3.0 * sizeof(double) * num_points * per_point}},
      0.0,
      error);
}

// Writes the samples of term k to the columns first, first + 1, ..; `scale`: y
// = sqrt(scale w_s) R_k.
bool WriteTerm(const Equation& equation,
               int k,
               const QuadraturePoints& points,
               double scale,
               Index first,
               DataSet* samples,
               std::string* error) {
  const EquationTerm& term = equation.terms[k];
  const Index count = points.points.cols();
  CHECK_EQ(points.weights.size(), count)
      << term.name << ": one weight a point.";
  CHECK_EQ(points.points.rows(), equation.trial.derivatives->num_variables())
      << term.name << ": a column of coordinates a point.";
  CHECK_EQ(term.context != nullptr, term.residual->num_context() > 0)
      << term.name << ": its residual has a context, or has none.";
  if (!(scale >= 0.0 && (points.weights.array() >= 0.0).all())) {
    *error = fmt::format(
        "{}: a weight of the term or of a point is negative or not a number; "
        "allowed: 0 and above",
        term.name);
    return false;
  }
  MatrixXd inputs, conditions;
  if (!equation.trial.Inputs(points.points, &inputs, error) ||
      !equation.trial.Conditions(points.points, &conditions, error)) {
    *error = term.name + ": " + *error;
    return false;
  }
  samples->inputs.middleCols(first, count) = inputs;
  const EquationContext layout(equation.trial,
                               static_cast<int>(equation.coefficients.size()),
                               term.residual->num_context());
  auto contexts = samples->contexts.middleCols(first, count);
  contexts.setZero();
  contexts.topRows(conditions.rows()) = conditions;
  contexts.row(layout.weight) =
      (scale * points.weights).cwiseSqrt().transpose();
  contexts.row(layout.term).setConstant(k);
  contexts.middleRows(layout.point, layout.num_coordinates) = points.points;
  contexts.middleRows(layout.coefficients, layout.num_coefficients).colwise() =
      equation.coefficients;
  VectorXd c(term.residual->num_context());
  for (Index s = 0; s < count && c.size() > 0; ++s) {
    term.context(points.points.col(s), s, c);
    if (!c.allFinite()) {
      *error = fmt::format(
          "{}: its context is not finite at point {}", term.name, s);
      return false;
    }
    contexts.col(s).segment(layout.of_residual, c.size()) = c;
  }
  return true;
}

bool MakeSpace(const Equation& equation,
               Index num_points,
               DataSet* samples,
               std::string* error) {
  const auto simulator = MakeSimulator(equation);
  if (!CheckMemory(equation.trial, static_cast<double>(num_points), error)) {
    return false;
  }
  *samples = DataSet();
  samples->inputs.resize(
      equation.trial.NumInputs() * equation.trial.derivatives->num_channels(),
      num_points);
  samples->contexts.resize(simulator->num_context(), num_points);
  samples->targets = MatrixXd::Zero(simulator->num_outputs(), num_points);
  return true;
}

}  // namespace

Index NumPoints(const Equation& equation) {
  Index count = 0;
  for (const EquationTerm& term : equation.terms) {
    count += term.points.points.cols();
  }
  return count;
}

Model EquationModel(const Equation& equation) {
  const auto simulator = MakeSimulator(equation);
  std::vector<int> widths = {equation.trial.NumInputs()};
  widths.insert(widths.end(), equation.hidden.begin(), equation.hidden.end());
  widths.push_back(equation.trial.num_functions);
  return Model(DenseNetwork(widths, Activation::kTanh),
               simulator,
               std::make_shared<SquaredNormLoss>(simulator->num_outputs(), 0.5),
               Reduction::kMean,
               equation.trial.derivatives);
}

bool EquationSamples(const Equation& equation,
                     DataSet* samples,
                     std::string* error) {
  const Index num_points = NumPoints(equation);
  if (!MakeSpace(equation, num_points, samples, error)) return false;
  Index first = 0;
  for (std::size_t k = 0; k < equation.terms.size(); ++k) {
    const EquationTerm& term = equation.terms[k];
    if (!WriteTerm(equation,
                   static_cast<int>(k),
                   term.points,
                   term.weight * static_cast<double>(num_points),
                   first,
                   samples,
                   error)) {
      return false;
    }
    first += term.points.points.cols();
  }
  return true;
}

bool TermSamples(const Equation& equation,
                 int k,
                 const QuadraturePoints& points,
                 DataSet* samples,
                 std::string* error) {
  const Index num_points = points.points.cols();
  return MakeSpace(equation, num_points, samples, error) &&
         WriteTerm(equation,
                   k,
                   points,
                   static_cast<double>(num_points),
                   0,
                   samples,
                   error);
}

bool Solution(const Equation& equation,
              const VectorXd& weights,
              const MatrixXd& points,
              MatrixXd* u,
              std::string* error) {
  MatrixXd inputs, conditions;
  if (!CheckMemory(equation.trial, static_cast<double>(points.cols()), error) ||
      !equation.trial.Inputs(points, &inputs, error) ||
      !equation.trial.Conditions(points, &conditions, error)) {
    return false;
  }
  const Model model = EquationModel(equation);
  DataSet samples;
  samples.inputs = std::move(inputs);
  // u does not depend on the other rows.
  samples.contexts =
      MatrixXd::Zero(model.simulator().num_context(), points.cols());
  samples.contexts.topRows(conditions.rows()) = conditions;
  const auto pass = model.network().NewPass();
  if (!model.Forward(
          weights, samples, Network::Derivatives::kNone, pass.get(), error)) {
    return false;
  }
  *u = equation.trial.Values(model.SimulatorInputs(*pass), conditions)
           .topRows(equation.trial.num_functions);
  return true;
}

}  // namespace invgrad
