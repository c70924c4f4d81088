// The Helmholtz equation in two dimensions, solved by a physics-informed
// network.
//
//   Lap u + k^2 u = q on -1 <= x, y <= 1,   u = 0 at the boundary
//   q such that u = sin(a_1 pi x) sin(a_2 pi y)
//
// The boundary value holds exactly, u = (1 - x^2) (1 - y^2) N(x, y).
//
// Shapes:  network 2-20-20-20-1, tanh: 921 weights; x: N, Lap N, N_x, N_y.
// Data:    Gauss points, rows (x, y, weight); all are one batch. For testing a
//          grid of 101 x 101 points with its faces.
// Metric:  L2_error, relative.
// Source:  Wang, Teng, Perdikaris. Understanding and mitigating gradient flow
//          pathologies in physics-informed neural networks. SIAM J. Sci.
//          Comput. 43 (2021), section 4.1: k = 1, a = (1, 4), by Adam.
#ifndef PROBLEMS_EQUATIONS_HELMHOLTZ_H_
#define PROBLEMS_EQUATIONS_HELMHOLTZ_H_

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/equation_problem.h"
#include "invgrad/equation_points.h"

namespace invgrad {

// [residual]
struct HelmholtzResidual {
  double k;
  // u: u, Lap u.
  template <typename T, typename C>
  bool operator()(const T* u, const C* q, T* y) const {
    y[0] = u[1] + k * k * u[0] - q[0];
    return true;
  }
};
// [/residual]

struct HelmholtzPinn {
  double k = 1.0;
  int waves_x = 1;
  int waves_y = 4;
  int num_x = 64;
  int num_y = 64;
  PointOptions points;
  void Describe(OptionSet* set) {
    set->Add("k", &k, {0.0, 1000.0}, "wave number");
    set->Add("waves_x", &waves_x, {1, 100}, "a_1");
    set->Add("waves_y", &waves_y, {1, 100}, "a_2");
    set->Add("num_x", &num_x, {1, 1000}, "Gauss points in x");
    set->Add("num_y", &num_y, {1, 1000}, "Gauss points in y");
    points.Describe(set);
  }

  double Solution(const Eigen::VectorXd& point) const {
    return std::sin(waves_x * M_PI * point[0]) *
           std::sin(waves_y * M_PI * point[1]);
  }

  bool Create(LearningProblem* problem, std::string* error) const {
    EquationProblem helmholtz;
    TrialFunction& trial = helmholtz.equation.trial;
    trial.derivatives = std::make_shared<DerivativeSet>(
        "xy", std::vector<std::string>{"xx+yy"});
    trial.boundary_values = [](const InputJet*, InputJet* g) { g[0] = 0.0; };
    trial.distance = [](const InputJet* a, InputJet* d) {
      d[0] = (1.0 - a[0] * a[0]) * (1.0 - a[1] * a[1]);
    };
    helmholtz.box = {Eigen::Vector2d(-1.0, -1.0), Eigen::Vector2d(1.0, 1.0)};
    // [term]
    EquationTerm inside = {
        "equation",
        std::make_shared<AutoDiffSimulator<HelmholtzResidual, 2, 1, 1>>(
            HelmholtzResidual{k}),
        GaussPoints(helmholtz.box, {num_x, num_y})};
    const double factor =
        k * k - M_PI * M_PI * (waves_x * waves_x + waves_y * waves_y);
    inside.context = [factor, *this](
                         const Eigen::VectorXd& point, Eigen::Index, auto c) {
      c[0] = factor * Solution(point);
    };
    // [/term]
    helmholtz.equation.terms = {inside};
    helmholtz.equation.hidden = {20, 20, 20};
    helmholtz.points = points;
    helmholtz.solution = [*this](const Eigen::VectorXd& point) {
      return Solution(point);
    };
    helmholtz.test_counts = {101, 101};
    return CreateEquationProblem(helmholtz, problem, error);
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_EQUATIONS_HELMHOLTZ_H_
