// A small network with an ill-conditioned scaling of its outputs. Gradient
// descent stalls, Gauss-Newton saturates the neurons, the half-inverse avoids
// both.
//
//   y = P(f(a)) = (f_0, lambda f_1),   y*(a) = (sin 6a, cos 9a)
//   L = 1/2 |y - y*|^2,   a in [-1, 1]
//
// Shapes:  network 1-7-2, tanh, 30 weights;  x = f(a): 2;  y: 2.
// Units:   lambda scales the network's second output, not its target: at
//          lambda = 0.01 its output must be 100 cos 9a.
// Data:    num_samples equidistant a in [-1, 1] (the book does not say which);
//          no test data.
// Facts:   L = 1/2 |y*|^2 averages to about 1/2 at y = 0. Final losses read off
//          the book's figures: lambda = 1: Adam 4.2e-3, Gauss-Newton 1.16e-3,
//          half-inverse 4.7e-4; lambda = 0.01: 0.24, 0.40, 2.9e-3.
// Source:  PBDL, chapter physgrad-hig, section "Toy example", arXiv 2109.05237;
//          Schnell, Holl, Thuerey, ICLR 2022, section 3.1, arXiv 2203.10131.
#ifndef PROBLEMS_TOY_NETWORK_H_
#define PROBLEMS_TOY_NETWORK_H_

#include <cmath>
#include <memory>
#include <string>

#include "fmt/core.h"
#include "invgrad/compare/problem.h"
#include "invgrad/linear_simulator.h"
#include "invgrad/loss.h"

namespace invgrad {

struct ToyNetwork {
  double lambda = 1.0;
  int num_samples = 256;
  int num_hidden = 7;
  void Describe(OptionSet* set) {
    set->Add("lambda", &lambda, {0.0, 1e6, true}, "scale of y_1");
    set->Add("num_samples", &num_samples, {2, 1e6}, "samples in [-1, 1]");
    set->Add("num_hidden", &num_hidden, {1, 1000}, "hidden neurons");
  }

  bool Create(LearningProblem* problem, std::string* error) const {
    Eigen::MatrixXd& a = problem->data;
    if (a.size() == 0) a = Eigen::VectorXd::LinSpaced(num_samples, -1.0, 1.0);
    if (a.cols() != 1) {
      *error = fmt::format("data must have shape (samples, 1), found ({}, {})",
                           a.rows(),
                           a.cols());
      return false;
    }
    const Eigen::Vector2d scale(1.0, lambda);
    problem->model = std::make_shared<Model>(
        DenseNetwork({1, num_hidden, 2}, Activation::kTanh),
        std::make_shared<LinearSimulator>(
            Eigen::Matrix2d(scale.asDiagonal()).sparseView(),
            Eigen::Vector2d::Zero()),
        std::make_shared<SquaredNormLoss>(2, 0.5),
        Reduction::kMean);
    problem->train.inputs = a.transpose();
    problem->train.contexts.resize(0, a.rows());
    problem->train.targets.resize(2, a.rows());
    problem->train.targets.row(0) = (6.0 * a.array()).sin().transpose();
    problem->train.targets.row(1) = (9.0 * a.array()).cos().transpose();
    problem->test = problem->train.Range(0, 0);
    problem->num_epochs = 5000;
    return true;
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_TOY_NETWORK_H_
