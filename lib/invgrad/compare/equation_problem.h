// A differential equation as a learning problem. A problem of yours is a struct
// with `bool Create(EquationProblem* problem, std::string* error) const`
// (problem.h).
//
// Data:    the points of the equation, rows (coordinates, weight); those of
//          other terms stay. All are one batch. For testing a grid with its
//          faces.
// Metric:  L2_error, |u - u*|_2 / |u*|_2 over the points for testing, if a
//          solution u* is given.
#ifndef INVGRAD_COMPARE_EQUATION_PROBLEM_H_
#define INVGRAD_COMPARE_EQUATION_PROBLEM_H_

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/compare/problem.h"
#include "invgrad/equation.h"
#include "invgrad/equation_points.h"
#include "invgrad/option_set.h"

namespace invgrad {

// Which points a step has.
struct PointOptions {
  std::string points = "fixed";
  int renewal = 50;
  // The options points and renewal.
  void Describe(OptionSet* set);
};

struct EquationProblem {
  Equation equation;  // the first term is the equation itself
  Box box;
  PointOptions points;
  // u* of the first function at a point, or at points, one a column; none if
  // neither is set.
  std::function<double(const Eigen::VectorXd& point)> solution;
  std::function<Eigen::VectorXd(const Eigen::MatrixXd& points)> solution_at;
  // The grid for testing: points a coordinate, and its box, if it is another
  // one.
  std::vector<int> test_counts;
  std::optional<Box> test_box;
  // In place of the grid, unless empty: points, one a column.
  Eigen::MatrixXd test_points;

  bool HasSolution() const {
    return solution != nullptr || solution_at != nullptr;
  }
  // u* at points, one a column; empty if it is not known.
  Eigen::VectorXd SolutionAt(const Eigen::MatrixXd& points) const;
};

// `problem->data`, if any, are points of the first term. Returns false, with
// *error, if they are not of d + 1 columns, lie outside the box, have a weight
// that is not positive, or if there is too little memory.
bool CreateEquationProblem(const EquationProblem& equation_problem,
                           LearningProblem* problem,
                           std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_COMPARE_EQUATION_PROBLEM_H_
