#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>
#include <vector>

#include "problems/navier_stokes/navier_stokes.h"

namespace invgrad {

using Eigen::Vector2d;
using Eigen::VectorXd;

namespace {

// The centre of a cell, (x, y).
Vector2d CellCentre(int cell, const NavierStokesSettings& settings) {
  const int row = cell / settings.cells;
  const int col = cell % settings.cells;
  return settings.dx() * Vector2d(col + 0.5, row + 0.5);
}

VectorXd RandomMarker(const FourierGrid& grid,
                      double fill,
                      const NavierStokesSettings& settings,
                      NumpyRandom* random) {
  constexpr double kHalfSide = 28.0;
  // In this order; that of a constructor's arguments depends on the compiler.
  Vector2d centre;
  centre.y() = random->Uniform(32.0, 96.0);
  centre.x() = random->Uniform(32.0, 96.0);
  const VectorXd field = RandomField(grid, random);
  std::vector<int> cells;
  for (int cell = 0; cell < grid.num_cells(); ++cell) {
    const Vector2d distance = CellCentre(cell, settings) - centre;
    if (distance.cwiseAbs().maxCoeff() < kHalfSide) cells.push_back(cell);
  }
  // In the release the field is 0 outside the box, and the cells there that are
  // among the greatest are cut off again.
  const auto is_greater = [&](int a, int b) { return field[a] > field[b]; };
  std::sort(cells.begin(), cells.end(), is_greater);
  const size_t wanted = std::lround(fill * grid.num_cells());
  const size_t outside = grid.num_cells() - cells.size();
  VectorXd marker = VectorXd::Zero(grid.num_cells());
  for (size_t k = 0; k < std::min(wanted, cells.size()); ++k) {
    // Below 0 the outside is greater.
    if (field[cells[k]] <= 0.0 && k + outside >= wanted) break;
    marker[cells[k]] = 1.0;
  }
  return marker;
}

}  // namespace

VectorXd RandomField(const FourierGrid& grid, NumpyRandom* random) {
  VectorXd field = random->Normal(grid.num_cells());
  Eigen::ArrayXcd modes(grid.num_modes());
  grid.Forward(field.data(), modes.data());
  // From radians a cell to k.
  const double scale =
      10.0 / NavierStokesSettings::kSide * grid.rows() / (2.0 * M_PI);
  const Eigen::ArrayXd k2 = scale * scale * grid.SquaredWaveNumbers();
  modes *= (k2 > 0.1).select(1.0 / k2.max(1e-30), 0.0);
  grid.Backward(modes.data(), field.data());
  field.array() -= field.mean();
  return field * (std::sqrt(1.0 * field.size()) / field.norm());
}

Vector2d CentreOfMass(const VectorXd& marker,
                      const NavierStokesSettings& settings) {
  Vector2d sum = Vector2d::Zero();
  for (int cell = 0; cell < marker.size(); ++cell) {
    sum += marker[cell] * CellCentre(cell, settings);
  }
  return sum / marker.sum();
}

VectorXd SwirlVelocity(const Vector2d& uniform,
                       double omega,
                       const NavierStokesSettings& settings) {
  constexpr double kRadius = 20.0;
  const int n = settings.cells * settings.cells;
  VectorXd velocity(2 * n);
  for (int cell = 0; cell < n; ++cell) {
    const Vector2d r = CellCentre(cell, settings) -
                       Vector2d::Constant(NavierStokesSettings::kSide / 2.0);
    const double strength =
        omega * std::exp(-r.squaredNorm() / (2.0 * kRadius * kRadius));
    velocity[cell] = uniform[0] - strength * r[1];
    velocity[n + cell] = uniform[1] + strength * r[0];
  }
  return velocity;
}

Eigen::MatrixXd RandomNavierStokesFields(const NavierStokesSettings& settings,
                                         int num_samples,
                                         NumpyRandom* random) {
  const FourierGrid grid(settings.cells, settings.cells);
  const int n = grid.num_cells();
  Eigen::MatrixXd fields(3 * n, num_samples);
  const double fill = random->Uniform(0.05, 0.15);
  for (int i = 0; i < num_samples; ++i) {
    const VectorXd marker = RandomMarker(grid, fill, settings, random);
    const Vector2d middle =
        Vector2d::Constant(NavierStokesSettings::kSide / 2.0);
    const Vector2d uniform =
        (middle - CentreOfMass(marker, settings)) / NavierStokesSettings::kTime;
    VectorXd velocity =
        SwirlVelocity(uniform, random->Uniform(-2.0, 2.0), settings);
    velocity.head(n) +=
        NavierStokesSettings::kFluctuation * RandomField(grid, random);
    velocity.tail(n) +=
        NavierStokesSettings::kFluctuation * RandomField(grid, random);
    fields.col(i) << marker, velocity;
  }
  return fields;
}

DataSet NavierStokesSamples(const NavierStokesSettings& settings,
                            const Eigen::MatrixXd& fields) {
  const InviscidFlow truth(
      settings.cells, VelocityGrid::Place::kCentres, settings.courant());
  const Eigen::Index n = truth.grid().num_cells();
  DataSet samples;
  samples.contexts = fields.topRows(n);
  samples.solutions = fields.bottomRows(2 * n);
  samples.targets.resize(n, fields.cols());
  for (Eigen::Index i = 0; i < fields.cols(); ++i) {
    InviscidFlow::State state = {samples.contexts.col(i),
                                 samples.solutions.col(i)};
    for (int t = 0; t < NavierStokesSettings::kNumSteps; ++t) {
      state = truth.Advance(state, nullptr);
    }
    samples.targets.col(i) = state.marker;
  }
  samples.inputs.resize(2 * n, fields.cols());
  samples.inputs << samples.contexts, samples.targets;
  return samples;
}

double GreatestDeformation(const NavierStokesSettings& settings,
                           const Eigen::MatrixXd& fields) {
  const int cells = settings.cells;
  const int n = cells * cells;
  double greatest = 0.0;
  for (int c : {1, 2}) {
    const auto u = fields.middleRows(c * n, n);
    for (int cell = 0; cell < n; ++cell) {
      const int row = cell / cells, col = cell % cells;
      for (const int next : {cells * row + (col + 1) % cells,
                             cells * ((row + 1) % cells) + col}) {
        const double change = (u.row(next) - u.row(cell)).cwiseAbs().maxCoeff();
        greatest = std::max(greatest, change);
      }
    }
  }
  return settings.courant() * greatest;
}

double MeanVelocityError(const Eigen::MatrixXd& x,
                         const Eigen::MatrixXd& solutions) {
  const Eigen::Index n = x.rows() / 2;
  const Eigen::ArrayXXd difference = (x - solutions).array();
  return (difference.topRows(n).square() + difference.bottomRows(n).square())
      .sqrt()
      .mean();
}

}  // namespace invgrad
