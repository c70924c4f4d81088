// The Korteweg-de Vries equation, solved by a physics-informed network.
//
//   u_t + u u_x + mu^2 u_xxx = 0,   u(0, x) = cos(pi x),   periodic in x
//
// on 0 <= t <= 1, -1 <= x <= 1. The wave steepens, and breaks up into a train
// of solitons [1]. The network is periodic, and satisfies the initial value
// exactly,
//
//   u = cos(pi x) + t N(2 t - 1, cos(pi (x + 1)), sin(pi (x + 1)))
//
// Shapes:  network 3-30-30-30-1, tanh: 2,011 weights; x: N and its derivatives
//          t, x, xxx, xx, in this order.
// Data:    Gauss points in t, equidistant ones in x, rows (t, x, weight); all
//          are one batch. For testing a grid of 41 x 201 points with its faces.
// Metric:  L2_error, relative.
// Facts:   the solution by ETDRK4 (periodic_evolution.h), with an error below
//          2e-9, and below 3e-8 at mu^2 = 1e-4; waves of a smaller mu^2 need
//          more cells. Published, mu^2 = 4.84e-4: L2 error 3.4e-4 with some
//          500,000 weights (arXiv 2502.00604); at second hand, 8.2e-11 in
//          1,210 s on an H100 (arXiv 2607.02194).
// Source:  [1] Zabusky, Kruskal. Interaction of solitons in a collisionless
//          plasma. Physical Review Letters 15 (1965).
#ifndef PROBLEMS_EQUATIONS_KORTEWEG_DE_VRIES_H_
#define PROBLEMS_EQUATIONS_KORTEWEG_DE_VRIES_H_

#include <cmath>
#include <complex>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/equation_problem.h"
#include "invgrad/equation_points.h"
#include "invgrad/time_windows.h"
#include "problems/equations/periodic_evolution.h"

namespace invgrad {

struct KortewegDeVriesResidual {
  double dispersion;
  // u: u, u_t, u_x, u_xxx.
  template <typename T>
  bool operator()(const T* u, T* y) const {
    y[0] = u[1] + u[0] * u[2] + dispersion * u[3];
    return true;
  }
};

struct KortewegDeVriesPinn {
  static constexpr double kEnd = 1.0;  // 0 <= t <= 1
  double dispersion = 4.84e-4;
  int num_t = 64;
  int num_x = 128;
  PointOptions points;
  void Describe(OptionSet* set) {
    set->Add("dispersion", &dispersion, {1e-4, 1.0}, "mu^2");
    set->Add("num_t", &num_t, {1, 1000}, "Gauss points in t");
    set->Add("num_x", &num_x, {1, 1000}, "equidistant points in x");
    points.Describe(set);
  }

  static PeriodicEvolution Evolution(double dispersion) {
    PeriodicEvolution evolution;
    evolution.linear = [dispersion](double k) {
      return std::complex<double>(0.0, dispersion * k * k * k);
    };
    evolution.nonlinear = [](double u) { return -0.5 * u * u; };
    evolution.has_derivative = true;
    evolution.num_cells = 512;
    evolution.time_step = 1e-4;
    return evolution;
  }

  static void Start(const InputJet* a, InputJet* u) { u[0] = cos(M_PI * a[1]); }

  EquationProblem InWindow(const TimeWindow& window) const {
    EquationProblem kdv;
    kdv.box = {Eigen::Vector2d(window.begin, -1.0),
               Eigen::Vector2d(window.end, 1.0)};
    TrialFunction& trial = kdv.equation.trial;
    trial.derivatives = std::make_shared<DerivativeSet>(
        "tx", std::vector<std::string>{"t", "x", "xxx"});
    trial.features = PeriodicFeatures(kdv.box, 1, 2.0);
    trial.boundary_values = window.start;
    trial.distance = [window](const InputJet* a, InputJet* d) {
      d[0] = a[0] - window.begin;
    };
    kdv.equation.terms = {
        {"equation",
         std::make_shared<AutoDiffSimulator<KortewegDeVriesResidual, 4, 1>>(
             KortewegDeVriesResidual{dispersion}),
         GaussTimesPeriodic(kdv.box, num_t, num_x)}};
    kdv.equation.hidden = {30, 30, 30};
    kdv.points = points;
    kdv.solution_at = [mu2 = dispersion](const Eigen::MatrixXd& points) {
      return Evolution(mu2).Solve([](double x) { return std::cos(M_PI * x); },
                                  points);
    };
    kdv.test_counts = {41, 201};
    return kdv;
  }

  bool Create(LearningProblem* problem, std::string* error) const {
    return CreateEquationProblem(InWindow({0.0, kEnd, Start}), problem, error);
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_EQUATIONS_KORTEWEG_DE_VRIES_H_
