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
// jet x = (u, d_1 u, d_2 u, Lap u) at the point (derivative_set.h) to the residual.
// L is the mean of 1/2 y^2 over all N = N_int + N_bd points, with
//
//   y = sqrt(N / N_int) (Lap u + f)   or   y = sqrt(N / N_bd) (u - u*)
//
// Shapes:  network 2-64-1 ("small"), 2-64-64-48-48-1 or 2-256-256-128-128-1,
//          tanh: 257, 9,873 or 116,097 weights;  x: 4;  y: 1.  Context:
//          (1 at the boundary or 0 inside, the square root above, u* or f).
// Data:    points=grid: sqrt(N_int) x sqrt(N_int) midpoints of the cells of a
//          grid, and the midpoints of N_bd / 4 pieces of each side.
//          points=random: np.random.seed(data_seed); np.random.rand(N_int, 2);
//          rand(N_bd, 2), of which the first is the place along a side, and the
//          second, times 4, the number of the side. Data are rows (a_1,
//          a_2, 1 at the boundary or 0 inside). All points are one batch.
//          For testing 100 x 100 midpoints of cells, none at the boundary;
//          their loss is the mean of 1/2 (Lap u + f)^2. Solutions: u*'s jets.
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

#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "fmt/core.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/sample_data.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/loss.h"
#include "invgrad/random.h"

namespace invgrad {

// y of one point. x: the jet of u; context as above.
struct PoissonResidual {
  template <typename T, typename C>
  bool operator()(const T* x, const C* context, T* y) const {
    const T& u = x[0];
    const T& laplacian = x[3];
    const bool is_boundary = context[0] != 0.0;
    y[0] = is_boundary ? context[1] * (u - context[2])
                       : context[1] * (laplacian + context[2]);
    return true;
  }
};

struct PoissonPinn {
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

  // u* and its derivatives at the points a (2 x N): 4 x N.
  static Eigen::MatrixXd SolutionJets(const Eigen::MatrixXd& points) {
    const Eigen::Array2Xd angle = M_PI * points.array();
    const Eigen::Array2Xd sine = angle.sin();
    const Eigen::Array2Xd cosine = angle.cos();
    Eigen::MatrixXd jets(4, points.cols());
    jets.row(0) = sine.row(0) * sine.row(1);
    jets.row(1) = M_PI * cosine.row(0) * sine.row(1);
    jets.row(2) = M_PI * sine.row(0) * cosine.row(1);
    jets.row(3) = -2.0 * M_PI * M_PI * jets.row(0);
    return jets;
  }

  // `data`: points, one a row.
  bool Create(LearningProblem* problem, std::string* error) const {
    Eigen::MatrixXd& data = problem->data;
    if (!CheckMemory(data, error)) return false;
    if (data.size() > 0) {
      if (!CheckDataShape(data, 3, error) || !CheckKinds(data, error)) {
        return false;
      }
    } else if (!MakePoints(&data, error)) {
      return false;
    }
    const double num_points = static_cast<double>(data.rows());
    const double num_at_boundary = data.col(2).sum();
    problem->train =
        MakeSamples(data,
                    std::sqrt(num_points / (num_points - num_at_boundary)),
                    std::sqrt(num_points / num_at_boundary));
    problem->test = MakeSamples(CellMidpoints(100), 1.0, 1.0);
    const std::map<std::string, std::vector<int>> widths = {
        {"small", {2, 64, 1}},
        {"medium", {2, 64, 64, 48, 48, 1}},
        {"large", {2, 256, 256, 128, 128, 1}}};
    problem->model = std::make_shared<Model>(
        DenseNetwork(widths.at(network), Activation::kTanh),
        std::make_shared<AutoDiffSimulator<PoissonResidual, 4, 1, 3>>(),
        std::make_shared<SquaredNormLoss>(1, 0.5),
        Reduction::kMean,
        Derivatives());
    problem->metric = Metric{
        "L2_error", [](const Eigen::MatrixXd& x, const DataSet& samples) {
          return std::sqrt(
              (x.row(0) - samples.solutions.row(0)).array().square().mean());
        }};
    problem->initialization = Initialization::kPytorch;
    problem->num_epochs = 1000;
    return true;
  }

