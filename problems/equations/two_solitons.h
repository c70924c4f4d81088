// Two solitons of the Korteweg-de Vries equation, of which the faster one
// passes the slower one, solved by a physics-informed network.
//
//   u_t + u u_x + u_xxx = 0 on 0 <= t <= 5, 0 <= x <= 20
//
// u is given at t = 0 and at both faces, u_x at x = 20. All but u_x hold
// exactly, u_x is a term of the loss beside the equation, as in the source:
//
//   u = u(0, x) + r(t, x) + 24 t s (1 - s) N(2 t / 5 - 1, 2 s - 1), s = x / 20
//   r = (1 - s) (u(t, 0) - u(0, 0)) + s (u(t, 20) - u(0, 20))
//
// Shapes:  network 2-30-30-30-1, tanh: 1,981 weights, as in the source; x: N
//          and its derivatives t, x, xxx, xx, in this order.
// Data:    Gauss points, rows (t, x, weight), and num_t at x = 20; all are one
//          batch. For testing a grid of 61 x 201 points with its faces.
// Metric:  L2_error, relative.
// Facts:   with y_i = sqrt(c_i) / 2 (x - c_i t - x_i), c = (6, 2), x_i = -2, 2,
//            u = 12 (c_1 - c_2) (c_1 cosh^2 y_2 + c_2 sinh^2 y_1) / D^2
//            D = (sqrt(c_1) - sqrt(c_2)) cosh(y_1 + y_2) +
//                (sqrt(c_1) + sqrt(c_2)) cosh(y_1 - y_2)
//          The source has u / 6 in place of u. Published, at second hand: L2
//          error 2.2e-6.
// Source:  Urban, Stefanou, Pons. Unveiling the optimization process of
//          physics informed neural networks. J. Comput. Phys. 523 (2025). arXiv
//          2405.04230, with its program.
#ifndef PROBLEMS_EQUATIONS_TWO_SOLITONS_H_
#define PROBLEMS_EQUATIONS_TWO_SOLITONS_H_

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/equation_problem.h"
#include "invgrad/equation.h"
#include "invgrad/equation_points.h"
#include "invgrad/time_windows.h"
#include "invgrad/trial_function.h"
#include "problems/equations/korteweg_de_vries.h"

namespace invgrad {

// u_x has a given value.
struct SlopeResidual {
  // u: u, u_t, u_x, u_xxx.
  template <typename T, typename C>
  bool operator()(const T* u, const C* slope, T* y) const {
    y[0] = u[2] - slope[0];
    return true;
  }
};

struct TwoSolitonsPinn {
  static constexpr double kEnd = 5.0;  // 0 <= t <= 5
  static constexpr double kWidth = 20.0;
  int num_t = 64;
  int num_x = 128;
  double slope_weight = 5.0;
  PointOptions points;
  void Describe(OptionSet* set) {
    set->Add("num_t", &num_t, {1, 1000}, "Gauss points in t");
    set->Add("num_x", &num_x, {1, 1000}, "Gauss points in x");
    set->Add("slope_weight",
             &slope_weight,
             {1e-12, 1e12},
             "of the mean square of u_x - u*_x at x = 20");
    points.Describe(set);
  }

  // For values or jets of t and x.
  template <typename T>
  static T Solution(const T& t, const T& x) {
    using std::exp;
    constexpr double kSpeeds[] = {6.0, 2.0};
    const double roots[] = {std::sqrt(kSpeeds[0]), std::sqrt(kSpeeds[1])};
    const T y1 = 0.5 * roots[0] * (x - kSpeeds[0] * t + 2.0);
    const T y2 = 0.5 * roots[1] * (x - kSpeeds[1] * t - 2.0);
    const auto cosh = [](const T& y) { return T(0.5 * (exp(y) + exp(-y))); };
    const T c2 = cosh(y2);
    const T s1 = 0.5 * (exp(y1) - exp(-y1));
    const T d = (roots[0] - roots[1]) * cosh(y1 + y2) +
                (roots[0] + roots[1]) * cosh(y1 - y2);
    return 12.0 * (kSpeeds[0] - kSpeeds[1]) *
           (kSpeeds[0] * c2 * c2 + kSpeeds[1] * s1 * s1) / (d * d);
  }

  static void Start(const InputJet* a, InputJet* u) {
    u[0] = Solution(InputJet(0.0), a[1]);
  }

  // u_x = u*_x at x = 20.
  EquationTerm Slope(const Box& box, const TrialFunction& trial) const {
    const QuadraturePoints face = {Eigen::MatrixXd::Constant(1, 1, kWidth),
                                   Eigen::VectorXd::Ones(1)};
    EquationTerm slope = {
        "slope",
        std::make_shared<AutoDiffSimulator<SlopeResidual, 4, 1, 1>>(),
        ProductPoints(
            {GaussPanels({box.lower[0], box.upper[0]}, {num_t}), face}),
        slope_weight};
    slope.context = [set = trial.derivatives](
                        const Eigen::VectorXd& point, Eigen::Index, auto c) {
      const auto solution = [](const InputJet* a, InputJet* u) {
        u[0] = Solution(a[0], a[1]);
      };
      c[0] = JetsOf(*set, 1, solution, point)(set->ChannelOf("x"), 0);
    };
    return slope;
  }

  EquationProblem InWindow(const TimeWindow& window) const {
    EquationProblem kdv;
    kdv.box = {Eigen::Vector2d(window.begin, 0.0),
               Eigen::Vector2d(window.end, kWidth)};
    TrialFunction& trial = kdv.equation.trial;
    trial.derivatives = std::make_shared<DerivativeSet>(
        "tx", std::vector<std::string>{"t", "x", "xxx"});
    trial.features = ScaledFeatures(kdv.box);
    trial.boundary_values = [window](const InputJet* a, InputJet* g) {
      window.start(a, g);
      const InputJet s = a[1] / kWidth;
      const auto change = [&](double x) {
        return Solution(a[0], InputJet(x)) - Solution(window.begin, x);
      };
      g[0] += (1.0 - s) * change(0.0) + s * change(kWidth);
    };
    trial.distance = [window](const InputJet* a, InputJet* d) {
      const InputJet s = a[1] / kWidth;
      d[0] = 24.0 * (a[0] - window.begin) * s * (1.0 - s);
    };
    kdv.equation.terms = {
        {"equation",
         std::make_shared<AutoDiffSimulator<KortewegDeVriesResidual, 4, 1>>(
             KortewegDeVriesResidual{1.0}),
         GaussPoints(kdv.box, {num_t, num_x})},
        Slope(kdv.box, trial)};
    kdv.equation.hidden = {30, 30, 30};
    kdv.points = points;
    kdv.solution = [](const Eigen::VectorXd& point) {
      return Solution(point[0], point[1]);
    };
    kdv.test_counts = {61, 201};
    return kdv;
  }

  EquationProblem MakeEquation() const { return InWindow({0.0, kEnd, Start}); }

  bool Create(LearningProblem* problem, std::string* error) const {
    return CreateEquationProblem(MakeEquation(), problem, error);
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_EQUATIONS_TWO_SOLITONS_H_
