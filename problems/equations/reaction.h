// A reaction at each point of an interval, solved by a physics-informed
// network.
//
//   u_t = rho u (1 - u),   u(0, x) = exp(-1/2 ((x - pi) / (pi / 4))^2)
//
// on 0 <= t <= 1, 0 <= x <= 2 pi. The initial value holds exactly,
//
//   u = u(0, x) + t N(2 t - 1, x / pi - 1)
//
// The source also states that u is periodic in x, which the solution is; an
// equation without derivatives in x needs no condition there.
//
// Shapes:  network 2-20-20-20-1, tanh: 921 weights; x: N, N_t.
// Data:    Gauss points, rows (t, x, weight); all are one batch. For testing a
//          grid of 101 x 257 points with its faces, as in the source.
// Metric:  L2_error, relative.
// Facts:   u = u_0 e / (u_0 e + 1 - u_0), e = exp(rho t). Published, rho = 5,
//          at second hand: L2 error 9.9e-3 by NysNewton-CG, 4 layers of 200
//          neurons, with the conditions as terms of the loss.
// Source:  Rathore, Lei, Frangella, Lu, Udell. Challenges in training PINNs: a
//          loss landscape perspective. ICML 2024. arXiv 2402.01868.
#ifndef PROBLEMS_EQUATIONS_REACTION_H_
#define PROBLEMS_EQUATIONS_REACTION_H_

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/equation_problem.h"
#include "invgrad/equation_points.h"

namespace invgrad {

struct ReactionResidual {
  double rho;
  // u: u, u_t.
  template <typename T>
  bool operator()(const T* u, T* y) const {
    y[0] = u[1] - rho * u[0] * (1.0 - u[0]);
    return true;
  }
};

struct ReactionPinn {
  double rho = 5.0;
  int num_t = 32;
  int num_x = 64;
  PointOptions points;
  void Describe(OptionSet* set) {
    set->Add("rho", &rho, {0.0, 100.0}, "rate");
    set->Add("num_t", &num_t, {1, 1000}, "Gauss points in t");
    set->Add("num_x", &num_x, {1, 1000}, "Gauss points in x");
    points.Describe(set);
  }

  // For values or jets of t and x.
  template <typename T>
  static T Start(const T& x) {
    using std::exp;
    const T z = (x - M_PI) / (M_PI / 4.0);
    return exp(-0.5 * z * z);
  }
  template <typename T>
  T Solution(const T& t, const T& x) const {
    using std::exp;
    const T start = Start(x);
    const T grown = start * exp(rho * t);
    return grown / (grown + 1.0 - start);
  }

  EquationProblem MakeEquation() const {
    EquationProblem reaction;
    reaction.box = {Eigen::Vector2d(0.0, 0.0),
                    Eigen::Vector2d(1.0, 2.0 * M_PI)};
    TrialFunction& trial = reaction.equation.trial;
    trial.derivatives =
        std::make_shared<DerivativeSet>("tx", std::vector<std::string>{"t"});
    trial.features = ScaledFeatures(reaction.box);
    trial.boundary_values = [](const InputJet* a, InputJet* g) {
      g[0] = Start(a[1]);
    };
    trial.distance = [](const InputJet* a, InputJet* d) { d[0] = a[0]; };
    reaction.equation.terms = {
        {"equation",
         std::make_shared<AutoDiffSimulator<ReactionResidual, 2, 1>>(
             ReactionResidual{rho}),
         GaussPoints(reaction.box, {num_t, num_x})}};
    reaction.equation.hidden = {20, 20, 20};
    reaction.points = points;
    reaction.solution = [*this](const Eigen::VectorXd& point) {
      return Solution(point[0], point[1]);
    };
    reaction.test_counts = {101, 257};
    return reaction;
  }

  bool Create(LearningProblem* problem, std::string* error) const {
    return CreateEquationProblem(MakeEquation(), problem, error);
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_EQUATIONS_REACTION_H_