 private:
  // (u, d_1 u, d_2 u, Lap u)
  static std::shared_ptr<const DerivativeSet> Derivatives() {
    return std::make_shared<DerivativeSet>(
        "xy", std::vector<std::string>{"x", "y", "xx+yy"});
  }

  // Rows (a_1, a_2, 0): the midpoints of the cells of an n x n grid.
  static Eigen::MatrixXd CellMidpoints(int n) {
    Eigen::MatrixXd points = Eigen::MatrixXd::Zero(n * n, 3);
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        points.row(i * n + j).head(2) << (i + 0.5) / n, (j + 0.5) / n;
      }
    }
    return points;
  }

  bool MakePoints(Eigen::MatrixXd* data, std::string* error) const {
    const bool is_grid = points == "grid";
    const int n = static_cast<int>(std::lround(std::sqrt(num_interior)));
    if (is_grid && n * n != num_interior) {
      *error = fmt::format(
          "num_interior={} is not the square of a number, as points=grid needs "
          "it",
          num_interior);
      return false;
    }
    if (is_grid && num_boundary % 4 != 0) {
      *error = fmt::format(
          "num_boundary={} is not a multiple of 4, as points=grid needs it",
          num_boundary);
      return false;
    }
    NumpyRandom random(static_cast<std::uint32_t>(data_seed));
    data->setZero(num_interior + num_boundary, 3);
    if (is_grid) {
      data->topRows(num_interior) = CellMidpoints(n);
    } else {
      data->topLeftCorner(num_interior, 2) = random.Rand(num_interior, 2);
    }
    const int per_side = num_boundary / 4;
    for (int i = 0; i < num_boundary; ++i) {
      const double place =
          is_grid ? (i % per_side + 0.5) / per_side : random.Rand();
      const int side =
          is_grid ? i / per_side : static_cast<int>(4.0 * random.Rand());
      const double end = side % 2;
      data->row(num_interior + i) << (side < 2 ? end : place),
          (side < 2 ? place : end), 1.0;
    }
    return true;
  }

  bool CheckMemory(const Eigen::MatrixXd& data, std::string* error) const {
    const bool is_given = data.size() > 0;
    const double num_points = is_given ? static_cast<double>(data.rows())
                                       : 1.0 * num_interior + num_boundary;
    // Numbers per point: its row, its sample (8 + 3 + 1 + 4), and four temporary
    // pairs.
    const double bytes = sizeof(double) * num_points * (3 + 16 + 8);
    return FitsInMemory(is_given
                            ? fmt::format("data of {} points", data.rows())
                            : fmt::format("num_interior={}:num_boundary={}",
                                          num_interior,
                                          num_boundary),
                        {{"its data", bytes}},
                        0.0,
                        error);
  }

  static bool CheckKinds(const Eigen::MatrixXd& data, std::string* error) {
    const auto kinds = data.col(2).array();
    for (Eigen::Index i = 0; i < kinds.size(); ++i) {
      if (kinds[i] != 0.0 && kinds[i] != 1.0) {
        *error = fmt::format(
            "data: row {}, column 2 is {:f}; allowed: 1 (at the boundary) or 0 "
            "(inside)",
            i,
            kinds[i]);
        return false;
      }
    }
    if (kinds.minCoeff() == 0.0 && kinds.maxCoeff() == 1.0) return true;
    *error =
        "data must have points at the boundary (1 in column 2) and inside (0)";
    return false;
  }

  // The factors of y: interior_factor or boundary_factor.
  static DataSet MakeSamples(const Eigen::MatrixXd& data,
                             double interior_factor,
                             double boundary_factor) {
    DataSet samples;
    const Eigen::MatrixXd points = data.leftCols(2).transpose();
    samples.inputs = Derivatives()->InputJets(points);
    samples.solutions = SolutionJets(points);
    samples.targets = Eigen::MatrixXd::Zero(1, data.rows());
    samples.contexts.resize(3, data.rows());
    for (Eigen::Index s = 0; s < data.rows(); ++s) {
      const double u = samples.solutions(0, s);
      const double f = -samples.solutions(3, s);
      if (data(s, 2) != 0.0) {
        samples.contexts.col(s) << 1.0, boundary_factor, u;
      } else {
        samples.contexts.col(s) << 0.0, interior_factor, f;
      }
    }
    return samples;
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_POISSON_PINN_H_
