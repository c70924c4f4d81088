// The two-dimensional example of the book's comparison of update rules.
//
//   y = P(x) = (x_0, x_1^2),   L = |y|^2
//
// Shapes:  x: 2;  y: 2.
// Units:   none. The loss has no 1/2, so that the book's step sizes are ours.
// Start:   x = (3, 3), L = 90, dL/dy = (6, 18), dL/dx = (6, 108).
// Optimum: x = (0, 0), L = 0; the Hessian is singular there in x_1, so Newton's
//          method converges only linearly, x_1 <- (1 - eta / 3) x_1, while
//          x_0 <- (1 - eta) x_0.
// Inverse: x = (y_0, sign(x_now_1) sqrt(y_1)), of the two pre-images the one on
//          the side of x_now.
// Source:  PBDL, chapter physgrad-comparison, arXiv 2109.05237.
#ifndef PROBLEMS_SQUARED_COMPONENT_H_
#define PROBLEMS_SQUARED_COMPONENT_H_

#include <cmath>
#include <memory>
#include <optional>
#include <string>

#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/problem.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/loss.h"

namespace invgrad {

struct SquaredComponent {
  double start_0 = 3.0;
  double start_1 = 3.0;
  void Describe(OptionSet* set) {
    set->Add("start_0", &start_0, {}, "x_0 at the start");
    set->Add("start_1", &start_1, {}, "x_1 at the start");
  }

  struct Physics {
    template <typename T>
    bool operator()(const T* x, T* y) const {
      y[0] = x[0];
      y[1] = x[1] * x[1];
      return true;
    }
  };

  bool Create(PointProblem* problem, std::string* /*error*/) const {
    problem->simulator = std::make_shared<AutoDiffSimulator<Physics, 2, 2>>();
    problem->inverse = Inverse(
        [](const auto& y, const auto& x_now) -> std::optional<Eigen::VectorXd> {
          if (y[1] < 0.0) return std::nullopt;
          return Eigen::Vector2d(y[0],
                                 std::copysign(std::sqrt(y[1]), x_now[1]));
        });
    problem->loss = std::make_shared<SquaredNormLoss>(2, 1.0);
    problem->target = Eigen::Vector2d::Zero();
    problem->start = Eigen::Vector2d(start_0, start_1);
    problem->minimizer = Eigen::Vector2d::Zero();
    problem->minimum = 0.0;
    return true;
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_SQUARED_COMPONENT_H_
