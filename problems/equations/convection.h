// The convection equation in one dimension, solved by a physics-informed
// network.
//
//   u_t + beta u_x = 0,   u(0, x) = sin x,   u(t, x + 2 pi) = u(t, x)
//
// on 0 <= t <= 1, 0 <= x <= 2 pi. The network is periodic, and satisfies the
// initial value exactly,
//
//   u = sin x + t N(2 t - 1, cos x, sin x)
//
// Shapes:  network 3-20-20-20-1, tanh: 941 weights; x: N, N_t, N_x.
// Data:    Gauss points in t, equidistant ones in x, rows (t, x, weight); all
//          are one batch. For testing a grid of 101 x 257 points with its
//          faces, as in the source.
//          Fewer points in x have spurious solutions: waves that the equation
//          does not see at the points.
// Metric:  L2_error, relative.
// Facts:   u = sin(x - beta t). Published, beta = 40, at second hand: L2 error
//          1.9e-3 by NysNewton-CG, 4 layers of 200 neurons, with the conditions
//          as terms of the loss.
// Source:  Rathore, Lei, Frangella, Lu, Udell. Challenges in training PINNs: a
//          loss landscape perspective. ICML 2024. arXiv 2402.01868.
#ifndef PROBLEMS_EQUATIONS_CONVECTION_H_
#define PROBLEMS_EQUATIONS_CONVECTION_H_

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/equation_problem.h"
#include "invgrad/equation_points.h"

namespace invgrad {

struct ConvectionResidual {
  double beta;
  // u: u, u_t, u_x.
  template <typename T>
  bool operator()(const T* u, T* y) const {
    y[0] = u[1] + beta * u[2];
    return true;
  }
};

struct ConvectionPinn {
  double beta = 40.0;
  int num_t = 96;
  int num_x = 40;
  PointOptions points;
  void Describe(OptionSet* set) {
    set->Add("beta", &beta, {0.0, 1000.0}, "speed");
    set->Add("num_t", &num_t, {1, 1000}, "Gauss points in t");
    set->Add("num_x", &num_x, {1, 1000}, "equidistant points in x");
    points.Describe(set);
  }

  // For values or jets of t and x.
  template <typename T>
  T Solution(const T& t, const T& x) const {
    using std::sin;
    return sin(x - beta * t);
  }

  EquationProblem MakeEquation() const {
    EquationProblem convection;
    convection.box = {Eigen::Vector2d(0.0, 0.0),
                      Eigen::Vector2d(1.0, 2.0 * M_PI)};
    TrialFunction& trial = convection.equation.trial;
    trial.derivatives = std::make_shared<DerivativeSet>(
        "tx", std::vector<std::string>{"t", "x"});
    trial.features = PeriodicFeatures(convection.box, 1, 2.0 * M_PI);
    trial.boundary_values = [](const InputJet* a, InputJet* g) {
      g[0] = sin(a[1]);
    };
    trial.distance = [](const InputJet* a, InputJet* d) { d[0] = a[0]; };
    convection.equation.terms = {
        {"equation",
         std::make_shared<AutoDiffSimulator<ConvectionResidual, 3, 1>>(
             ConvectionResidual{beta}),
         GaussTimesPeriodic(convection.box, num_t, num_x)}};
    convection.equation.hidden = {20, 20, 20};
    convection.points = points;
    convection.solution = [*this](const Eigen::VectorXd& point) {
      return Solution(point[0], point[1]);
    };
    convection.test_counts = {101, 257};
    return convection;
  }

  bool Create(LearningProblem* problem, std::string* error) const {
    return CreateEquationProblem(MakeEquation(), problem, error);
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_EQUATIONS_CONVECTION_H_
