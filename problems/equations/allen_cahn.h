// The Allen-Cahn equation, solved by a physics-informed network.
//
//   u_t = D u_xx + 5 (u - u^3),   u(0, x) = x^2 cos(pi x),   periodic in x
//
// on 0 <= t <= 1, -1 <= x <= 1. Fronts of width sqrt(2 D / 5) form. The
// solution is even in x: the network solves 0 <= x <= 1, where u_x(t, 0) =
// u_x(t, 1) = 0.
//
// The initial value has the slope -2 at x = 1, so that u_xx is singular at
// (0, 1): a layer of width sqrt(D t) takes the slope to zero. There u + 1 is
// small, decays with exp(-10 t), and diffuses as heat does: with z = 1 - x,
// s = sqrt(4 D t),
//
//   u = -1 + exp(-10 t) (2 z + 2 w) + O(z^2),
//   w_t = D w_zz,   w_z(t, 0) = -1,   w(0, z) = 0
//   w = s / sqrt(pi) exp(-z^2 / s^2) - z erfc(z / s)                        [1]
//
// For D <= 0.05 the layer's slope at x = 0 is below 3e-7; N cannot remove it.
//
// The initial value and the layer hold exactly; cos(pi x) as the only feature
// of x makes N even and N_x zero at x = 1:
//
//   u = -1 + exp(-10 t) (x^2 cos(pi x) + 1 + 2 w) + t N(2 t - 1, cos(pi x))
//
// Shapes:  network 2-20-20-20-20-1, tanh: 1,341 weights; x: N, N_t, N_xx, N_x.
// Data:    Gauss points, rows (t, x, weight), in three panels of x: half of
//          them around the front at x = 1/2. All are one batch. For testing a
//          grid of 40 x 201 points without t = 0, where u is exact.
// Metric:  L2_error, relative. By symmetry it is that of -1 <= x <= 1.
// Facts:   the solution by ETDRK4 (periodic_evolution.h), with an error below
//          1e-10. Published, D = 1e-4: L2 error 9.4e-7 with 2,019 weights
//          (arXiv 2501.16371), 3.5e-6 with some 500,000 (arXiv 2502.00604).
// Source:  Raissi, Perdikaris, Karniadakis. Physics-informed neural networks.
//          J. Comput. Phys. 378 (2019), with D = 1e-4.
//          [1] Carslaw, Jaeger. Conduction of heat in solids. 1959, section
//          2.9: constant flux at the end of a half-line.
#ifndef PROBLEMS_EQUATIONS_ALLEN_CAHN_H_
#define PROBLEMS_EQUATIONS_ALLEN_CAHN_H_

#include <cmath>
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

struct AllenCahnResidual {
  double diffusivity;
  // u: u, u_t, u_xx.
  template <typename T>
  bool operator()(const T* u, T* y) const {
    y[0] = u[1] - diffusivity * u[2] - 5.0 * u[0] * (1.0 - u[0] * u[0]);
    return true;
  }
};

struct AllenCahnPinn {
  static constexpr double kEnd = 1.0;  // 0 <= t <= 1
  double diffusivity = 1e-4;
  int num_t = 48;
  int num_x = 128;
  PointOptions points;
  void Describe(OptionSet* set) {
    set->Add("diffusivity", &diffusivity, {1e-5, 0.05}, "D");
    set->Add("num_t", &num_t, {1, 1000}, "Gauss points in t");
    set->Add("num_x", &num_x, {4, 1000}, "Gauss points in x, in three panels");
    points.Describe(set);
  }

  static PeriodicEvolution Evolution(double diffusivity) {
    PeriodicEvolution evolution;
    evolution.linear = [diffusivity](double k) { return -diffusivity * k * k; };
    evolution.nonlinear = [](double u) { return 5.0 * (u - u * u * u); };
    evolution.num_cells = 4096;
    evolution.time_step = 5e-4;
    return evolution;
  }

  // The Fourier mode m of x^2 cos(pi x).
  static double StartMode(int m) {
    // int_0^1 x^2 cos(k pi x) dx
    const auto integral = [](int k) {
      return k == 0 ? 1.0 / 3.0
                    : (k % 2 == 0 ? 2.0 : -2.0) / (M_PI * M_PI * k * k);
    };
    return 0.5 * (integral(m - 1) + integral(m + 1));
  }

  // w for the jets or values of t and z.
  template <typename T>
  static T Layer(double diffusivity, const T& t, const T& z) {
    const T s = sqrt(4.0 * diffusivity * t);
    const T eta = z / s;
    return s / std::sqrt(M_PI) * exp(-eta * eta) - z * erfc(eta);
  }

  static void Start(const InputJet* a, InputJet* u) {
    u[0] = a[1] * a[1] * cos(M_PI * a[1]);
  }

  EquationProblem InWindow(const TimeWindow& window) const {
    EquationProblem allen_cahn;
    allen_cahn.box = {Eigen::Vector2d(window.begin, 0.0),
                      Eigen::Vector2d(window.end, 1.0)};
    TrialFunction& trial = allen_cahn.equation.trial;
    trial.derivatives = std::make_shared<DerivativeSet>(
        "tx", std::vector<std::string>{"t", "xx"});
    trial.features = {2, [window](const InputJet* a, InputJet* f) {
                        f[0] = (2.0 * a[0] - (window.begin + window.end)) /
                               (window.end - window.begin);
                        f[1] = cos(M_PI * a[1]);
                      }};
    trial.boundary_values = [window, D = diffusivity](const InputJet* a,
                                                      InputJet* g) {
      window.start(a, g);
      if (window.begin > 0.0) return;  // the slope is zero
      const InputJet w = Layer(D, a[0], 1.0 - a[1]);
      g[0] = exp(-10.0 * a[0]) * (g[0] + 1.0 + 2.0 * w) - 1.0;
    };
    trial.distance = [window](const InputJet* a, InputJet* d) {
      d[0] = a[0] - window.begin;
    };
    const QuadraturePoints gauss =
        ProductPoints({GaussPanels({window.begin, window.end}, {num_t}),
                       GaussPanels({0.0, 0.35, 0.65, 1.0},
                                   {num_x / 4, num_x / 2, num_x / 4})});
    allen_cahn.equation.terms = {
        {"equation",
         std::make_shared<AutoDiffSimulator<AllenCahnResidual, 3, 1>>(
             AllenCahnResidual{diffusivity}),
         gauss}};
    allen_cahn.equation.hidden = {20, 20, 20, 20};
    allen_cahn.points = points;
    allen_cahn.solution_at = [D = diffusivity](const Eigen::MatrixXd& points) {
      return Evolution(D).SolveByModes(StartMode, points);
    };
    allen_cahn.test_counts = {40, 201};
    allen_cahn.test_box = allen_cahn.box;
    allen_cahn.test_box->lower[0] += (window.end - window.begin) / 40;
    return allen_cahn;
  }

  bool Create(LearningProblem* problem, std::string* error) const {
    return CreateEquationProblem(InWindow({0.0, kEnd, Start}), problem, error);
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_EQUATIONS_ALLEN_CAHN_H_
