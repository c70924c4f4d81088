// A linear loss with two different units: the effect of scaling on the step of
// each rule.
//
//   y = P(x) = (u_0 x_0, u_1 x_1),   L = c (y_0 + y_1)
//
// Shapes:  x: 2;  y: 2.
// Units:   u_i is the number of units of y_i in one unit of x_i: x_0 in metres
//          and y_0 in millimetres is u_0 = 1000. c is the loss per unit of y.
// Steps:   with g = c (1, 1) and J = diag(u), a rule's step along x_i is
//            gradient descent      -eta c u_i
//            power kappa           -eta c u_i^-kappa
//              half-inverse        -eta c u_i^-1/2
//              Gauss-Newton        -eta c u_i^-1
//            Adam (first step)     -eta
//          The Hessian is zero: Newton falls back to gradient descent (its
//          fallback_step_size), and there is no automatic step size.
// Optimum: none; L is unbounded below.
// Source:  PBDL, chapter physgrad, "Units" and "Function sensitivity",
//          arXiv 2109.05237.
#ifndef PROBLEMS_LINEAR_SCALE_H_
#define PROBLEMS_LINEAR_SCALE_H_

#include <memory>
#include <string>

#include "invgrad/autodiff_loss.h"
#include "invgrad/compare/problem.h"
#include "invgrad/linear_simulator.h"
#include "invgrad/loss.h"

namespace invgrad {

struct LinearScale {
  double c = 1.0;
  double unit_0 = 1.0;
  double unit_1 = 1000.0;
  void Describe(OptionSet* set) {
    set->Add("c", &c, {0.0, 1e12, true}, "loss per unit of y");
    set->Add("unit_0", &unit_0, {0.0, 1e12, true}, "y_0 per unit of x_0");
    set->Add("unit_1", &unit_1, {0.0, 1e12, true}, "y_1 per unit of x_1");
  }

  struct LinearLoss {
    double c;
    template <typename T>
    bool operator()(const T* y, const double* /*target*/, T* loss) const {
      *loss = c * (y[0] + y[1]);
      return true;
    }
  };

  bool Create(PointProblem* problem, std::string* /*error*/) const {
    const Eigen::Vector2d units(unit_0, unit_1);
    problem->simulator = std::make_shared<LinearSimulator>(
        Eigen::Matrix2d(units.asDiagonal()).sparseView(),
        Eigen::Vector2d::Zero());
    problem->loss =
        std::make_shared<AutoDiffLoss<LinearLoss, 2>>(LinearLoss{c});
    problem->target = Eigen::Vector2d::Zero();
    problem->start = Eigen::Vector2d::Zero();
    return true;
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_LINEAR_SCALE_H_
