#include "invgrad/compare/equation_problem.h"

#include <memory>
#include <mutex>
#include <utility>

#include "fmt/core.h"
#include "invgrad/compare/sample_data.h"
#include "invgrad/equation.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

bool CheckPoints(const Box& box, const MatrixXd& data, std::string* error) {
  const Index d = box.lower.size();
  if (!CheckDataShape(data, static_cast<int>(d + 1), error)) return false;
  for (Index s = 0; s < data.rows(); ++s) {
    for (Index i = 0; i < d; ++i) {
      if (data(s, i) >= box.lower[i] && data(s, i) <= box.upper[i]) continue;
      *error = fmt::format(
          "data: row {}, column {} is {:g}; the equation holds in [{:g}, {:g}]",
          s,
          i,
          data(s, i),
          box.lower[i],
          box.upper[i]);
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

// u* at points, computed when it is first used: a reference may take longer than
// all the rest.
class LazySolution {
 public:
  LazySolution(EquationProblem of, MatrixXd points)
      : of_(std::move(of)), points_(std::move(points)) {}

  const VectorXd& Values() const {
    std::call_once(once_, [this] { values_ = of_.SolutionAt(points_); });
    return values_;
  }

 private:
  const EquationProblem of_;
  const MatrixXd points_;
  mutable std::once_flag once_;
  mutable VectorXd values_;
};

Metric L2Error(const TrialFunction& trial,
               std::shared_ptr<const LazySolution> solution) {
  return {"L2_error",
          [trial, solution = std::move(solution)](const MatrixXd& x,
                                                  const DataSet& samples) {
            const VectorXd& truth = solution->Values();
            CHECK_EQ(samples.num_samples(), truth.size());
            const VectorXd u = trial.Values(x, samples.contexts).row(0);
            return (u - truth).norm() / truth.norm();
          }};
}

// For pictures of functions of two coordinates.
FunctionOnGrid PictureOf(const EquationProblem& of,
                         std::shared_ptr<const LazySolution> solution) {
  FunctionOnGrid picture;
  picture.rows = of.test_counts[0];
  picture.truth = [solution = std::move(solution)] {
    return solution->Values();
  };
  picture.values = [trial = of.equation.trial](const MatrixXd& x,
                                               const DataSet& samples) {
    return VectorXd(trial.Values(x, samples.contexts).row(0));
  };
  return picture;
}

}  // namespace

void PointOptions::Describe(OptionSet* set) {
  set->Add("points",
           &points,
           {"fixed", "sequence", "residual"},
           "the same at all steps; new ones of a low-discrepancy sequence; new "
           "ones drawn by the residual");
  set->Add("renewal", &renewal, {1, 1e9}, "steps after which points are new");
}

VectorXd EquationProblem::SolutionAt(const MatrixXd& points) const {
  if (solution_at != nullptr) return solution_at(points);
  if (!HasSolution()) return VectorXd();
  VectorXd values(points.cols());
  for (Index s = 0; s < points.cols(); ++s) values[s] = solution(points.col(s));
  return values;
}

bool CreateEquationProblem(const EquationProblem& of,
                           LearningProblem* problem,
                           std::string* error) {
  Equation equation = of.equation;
  QuadraturePoints& points = equation.terms[0].points;
  MatrixXd& data = problem->data;
  if (data.size() > 0) {
    if (!CheckPoints(of.box, data, error)) return false;
    const Index d = data.cols() - 1;
    points.points = data.leftCols(d).transpose();
    points.weights = data.col(d) / data.col(d).sum();
  } else {
    data.resize(points.points.cols(), points.points.rows() + 1);
    data << points.points.transpose(), points.weights;
  }
  const MatrixXd test =
      of.test_points.size() > 0
          ? of.test_points
          : GridPoints(of.test_box.value_or(of.box), of.test_counts);
  const VectorXd equal =
      VectorXd::Constant(test.cols(), 1.0 / static_cast<double>(test.cols()));
  if (!EquationSamples(equation, &problem->train, error) ||
      !TermSamples(equation, 0, {test, equal}, &problem->test, error)) {
    return false;
  }
  if (of.points.points != "fixed") {
    problem->source = std::make_shared<RenewedPoints>(
        equation,
        of.box,
        RenewedPoints::Options{of.points.renewal,
                               of.points.points == "residual"});
  }
  if (of.HasSolution()) {
    const auto solution = std::make_shared<const LazySolution>(of, test);
    problem->metric = L2Error(equation.trial, solution);
    if (of.test_counts.size() == 2) {
      problem->function_on_grid = PictureOf(of, solution);
    }
  }
  problem->model = std::make_shared<Model>(EquationModel(equation));
  problem->num_epochs = 500;
  return true;
}

}  // namespace invgrad
