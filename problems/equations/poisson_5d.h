// The Poisson equation in five dimensions, solved by a physics-informed
// network.
//
//   -Lap u = pi^2 sum_i cos(pi x_i) on 0 <= x_i <= 1, u given at the faces
//
// The values at the faces are a term of the loss beside the equation; no
// condition holds exactly: u = N(2 x - 1).
//
// Shapes:  network 5-64-1, tanh: 449 weights, as in the source; x: N, Lap N,
//          N_i.
// Data:    a low-discrepancy sequence, rows (x, weight), and one on each face;
//          all are one batch. For testing a grid of 5^5 points with its faces.
// Metric:  L2_error, relative.
// Facts:   u = sum_i cos(pi x_i). Published: L2 error 5.6e-8 by ENGD, 3,000 s
//          on a GPU; at second hand, 3.0e-16 with 13,313 weights in 407 s on an
//          H100 (arXiv 2607.02194).
// Source:  Dangel, Mueller, Zeinhofer. Kronecker-Factored Approximate Curvature
//          for Physics-Informed Neural Networks. NeurIPS 2024. arXiv
//          2405.15603.
#ifndef PROBLEMS_EQUATIONS_POISSON_5D_H_
#define PROBLEMS_EQUATIONS_POISSON_5D_H_

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/equation_problem.h"
#include "invgrad/equation.h"
#include "invgrad/equation_points.h"

namespace invgrad {

// Lap u + f, for equations without other derivatives.
struct LaplaceResidual {
  template <typename T, typename C>
  bool operator()(const T* u, const C* f, T* y) const {
    y[0] = u[1] + f[0];
    return true;
  }
};

struct Poisson5dPinn {
  int num_points = 3000;
  int num_face = 100;
  double face_weight = 100.0;
  PointOptions points;
  void Describe(OptionSet* set) {
    set->Add("num_points", &num_points, {1, 1e6}, "points inside");
    set->Add("num_face", &num_face, {1, 1e6}, "points on each of 10 faces");
    set->Add(
        "face_weight", &face_weight, {1e-12, 1e12}, "of their mean square");
    points.Describe(set);
  }

  static double Solution(const Eigen::VectorXd& point) {
    return (M_PI * point).array().cos().sum();
  }

  bool Create(LearningProblem* problem, std::string* error) const {
    EquationProblem poisson;
    TrialFunction& trial = poisson.equation.trial;
    trial.derivatives = std::make_shared<DerivativeSet>(
        "abcde", std::vector<std::string>{"aa+bb+cc+dd+ee"});
    poisson.box = {Eigen::VectorXd::Zero(5), Eigen::VectorXd::Ones(5)};
    trial.features = ScaledFeatures(poisson.box);
    EquationTerm inside = {
        "equation",
        std::make_shared<AutoDiffSimulator<LaplaceResidual, 2, 1, 1>>(),
        SequencePoints(poisson.box, num_points, 0)};
    inside.context = [](const Eigen::VectorXd& point, Eigen::Index, auto c) {
      c[0] = M_PI * M_PI * Solution(point);
    };
    EquationTerm faces = {"faces",
                          std::make_shared<ValueResidual>(trial),
                          FacePoints(poisson.box, 0, num_face),
                          face_weight};
    faces.context = [](const Eigen::VectorXd& point, Eigen::Index, auto c) {
      c[0] = Solution(point);
    };
    poisson.equation.terms = {inside, faces};
    poisson.equation.hidden = {64};
    poisson.points = points;
    poisson.solution = Solution;
    poisson.test_counts = std::vector<int>(5, 5);
    return CreateEquationProblem(poisson, problem, error);
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_EQUATIONS_POISSON_5D_H_
