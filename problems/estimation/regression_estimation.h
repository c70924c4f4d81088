// The estimation of a regression: responses are a function of predictors.
//
//   residual_i = weight_i (y_i - f(x_i; b))
//
// One residual block an observation; none if its weight is 0.
#ifndef PROBLEMS_ESTIMATION_REGRESSION_ESTIMATION_H_
#define PROBLEMS_ESTIMATION_REGRESSION_ESTIMATION_H_

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/cost_function.h"
#include "problems/estimation/estimation.h"

namespace invgrad {

struct Regression {
  std::string title;
  std::string x_label = "x";  // if there is one predictor
  std::string y_label = "y";
  bool shows_logarithms = false;  // of the responses, in pictures
  Eigen::VectorXd responses;      // m
  Eigen::MatrixXd predictors;     // m x p
  Eigen::VectorXd weights;        // m, of the residuals
  Eigen::MatrixXd starts;         // n x the number of starts
  // Of the parameters, each a parameter block; empty: one block, "b".
  std::vector<std::string> names;
  // Of the parameters; empty: none.
  Eigen::VectorXd lower_bounds;
  Eigen::VectorXd upper_bounds;
  // Of the block b, those in which f is affine.
  std::vector<int> linear;
  // Empty: there are none.
  Eigen::VectorXd certified;
  Eigen::VectorXd certified_deviations;

  // f(x; b), and the residual of an observation, which the caller owns.
  std::function<double(const double* x, const double* b)> value;
  std::function<ceres::CostFunction*(const double* x, double y, double weight)>
      make_cost;
  // Writes the parameters b.
  std::function<bool(
      const std::string& path, const Eigen::VectorXd& b, std::string* error)>
      write;
};

// Sets num_starts, linear_solver and budget of the traits: full accuracy, as in
// Ceres' examples/nist.cc.
std::unique_ptr<Estimation> MakeRegressionEstimation(EstimationTraits traits,
                                                     Regression regression);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_REGRESSION_ESTIMATION_H_
