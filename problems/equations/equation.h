// A differential equation as a learning problem: a physics-informed network.
//
//   minimize  L = 1/2 mean over the box of R(D u)^2,   u = g + d N
//
// A sample is a point of the box, with a quadrature weight w (points.h):
// y = sqrt(w N) R. The train data are arrays of rows (coordinates, w).
//
// Metric:  L2_error, |u - u*|_2 / |u*|_2 over the points for testing.
#ifndef PROBLEMS_EQUATIONS_EQUATION_H_
#define PROBLEMS_EQUATIONS_EQUATION_H_

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/chain/simulator.h"
#include "invgrad/chain/trial_function.h"
#include "problems/equations/points.h"
#include "problems/problem.h"

namespace invgrad {

struct Equation {
  TrialFunction trial;
  // R; its context is the right-hand side at the point, if it has one.
  std::shared_ptr<const Simulator> residual;
  std::function<double(const Eigen::VectorXd& point)> right_hand_side;
  // u* of the first function at points, one a column.
  std::function<Eigen::VectorXd(const Eigen::MatrixXd& points)> solution;
  Box box;
  QuadraturePoints train;
  Eigen::MatrixXd test;     // d x N
  std::vector<int> hidden;  // widths of tanh layers
};

// `problem->data`, if any, replace equation.train. Returns false, with *error,
// if they are not of d + 1 columns, lie outside the box, have a weight that is not
// positive, or if there is too little memory.
bool CreateEquation(const Equation& equation,
                    LearningProblem* problem,
                    std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_EQUATIONS_EQUATION_H_
