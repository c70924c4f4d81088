#include "problems/equations/equation.h"

#include <cmath>
#include <utility>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/chain/equation_simulator.h"
#include "invgrad/chain/loss.h"
#include "invgrad/core/memory_limit.h"
#include "problems/sample_data.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

bool CheckPoints(const Equation& equation,
                 const MatrixXd& data,
                 std::string* error) {
  const Index d = equation.box.lower.size();
  if (!CheckDataShape(data, static_cast<int>(d + 1), error)) return false;
  for (Index s = 0; s < data.rows(); ++s) {
    for (Index i = 0; i < d; ++i) {
      if (data(s, i) >= equation.box.lower[i] &&
          data(s, i) <= equation.box.upper[i]) {
        continue;
      }
      *error = fmt::format(
          "data: row {}, column {} is {:g}; the equation holds in [{:g}, {:g}]",
          s,
          i,
          data(s, i),
          equation.box.lower[i],
          equation.box.upper[i]);
      return false;
    }
    if (!(data(s, d) > 0.0)) {
      *error =
          fmt::format("data: row {}, column {} is {:g}; a weight is positive",
                      s,
                      d,
                      data(s, d));
      return false;
    }
  }
  return true;
}

// Of points, one a column; the weights count up to a factor.
bool MakeSamples(const Equation& equation,
                 const MatrixXd& points,
                 const VectorXd& weights,
                 DataSet* samples,
                 std::string* error) {
  const Index num_points = points.cols();
  MatrixXd conditions;
  if (!equation.trial.Inputs(points, &samples->inputs, error) ||
      !equation.trial.Conditions(points, &conditions, error)) {
    return false;
  }
  const Index size = conditions.rows();
  const int num_context = equation.residual->num_context();
  samples->contexts.resize(size + 1 + num_context, num_points);
  samples->contexts.topRows(size) = conditions;
  samples->contexts.row(size) =
      (weights / weights.mean()).cwiseSqrt().transpose();
  for (Index s = 0; s < num_points && num_context > 0; ++s) {
    samples->contexts(size + 1, s) = equation.right_hand_side(points.col(s));
  }
  samples->targets =
      MatrixXd::Zero(equation.residual->num_outputs(), num_points);
  return true;
}

Metric L2Error(const TrialFunction& trial, VectorXd solution) {
  return {"L2_error",
          [trial, solution = std::move(solution)](const MatrixXd& x,
                                                  const DataSet& samples) {
            CHECK_EQ(samples.num_samples(), solution.size());
            const VectorXd u = trial.Values(x, samples.contexts).row(0);
            return (u - solution).norm() / solution.norm();
          }};
}

}  // namespace

bool CreateEquation(const Equation& equation,
                    LearningProblem* problem,
                    std::string* error) {
  const TrialFunction& trial = equation.trial;
  MatrixXd& data = problem->data;
  const bool is_given = data.size() > 0;
  const double num_points =
      static_cast<double>(is_given ? data.rows()
                                   : equation.train.points.cols()) +
      static_cast<double>(equation.test.cols());
  const double per_point =
      trial.NumInputs() * trial.derivatives->num_channels() +
      trial.ConditionSize();
  if (!FitsInMemory(
          fmt::format("{:g} points", num_points),
          {{"their jets", 3.0 * sizeof(double) * num_points * per_point}},
          0.0,
          error)) {
    return false;
  }
  if (is_given) {
    if (!CheckPoints(equation, data, error)) return false;
  } else {
    data.resize(equation.train.points.cols(), equation.train.points.rows() + 1);
    data << equation.train.points.transpose(), equation.train.weights;
  }
  const Index d = data.cols() - 1;
  if (!MakeSamples(equation,
                   data.leftCols(d).transpose(),
                   data.col(d),
                   &problem->train,
                   error) ||
      !MakeSamples(equation,
                   equation.test,
                   VectorXd::Ones(equation.test.cols()),
                   &problem->test,
                   error)) {
    return false;
  }
  problem->metric = L2Error(trial, equation.solution(equation.test));
  std::vector<int> widths = {trial.NumInputs()};
  widths.insert(widths.end(), equation.hidden.begin(), equation.hidden.end());
  widths.push_back(trial.num_functions);
  problem->model = std::make_shared<Model>(
      DenseNetwork(widths, Activation::kTanh),
      std::make_shared<EquationSimulator>(trial, equation.residual),
      std::make_shared<SquaredNormLoss>(equation.residual->num_outputs(), 0.5),
      Reduction::kMean,
      trial.derivatives);
  problem->num_epochs = 500;
  return true;
}

}  // namespace invgrad
