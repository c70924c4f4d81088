// The viscous Burgers equation, solved by a physics-informed network.
//
//   u_t + u u_x = nu u_xx,   u(0, x) = -sin(pi x),   u(t, -1) = u(t, 1) = 0
//
// on 0 <= t <= 1, -1 <= x <= 1. The solution is odd in x, and steepens to a
// front of width nu at x = 0. The network solves the half x >= 0, where u(t, 0)
// = 0; initial and boundary values hold exactly,
//
//   u = -sin(pi x) + 4 t x (1 - x) N(2 t - 1, 2 x - 1)
//
// With conditions=soft, u = N: initial and boundary values are terms of the
// loss.
//
// Shapes:  network 2-20-20-20-1, tanh: 921 weights; x: N, N_t, N_x, N_xx.
// Data:    Gauss points, rows (t, x, weight); with conditions=soft also num_x
//          at the beginning and num_t on each face. All are one batch. For
//          testing a grid of 41 x 101 points with its faces.
// Metric:  L2_error, relative. By symmetry it is that of -1 <= x <= 1.
// Facts:   the solution in closed form (Cole-Hopf), by the trapezoidal rule:
//            u = -I[sin(pi z)] / I[1],   z = x - 2 sqrt(nu t) q
//            I[f] = int f exp(-cos(pi z) / (2 pi nu) - q^2) dq
//          nu = 0.01, on an H100: L2 error 3.9e-7 in 15.6 s, 1.9e-12 in 144 s
//          with 5,125 weights, 8.0e-14 in 346 s (arXiv 2607.02194 and its
//          repository); nu = 0.01 / pi: 1.6e-8 with 3,021 weights (arXiv
//          2501.16371).
// Source:  Raissi, Perdikaris, Karniadakis. Physics-informed neural networks.
//          J. Comput. Phys. 378 (2019), with nu = 0.01 / pi.
#ifndef PROBLEMS_EQUATIONS_BURGERS_H_
#define PROBLEMS_EQUATIONS_BURGERS_H_

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/equation_problem.h"
#include "invgrad/equation.h"
#include "invgrad/equation_points.h"
#include "invgrad/time_windows.h"
#include "invgrad/trial_function.h"

namespace invgrad {

struct BurgersResidual {
  double nu;
  // u: u, u_t, u_x, u_xx.
  template <typename T>
  bool operator()(const T* u, T* y) const {
    y[0] = u[1] + u[0] * u[2] - nu * u[3];
    return true;
  }
};

struct BurgersPinn {
  static constexpr double kEnd = 1.0;  // 0 <= t <= 1
  double viscosity = 0.01;
  int num_t = 64;
  int num_x = 64;
  std::string conditions = "hard";
  double condition_weight = 100.0;
  PointOptions points;
  void Describe(OptionSet* set) {
    set->Add("viscosity", &viscosity, {1e-3, 1.0}, "nu");
    set->Add("num_t", &num_t, {1, 1000}, "Gauss points in t");
    set->Add("num_x", &num_x, {1, 1000}, "Gauss points in x");
    set->Add(
        "conditions",
        &conditions,
        {"hard", "soft"},
        "whether initial and boundary values hold exactly, or in the loss");
    set->Add("condition_weight",
             &condition_weight,
             {1e-12, 1e12},
             "of the mean square of soft conditions");
    points.Describe(set);
  }

  static double Solution(double nu, double t, double x) {
    if (t == 0.0) return -std::sin(M_PI * x);
    // Beyond the limit the integrand is below e^-45 of its largest value,
    // because the cosine's part is at least exp(-1 / (pi nu)).
    constexpr int kNumIntervals = 1500;
    const double limit = std::sqrt(45.0 + 1.0 / (M_PI * nu));
    const double width = 2.0 * std::sqrt(nu * t);
    double numerator = 0.0;
    double denominator = 0.0;
    for (int k = 0; k <= kNumIntervals; ++k) {
      const double q = limit * (2.0 * k / kNumIntervals - 1.0);
      const double z = x - width * q;
      // cos + 1 >= 0: no overflow.
      const double f =
          std::exp(-(1.0 + std::cos(M_PI * z)) / (2.0 * M_PI * nu) - q * q);
      numerator += std::sin(M_PI * z) * f;
      denominator += f;
    }
    return -numerator / denominator;
  }

  static void Start(const InputJet* a, InputJet* u) {
    u[0] = -sin(M_PI * a[1]);
  }

  // The conditions as terms of the loss.
  std::vector<EquationTerm> SoftConditions(const TimeWindow& window,
                                           const TrialFunction& trial) const {
    const auto value = std::make_shared<ValueResidual>(trial);
    const QuadraturePoints beginning = {
        Eigen::MatrixXd::Constant(1, 1, window.begin),
        Eigen::VectorXd::Ones(1)};
    const QuadraturePoints ends = {Eigen::RowVector2d(0.0, 1.0),
                                   Eigen::Vector2d(0.5, 0.5)};
    const QuadraturePoints times =
        GaussPanels({window.begin, window.end}, {num_t});
    EquationTerm initial = {"beginning",
                            value,
                            ProductPoints({beginning, GaussRule(num_x)}),
                            condition_weight};
    initial.context = [window](
                          const Eigen::VectorXd& point, Eigen::Index, auto c) {
      const InputJet a[] = {point[0], point[1]};
      InputJet u;
      window.start(a, &u);
      c[0] = u.value();
    };
    EquationTerm faces = {
        "faces", value, ProductPoints({times, ends}), condition_weight};
    faces.context = [](const Eigen::VectorXd&, Eigen::Index, auto c) {
      c[0] = 0.0;
    };
    return {initial, faces};
  }

  EquationProblem InWindow(const TimeWindow& window) const {
    EquationProblem burgers;
    burgers.box = {Eigen::Vector2d(window.begin, 0.0),
                   Eigen::Vector2d(window.end, 1.0)};
    TrialFunction& trial = burgers.equation.trial;
    trial.derivatives = std::make_shared<DerivativeSet>(
        "tx", std::vector<std::string>{"t", "x", "xx"});
    trial.features = ScaledFeatures(burgers.box);
    if (conditions == "hard") {
      trial.boundary_values = window.start;
      trial.distance = [window](const InputJet* a, InputJet* d) {
        d[0] = 4.0 * (a[0] - window.begin) * a[1] * (1.0 - a[1]);
      };
    }
    burgers.equation.terms = {
        {"equation",
         std::make_shared<AutoDiffSimulator<BurgersResidual, 4, 1>>(
             BurgersResidual{viscosity}),
         GaussPoints(burgers.box, {num_t, num_x})}};
    if (conditions == "soft") {
      for (EquationTerm& term : SoftConditions(window, trial)) {
        burgers.equation.terms.push_back(std::move(term));
      }
    }
    burgers.equation.hidden = {20, 20, 20};
    burgers.points = points;
    burgers.solution = [nu = viscosity](const Eigen::VectorXd& point) {
      return Solution(nu, point[0], point[1]);
    };
    burgers.test_counts = {41, 101};
    return burgers;
  }

  bool Create(LearningProblem* problem, std::string* error) const {
    return CreateEquationProblem(InWindow({0.0, kEnd, Start}), problem, error);
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_EQUATIONS_BURGERS_H_
