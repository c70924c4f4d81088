// The wave equation in one dimension, solved by a physics-informed network.
//
//   u_tt = c^2 u_xx,   u(0, x) = sin(pi x) + 1/2 sin(5 pi x),   u_t(0, x) = 0,
//   u(t, 0) = u(t, 1) = 0
//
// on 0 <= t, x <= 1. The solution continues as an odd function of x with period
// 2: sin(pi x) times a function of cos(pi x). All conditions hold exactly,
//
//   u = e u(0, x) + (1 - e) sin(pi x) N(2 t - 1, cos(pi x)),
//   e = exp(-(5 c t)^2)
//
// The double zero of 1 - e keeps the initial velocity. With t^2 in place of 1 -
// e and u(0, x) as it is, N would be some 250 at t = 0 and 1 at t = 1, which a
// network of this size does not learn.
//
// Shapes:  network 2-20-20-20-1, tanh: 921 weights; x: N, N_tt, N_xx, N_t, N_x.
// Data:    Gauss points, rows (t, x, weight); all are one batch. For testing a
//          grid of 101 x 257 points with its faces, as in the source.
// Metric:  L2_error, relative.
// Facts:   u = sin(pi x) cos(c pi t) + 1/2 sin(5 pi x) cos(5 c pi t).
//          Published, c = 2, at second hand: L2 error 1.3e-2 by NysNewton-CG,
//          4 layers of 200 neurons, with the conditions as terms of the loss.
// Source:  Rathore, Lei, Frangella, Lu, Udell. Challenges in training PINNs: a
//          loss landscape perspective. ICML 2024. arXiv 2402.01868.
#ifndef PROBLEMS_EQUATIONS_WAVE_H_
#define PROBLEMS_EQUATIONS_WAVE_H_

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/equation_problem.h"
#include "invgrad/equation_points.h"

namespace invgrad {

struct WaveResidual {
  double c;
  // u: u, u_tt, u_xx.
  template <typename T>
  bool operator()(const T* u, T* y) const {
    y[0] = u[1] - c * c * u[2];
    return true;
  }
};

struct WavePinn {
  double c = 2.0;
  int num_t = 64;
  int num_x = 24;
  PointOptions points;
  void Describe(OptionSet* set) {
    set->Add("c", &c, {0.1, 100.0}, "speed");
    set->Add("num_t", &num_t, {1, 1000}, "Gauss points in t");
    set->Add("num_x", &num_x, {1, 1000}, "Gauss points in x");
    points.Describe(set);
  }

  // For values or jets of t and x.
  template <typename T>
  T Solution(const T& t, const T& x) const {
    using std::cos;
    using std::sin;
    return sin(M_PI * x) * cos(c * M_PI * t) +
           0.5 * sin(5.0 * M_PI * x) * cos(5.0 * c * M_PI * t);
  }

  // e, the share of the initial value.
  InputJet Start(const InputJet& t) const {
    const InputJet scaled = 5.0 * c * t;
    return exp(-scaled * scaled);
  }

  EquationProblem MakeEquation() const {
    EquationProblem wave;
    wave.box = {Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(1.0, 1.0)};
    TrialFunction& trial = wave.equation.trial;
    trial.derivatives = std::make_shared<DerivativeSet>(
        "tx", std::vector<std::string>{"tt", "xx"});
    trial.features = {2, [](const InputJet* a, InputJet* f) {
                        f[0] = 2.0 * a[0] - 1.0;
                        f[1] = cos(M_PI * a[1]);
                      }};
    trial.boundary_values = [*this](const InputJet* a, InputJet* g) {
      g[0] = Start(a[0]) * Solution(InputJet(0.0), a[1]);
    };
    trial.distance = [*this](const InputJet* a, InputJet* d) {
      d[0] = (1.0 - Start(a[0])) * sin(M_PI * a[1]);
    };
    wave.equation.terms = {
        {"equation",
         std::make_shared<AutoDiffSimulator<WaveResidual, 3, 1>>(
             WaveResidual{c}),
         GaussPoints(wave.box, {num_t, num_x})}};
    wave.equation.hidden = {20, 20, 20};
    wave.points = points;
    wave.solution = [*this](const Eigen::VectorXd& point) {
      return Solution(point[0], point[1]);
    };
    wave.test_counts = {101, 257};
    return wave;
  }

  bool Create(LearningProblem* problem, std::string* error) const {
    return CreateEquationProblem(MakeEquation(), problem, error);
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_EQUATIONS_WAVE_H_
