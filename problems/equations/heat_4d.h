// The heat equation in four dimensions, solved by a physics-informed network.
//
//   u_t = 1/4 Lap u on 0 <= t <= 1, 0 <= x_i <= 1
//   u(0, x) = sum_i sin(2 x_i), and u given at x_i = 0 and 1
//
// The initial value holds exactly, the values at the faces are a term of the
// loss beside the equation:
//
//   u = sum_i sin(2 x_i) + t N(2 t - 1, 2 x - 1)
//
// Shapes:  network 5-64-1, tanh: 449 weights, as in the source; x: N, N_t, Lap
//          N, N_i.
// Data:    a low-discrepancy sequence, rows (t, x, weight), and one on each
//          face; all are one batch. For testing a grid of 5^5 points with its
//          faces.
// Metric:  L2_error, relative.
// Facts:   u = exp(-t) sum_i sin(2 x_i). Published: a root mean square error of
//          7.4e-7, which is 3.9e-7 relative, by ENGD, 3,000 s on a GPU, with all
//          conditions as terms of the loss.
// Source:  Dangel, Mueller, Zeinhofer. Kronecker-Factored Approximate Curvature
//          for Physics-Informed Neural Networks. NeurIPS 2024. arXiv
//          2405.15603.
#ifndef PROBLEMS_EQUATIONS_HEAT_4D_H_
#define PROBLEMS_EQUATIONS_HEAT_4D_H_

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/equation_problem.h"
#include "invgrad/equation.h"
#include "invgrad/equation_points.h"
#include "problems/equations/heat.h"

namespace invgrad {

struct Heat4dPinn {
  int num_points = 3000;
  int num_face = 100;
  double face_weight = 10.0;
  PointOptions points;
  void Describe(OptionSet* set) {
    set->Add("num_points", &num_points, {1, 1e6}, "points inside");
    set->Add("num_face", &num_face, {1, 1e6}, "points on each of 8 faces");
    set->Add(
        "face_weight", &face_weight, {1e-12, 1e12}, "of their mean square");
    points.Describe(set);
  }

  static double Solution(const Eigen::VectorXd& point) {
    return std::exp(-point[0]) * (2.0 * point.tail<4>()).array().sin().sum();
  }

  bool Create(LearningProblem* problem, std::string* error) const {
    EquationProblem heat;
    TrialFunction& trial = heat.equation.trial;
    trial.derivatives = std::make_shared<DerivativeSet>(
        "tabcd", std::vector<std::string>{"t", "aa+bb+cc+dd"});
    trial.boundary_values = [](const InputJet* a, InputJet* g) {
      g[0] =
          sin(2.0 * a[1]) + sin(2.0 * a[2]) + sin(2.0 * a[3]) + sin(2.0 * a[4]);
    };
    trial.distance = [](const InputJet* a, InputJet* d) { d[0] = a[0]; };
    heat.box = {Eigen::VectorXd::Zero(5), Eigen::VectorXd::Ones(5)};
    trial.features = ScaledFeatures(heat.box);
    EquationTerm faces = {"faces",
                          std::make_shared<ValueResidual>(trial),
                          FacePoints(heat.box, 1, num_face),
                          face_weight};
    faces.context = [](const Eigen::VectorXd& point, Eigen::Index, auto c) {
      c[0] = Solution(point);
    };
    heat.equation.terms = {
        {"equation",
         std::make_shared<AutoDiffSimulator<HeatResidual, 3, 1>>(),
         SequencePoints(heat.box, num_points, 0)},
        faces};
    heat.equation.hidden = {64};
    heat.points = points;
    heat.solution = Solution;
    heat.test_counts = std::vector<int>(5, 5);
    return CreateEquationProblem(heat, problem, error);
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_EQUATIONS_HEAT_4D_H_
