#include "problems/poisson_pinn.h"

#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "invgrad/chain/autodiff_simulator.h"
#include "invgrad/chain/loss.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/io/numpy_random.h"
#include "problems/sample_data.h"

namespace invgrad {
namespace {

using Eigen::MatrixXd;

constexpr int kTestGrid = 100;

// Rows (a_1, a_2, 0): the midpoints of the cells of an n x n grid.
MatrixXd CellMidpoints(int n) {
  MatrixXd points = MatrixXd::Zero(n * n, 3);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      points.row(i * n + j).head(2) << (i + 0.5) / n, (j + 0.5) / n;
    }
  }
  return points;
}

// (a_1, a_2, 1): the point at `place` in [0, 1] along a side 0 .. 3.
Eigen::RowVector3d BoundaryPoint(int side, double place) {
  const double end = side % 2;
  return side < 2 ? Eigen::RowVector3d(end, place, 1.0)
                  : Eigen::RowVector3d(place, end, 1.0);
}

bool GridPoints(const PoissonPinn::Options& options,
                MatrixXd* points,
                std::string* error) {
  const int n = static_cast<int>(std::lround(std::sqrt(options.num_interior)));
  if (n * n != options.num_interior) {
    *error = "num_interior=" + std::to_string(options.num_interior) +
             " is not the square of a number, as points=grid needs it";
    return false;
  }
  if (options.num_boundary % 4 != 0) {
    *error = "num_boundary=" + std::to_string(options.num_boundary) +
             " is not a multiple of 4, as points=grid needs it";
    return false;
  }
  points->resize(options.num_interior + options.num_boundary, 3);
  points->topRows(options.num_interior) = CellMidpoints(n);
  const int per_side = options.num_boundary / 4;
  for (int i = 0; i < options.num_boundary; ++i) {
    points->row(options.num_interior + i) =
        BoundaryPoint(i / per_side, (i % per_side + 0.5) / per_side);
  }
  return true;
}

MatrixXd RandomPoints(const PoissonPinn::Options& options) {
  NumpyRandom random(static_cast<std::uint32_t>(options.data_seed));
  MatrixXd points =
      MatrixXd::Zero(options.num_interior + options.num_boundary, 3);
  points.topLeftCorner(options.num_interior, 2) =
      random.Rand(options.num_interior, 2);
  const MatrixXd draws = random.Rand(options.num_boundary, 2);
  for (int i = 0; i < options.num_boundary; ++i) {
    points.row(options.num_interior + i) =
        BoundaryPoint(static_cast<int>(4.0 * draws(i, 1)), draws(i, 0));
  }
  return points;
}

// Whether the points fit into memory.
bool CheckMemory(const PoissonPinn::Options& options,
                 const MatrixXd* data,
                 std::string* error) {
  const double num_points =
      data != nullptr
          ? static_cast<double>(data->rows())
          : static_cast<double>(options.num_interior) + options.num_boundary;
  const std::string who =
      data != nullptr
          ? "data of " + std::to_string(data->rows()) + " points"
          : "num_interior=" + std::to_string(options.num_interior) +
                ":num_boundary=" + std::to_string(options.num_boundary);
  // Numbers per point: its row, its sample (2 + 3 + 1 + 4), and three temporary
  // pairs in SolutionJets.
  return FitsInMemory(
      who,
      {{"its data", sizeof(double) * num_points * (3 + 10 + 6)}},
      0.0,
      error);
}

bool CheckKinds(const MatrixXd& points, std::string* error) {
  const auto kinds = points.col(2).array();
  for (Eigen::Index i = 0; i < kinds.size(); ++i) {
    if (kinds[i] != 0.0 && kinds[i] != 1.0) {
      *error = "data: row " + std::to_string(i) + ", column 2 is " +
               std::to_string(kinds[i]) +
               "; allowed: 1 (at the boundary) or 0 (inside)";
      return false;
    }
  }
  if (kinds.minCoeff() == 0.0 && kinds.maxCoeff() == 1.0) return true;
  *error =
      "data must have points at the boundary (1 in column 2) and inside (0)";
  return false;
}

// `points`: rows as in CheckKinds. The factors of y: interior_factor or
// boundary_factor.
DataSet MakeSamples(const MatrixXd& points,
                    double interior_factor,
                    double boundary_factor) {
  DataSet samples;
  samples.inputs = points.leftCols(2).transpose();
  samples.solutions = PoissonPinn::SolutionJets(samples.inputs);
  samples.targets = MatrixXd::Zero(1, points.rows());
  samples.contexts.resize(3, points.rows());
  for (Eigen::Index s = 0; s < points.rows(); ++s) {
    const bool is_boundary = points(s, 2) != 0.0;
    const double u = samples.solutions(0, s);
    const double f = -samples.solutions(3, s);
    samples.contexts.col(s) << (is_boundary ? 1.0 : 0.0),
        (is_boundary ? boundary_factor : interior_factor),
        (is_boundary ? u : f);
  }
  return samples;
}

std::vector<int> Widths(const std::string& network) {
  if (network == "small") return {2, 64, 1};
  if (network == "medium") return {2, 64, 64, 48, 48, 1};
  return {2, 256, 256, 128, 128, 1};
}

}  // namespace

MatrixXd PoissonPinn::SolutionJets(const MatrixXd& points) {
  const Eigen::Array2Xd angle = M_PI * points.array();
  const Eigen::Array2Xd sine = angle.sin();
  const Eigen::Array2Xd cosine = angle.cos();
  MatrixXd jets(4, points.cols());
  jets.row(0) = sine.row(0) * sine.row(1);
  jets.row(1) = M_PI * cosine.row(0) * sine.row(1);
  jets.row(2) = M_PI * sine.row(0) * cosine.row(1);
  jets.row(3) = -2.0 * M_PI * M_PI * jets.row(0);
  return jets;
}

bool PoissonPinn::Create(const Options& options,
                         const MatrixXd* data,
                         LearningProblem* problem,
                         std::string* error) {
  if (!CheckMemory(options, data, error)) return false;
  if (data != nullptr) {
    if (!CheckDataShape(*data, 3, error) || !CheckKinds(*data, error)) {
      return false;
    }
    problem->data = *data;
  } else if (options.points == "random") {
    problem->data = RandomPoints(options);
  } else if (!GridPoints(options, &problem->data, error)) {
    return false;
  }
  const double num_points = static_cast<double>(problem->data.rows());
  const double num_boundary = problem->data.col(2).sum();
  problem->train =
      MakeSamples(problem->data,
                  std::sqrt(num_points / (num_points - num_boundary)),
                  std::sqrt(num_points / num_boundary));
  problem->test = MakeSamples(CellMidpoints(kTestGrid), 1.0, 1.0);
  problem->model = std::make_shared<Model>(
      DenseNetwork(Widths(options.network), Activation::kTanh),
      std::make_shared<AutoDiffSimulator<PoissonResidual, 4, 1, 3>>(),
      std::make_shared<SquaredNormLoss>(1, 0.5),
      Reduction::kMean,
      NetworkOutput::kTwoJet);
  problem->metric = Metric{
      "L2_error", [](const MatrixXd& x, const DataSet& samples) {
        return std::sqrt(
            (x.row(0) - samples.solutions.row(0)).array().square().mean());
      }};
  problem->initialization = Initialization::kPytorch;
  problem->batch_size = 0;
  problem->num_epochs = 1000;
  return true;
}

}  // namespace invgrad
