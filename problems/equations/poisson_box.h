// The Poisson equation in five or ten dimensions, solved by a physics-informed
// network.
//
//   d = 5:   -Lap u = pi^2 sum_i cos(pi x_i)
//   d = 10:  -Lap u = 0
//
// on 0 <= x_i <= 1, u given at the faces. The values at the faces are a term of
// the loss beside the equation; no condition holds exactly: u = N(2 x - 1).
//
// Shapes:  network d-64-1, tanh: 449 weights in five dimensions, as in the
//          source, and 769 in ten; x: N, Lap N, N_i.
// Data:    a low-discrepancy sequence, rows (x, weight), and one on each face;
//          all are one batch. For testing a grid of 5^5 points with its faces,
//          in ten dimensions 10,000 points of a sequence.
// Metric:  L2_error, relative.
// Facts:   d = 5: u = sum_i cos(pi x_i). Published: a root mean square error of
//          5.6e-8, which is 3.5e-8 relative, by ENGD, 3,000 s on a GPU; at
//          second hand, L2 error 3.0e-16 with 13,313 weights in 407 s on an
//          H100 (arXiv 2607.02194).
//          d = 10: u = x_1 x_2 + x_3 x_4 + .. + x_9 x_10. Published: 2.2e-5
//          with 118,145 weights, 6,000 s on a GPU; at second hand, 1.2e-5 in
//          7,000 s (arXiv 2505.12149).
// Source:  Dangel, Mueller, Zeinhofer. Kronecker-Factored Approximate Curvature
//          for Physics-Informed Neural Networks. NeurIPS 2024. arXiv
//          2405.15603.
#ifndef PROBLEMS_EQUATIONS_POISSON_BOX_H_
#define PROBLEMS_EQUATIONS_POISSON_BOX_H_

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

template <int kDim>
struct PoissonBoxPinn {
  static_assert(kDim == 5 || kDim == 10);
  int num_points = 3000;
  int num_face = kDim == 5 ? 100 : 50;
  double face_weight = 100.0;
  PointOptions points;
  void Describe(OptionSet* set) {
    set->Add("num_points", &num_points, {1, 1e6}, "points inside");
    set->Add("num_face", &num_face, {1, 1e6}, "points on each of 2 d faces");
    set->Add(
        "face_weight", &face_weight, {1e-12, 1e12}, "of their mean square");
    points.Describe(set);
  }

  // For values or jets of the coordinates.
  template <typename T>
  static T SolutionOf(const T* x) {
    using std::cos;
    T u(0.0);
    if constexpr (kDim == 5) {
      for (int i = 0; i < kDim; ++i) u += cos(M_PI * x[i]);
    } else {
      for (int i = 0; i < kDim; i += 2) u += x[i] * x[i + 1];
    }
    return u;
  }
  static double Solution(const Eigen::VectorXd& point) {
    return SolutionOf(point.data());
  }

  EquationProblem MakeEquation() const {
    EquationProblem poisson;
    TrialFunction& trial = poisson.equation.trial;
    const std::string letters = std::string("abcdefghij").substr(0, kDim);
    std::string laplacian;
    for (const char x : letters) {
      laplacian += (laplacian.empty() ? "" : "+") + std::string(2, x);
    }
    trial.derivatives = std::make_shared<DerivativeSet>(
        letters, std::vector<std::string>{laplacian});
    poisson.box = {Eigen::VectorXd::Zero(kDim), Eigen::VectorXd::Ones(kDim)};
    trial.features = ScaledFeatures(poisson.box);
    EquationTerm inside = {
        "equation",
        std::make_shared<AutoDiffSimulator<LaplaceResidual, 2, 1, 1>>(),
        SequencePoints(poisson.box, num_points, 0)};
    inside.context = [](const Eigen::VectorXd& point, Eigen::Index, auto c) {
      c[0] = kDim == 5 ? M_PI * M_PI * Solution(point) : 0.0;
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
    if (kDim == 5) {
      poisson.test_counts = std::vector<int>(kDim, 5);
    } else {
      // Far from those of the training.
      constexpr long kFirst = 1'000'000'000;
      poisson.test_points = SequencePoints(poisson.box, 10'000, kFirst).points;
    }
    return poisson;
  }

  bool Create(LearningProblem* problem, std::string* error) const {
    return CreateEquationProblem(MakeEquation(), problem, error);
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_EQUATIONS_POISSON_BOX_H_
