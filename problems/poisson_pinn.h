// The Poisson equation in the unit square, solved by a physics-informed
// network.
//
//   -Lap u = f in (0, 1)^2,   u = 0 on its boundary,   u = network(a; theta)
//   f = 2 pi^2 sin(pi a_1) sin(pi a_2)
//
// with the solution u* = sin(pi a_1) sin(pi a_2). The loss is
//
//   L = 1 / (2 N_int) sum_int (Lap u + f)^2 + 1 / (2 N_bd) sum_bd (u - u*)^2
//
// A sample is a point a. The simulator is the equation: it maps the network's
// 2-jet x = (u, d_1 u, d_2 u, Lap u) at the point (two_jet.h) to the residual.
// L is the mean of 1/2 y^2 over all N = N_int + N_bd points, with
//
//   y = sqrt(N / N_int) (Lap u + f)   or   y = sqrt(N / N_bd) (u - u*)
//
// Shapes:  network 2-64-1 ("small"), 2-64-64-48-48-1 or 2-256-256-128-128-1,
//          tanh: 257, 9,873 or 116,097 weights;  x: 4;  y: 1.  Context:
//          (1 at the boundary or 0 inside, the square root above, u* or f).
// Units:   none.
// Data:    points=grid: sqrt(N_int) x sqrt(N_int) midpoints of the cells of a
//          grid, and the midpoints of N_bd / 4 pieces of each side.
//          points=random: np.random.seed(data_seed); np.random.rand(N_int, 2);
//          rand(N_bd, 2), of which the first is the place along a side, and the
//          second, times 4, the number of the side. Data are rows (a_1,
//          a_2, 1 at the boundary or 0 inside). All points are one batch.
//          For testing 100 x 100 midpoints of cells, none at the boundary;
//          their loss is the mean of 1/2 (Lap u + f)^2. Solutions: u*'s 2-jet.
// Metric:  L2_error, sqrt(mean (u - u*)^2) over the points for testing. For
//          u = 0 it is 1/2.
// Facts:   after 1,000 s on a GPU in double precision (best of many settings,
//          points=random), small: ENGD 6.2e-8, KFAC 3.4e-7, Adam 9.4e-5, L-BFGS
//          1.6e-4; medium: KFAC 7.0e-6 (KFAC* 7.9e-7), Adam 2.1e-4.
//          Gauss-Newton needs a good start: from the initial weights it
//          saturates the neurons, but after 150 steps of
//          power:kappa=0.75:step_size=auto
//          gauss_newton:step_size=auto:truncation=1e-9 takes the error below
//          ENGD's in about 60 steps, and to 1e-9 or 1e-8 in the end.
// Source:  Dangel, Mueller, Zeinhofer. Kronecker-Factored Approximate Curvature
//          for Physics-Informed Neural Networks. NeurIPS 2024, section 4, arXiv
//          2405.15603. The grid: Mueller, Zeinhofer. Achieving High Accuracy
//          with PINNs via Energy Natural Gradient Descent. ICML 2023, arXiv
//          2302.13163.
#ifndef PROBLEMS_POISSON_PINN_H_
#define PROBLEMS_POISSON_PINN_H_

#include <string>

#include "Eigen/Core"
#include "problems/problem.h"

namespace invgrad {

// y of one point. x: the 2-jet of u; context as above.
struct PoissonResidual {
  template <typename T>
  bool operator()(const T* x, const double* context, T* y) const {
    const T& u = x[0];
    const T& laplacian = x[3];
    const bool is_boundary = context[0] != 0.0;
    y[0] = is_boundary ? context[1] * (u - context[2])
                       : context[1] * (laplacian + context[2]);
    return true;
  }
};

struct PoissonPinn {
  struct Options {
    std::string points = "grid";
    int num_interior = 900;
    int num_boundary = 120;
    std::string network = "small";
    int data_seed = 0;
    void Describe(OptionSet* set) {
      set->Add("points",
               &points,
               {"grid", "random"},
               "a grid's midpoints, or uniformly distributed");
      set->Add("num_interior",
               &num_interior,
               {1, 1e7},
               "points inside; of a grid a square number");
      set->Add("num_boundary",
               &num_boundary,
               {1, 1e7},
               "points at the boundary; of a grid a multiple of 4");
      set->Add("network",
               &network,
               {"small", "medium", "large"},
               "257, 9,873 or 116,097 weights");
      set->Add("data_seed", &data_seed, {0, 2147483647}, "np.random.seed");
    }
  };

  // u* and its derivatives at the points a (2 x N): 4 x N.
  static Eigen::MatrixXd SolutionJets(const Eigen::MatrixXd& points);

  // `data`: points, one a row.
  static bool Create(const Options& options,
                     const Eigen::MatrixXd* data,
                     LearningProblem* problem,
                     std::string* error);
};

}  // namespace invgrad

#endif  // PROBLEMS_POISSON_PINN_H_
