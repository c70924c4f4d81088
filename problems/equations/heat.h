// The heat equation in one dimension, solved by a physics-informed network.
//
//   u_t = 1/4 u_xx,   u(0, x) = sin(pi x),   u(t, 0) = u(t, 1) = 0
//
// on 0 <= t, x <= 1. All conditions hold exactly,
//
//   u = sin(pi x) + 4 t x (1 - x) N(2 t - 1, 2 x - 1)
//
// Shapes:  network 2-64-1, tanh: 257 weights, as in the source; x: N, N_t,
//          N_xx, N_x.
// Data:    Gauss points, rows (t, x, weight); all are one batch. For testing a
//          grid of 41 x 41 points with its faces.
// Metric:  L2_error, relative.
// Facts:   u = exp(-pi^2 t / 4) sin(pi x). Published: a root mean square error
//          of 2.7e-8, which is 8.5e-8 relative, by ENGD, 1,000 s on a GPU, with
//          the conditions as terms of the loss.
// Source:  Dangel, Mueller, Zeinhofer. Kronecker-Factored Approximate Curvature
//          for Physics-Informed Neural Networks. NeurIPS 2024. arXiv
//          2405.15603.
#ifndef PROBLEMS_EQUATIONS_HEAT_H_
#define PROBLEMS_EQUATIONS_HEAT_H_

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/equation_problem.h"
#include "invgrad/equation_points.h"

namespace invgrad {

struct HeatResidual {
  // u: u, u_t, Lap u.
  template <typename T>
  bool operator()(const T* u, T* y) const {
    y[0] = u[1] - 0.25 * u[2];
    return true;
  }
};

struct HeatPinn {
  int num_t = 40;
  int num_x = 40;
  PointOptions points;
  void Describe(OptionSet* set) {
    set->Add("num_t", &num_t, {1, 1000}, "Gauss points in t");
    set->Add("num_x", &num_x, {1, 1000}, "Gauss points in x");
    points.Describe(set);
  }

  static double Solution(const Eigen::VectorXd& point) {
    return std::exp(-0.25 * M_PI * M_PI * point[0]) * std::sin(M_PI * point[1]);
  }

  bool Create(LearningProblem* problem, std::string* error) const {
    EquationProblem heat;
    TrialFunction& trial = heat.equation.trial;
    trial.derivatives = std::make_shared<DerivativeSet>(
        "tx", std::vector<std::string>{"t", "xx"});
    trial.boundary_values = [](const InputJet* a, InputJet* g) {
      g[0] = sin(M_PI * a[1]);
    };
    trial.distance = [](const InputJet* a, InputJet* d) {
      d[0] = 4.0 * a[0] * a[1] * (1.0 - a[1]);
    };
    heat.box = {Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(1.0, 1.0)};
    trial.features = ScaledFeatures(heat.box);
    heat.equation.terms = {
        {"equation",
         std::make_shared<AutoDiffSimulator<HeatResidual, 3, 1>>(),
         GaussPoints(heat.box, {num_t, num_x})}};
    heat.equation.hidden = {64};
    heat.points = points;
    heat.solution = Solution;
    heat.test_counts = {41, 41};
    return CreateEquationProblem(heat, problem, error);
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_EQUATIONS_HEAT_H_
