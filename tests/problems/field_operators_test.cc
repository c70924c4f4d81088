// The operators that the simulators of fields are made of.

#include <cmath>
#include <complex>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "problems/fields/advection.h"
#include "problems/fields/diffusion.h"
#include "problems/fields/fourier_grid.h"
#include "problems/fields/velocity_grid.h"
#include "tests/support/simulator_identities.h"

namespace invgrad {
namespace field_operators_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Outside = Lattice::Outside;
using Scheme = AdvectedField::Scheme;

constexpr Outside kOutsides[] = {
    Outside::kPeriodic, Outside::kNearest, Outside::kZero};
constexpr Scheme kSchemes[] = {Scheme::kSemiLagrangian, Scheme::kMacCormack};

// A smooth field.
VectorXd Waves(const Lattice& lattice) {
  VectorXd f(lattice.size());
  for (int i = 0; i < lattice.rows; ++i) {
    for (int j = 0; j < lattice.cols; ++j) {
      const double x = 2.0 * M_PI * j / lattice.cols;
      const double y = 2.0 * M_PI * i / lattice.rows;
      f[i * lattice.cols + j] = std::sin(x + 0.3) * std::cos(y) + 0.5 * x * y;
    }
  }
  return f;
}

// Displacements whose ends lie at least 0.2 from every line of the lattice,
// where the interpolation has kinks.
VectorXd BetweenPoints(int size) {
  VectorXd d(2 * size);
  for (int k = 0; k < 2 * size; ++k) {
    d[k] = std::round(2.0 * std::sin(1.0 + k)) + 0.5 + 0.3 * std::cos(0.7 * k);
  }
  return d;
}

TEST(Advection, AdjointIsTheTransposedTangent) {
  for (const Outside outside : kOutsides) {
    for (const Scheme scheme : kSchemes) {
      for (const auto& [rows, cols] : {std::pair(7, 9), std::pair(1, 12)}) {
        const Lattice lattice = {rows, cols, outside};
        const int n = lattice.size();
        const AdvectedField advected(
            lattice, scheme, NormalVector(n, 1), 3.0 * NormalVector(2 * n, 2));
        const VectorXd df = NormalVector(n, 3), dd = NormalVector(2 * n, 4);
        const VectorXd w = NormalVector(n, 5);
        const VectorXd tangent = advected.Tangent(df, dd);
        VectorXd f_bar = VectorXd::Zero(n), d_bar = VectorXd::Zero(2 * n);
        advected.Adjoint(w, &f_bar, &d_bar);
        EXPECT_NEAR(w.dot(tangent),
                    f_bar.dot(df) + d_bar.dot(dd),
                    1e-12 * w.norm() * tangent.norm());
      }
    }
  }
}

TEST(Advection, TangentIsTheDifference) {
  for (const Outside outside : kOutsides) {
    for (const Scheme scheme : kSchemes) {
      const Lattice lattice = {11, 13, outside};
      const int n = lattice.size();
      const VectorXd f = Waves(lattice), d = BetweenPoints(n);
      const VectorXd df = NormalVector(n, 3), dd = NormalVector(2 * n, 4);
      const double h = 1e-6;
      const auto at = [&](double t) {
        return AdvectedField(lattice, scheme, f + t * df, d + t * dd).value();
      };
      const VectorXd tangent =
          AdvectedField(lattice, scheme, f, d).Tangent(df, dd);
      EXPECT_LT((tangent - (at(h) - at(-h)) / (2.0 * h)).norm(),
                1e-8 * tangent.norm());
    }
  }
}

TEST(Advection, WholeDisplacementsMoveThePeriodicField) {
  const Lattice lattice = {5, 6, Outside::kPeriodic};
  const VectorXd f = NormalVector(30, 1);
  VectorXd d(60);
  d << VectorXd::Constant(30, 2.0), VectorXd::Constant(30, -8.0);
  for (const Scheme scheme : kSchemes) {
    const VectorXd y = AdvectedField(lattice, scheme, f, d).value();
    for (int i = 0; i < 5; ++i) {
      for (int j = 0; j < 6; ++j) {
        EXPECT_EQ(y[i * 6 + j], f[(i + 8) % 5 * 6 + (j + 4) % 6]);
      }
    }
  }
}

TEST(Advection, TheOutsideIsWhatTheLatticeSays) {
  const VectorXd f = NormalVector(12, 1);
  VectorXd d = VectorXd::Zero(24);
  d.head(12).setConstant(-100.0);
  const auto advected = [&](Outside outside) {
    return AdvectedField({3, 4, outside}, Scheme::kSemiLagrangian, f, d)
        .value();
  };
  EXPECT_EQ(advected(Outside::kZero), VectorXd::Zero(12));
  const VectorXd nearest = advected(Outside::kNearest);
  for (int i = 0; i < 12; ++i) EXPECT_EQ(nearest[i], f[i / 4 * 4 + 3]);
}

TEST(Advection, StaysBetweenTheExtremes) {
  for (const Outside outside : {Outside::kPeriodic, Outside::kNearest}) {
    for (const Scheme scheme : kSchemes) {
      const Lattice lattice = {16, 16, outside};
      const VectorXd f = NormalVector(256, 1);
      const VectorXd y =
          AdvectedField(lattice, scheme, f, 2.0 * NormalVector(512, 2)).value();
      EXPECT_GE(y.minCoeff(), f.minCoeff() - 1e-14);
      EXPECT_LE(y.maxCoeff(), f.maxCoeff() + 1e-14);
    }
  }
}

// The mean error after a wave has crossed 0.3 of the box, along x and y, in
// steps of 0.6 cells.
double AdvectionError(Scheme scheme, int n) {
  const Lattice lattice = {n, n, Outside::kPeriodic};
  const auto wave = [n](double shift) {
    VectorXd f(n * n);
    for (int p = 0; p < n * n; ++p) {
      const int row = p / n, col = p % n;
      f[p] = std::sin(2.0 * M_PI * (1.0 * col / n - shift)) *
             std::cos(2.0 * M_PI * (1.0 * row / n - shift));
    }
    return f;
  };
  VectorXd f = wave(0.0);
  const VectorXd d = VectorXd::Constant(2 * n * n, 0.6);
  for (int t = 0; t < n / 2; ++t)
    f = AdvectedField(lattice, scheme, f, d).value();
  return (f - wave(0.3)).lpNorm<1>() / (n * n);
}

TEST(Advection, ConvergesWithItsOrder) {
  const auto order = [](Scheme scheme) {
    return std::log2(AdvectionError(scheme, 64) / AdvectionError(scheme, 128));
  };
  EXPECT_NEAR(order(Scheme::kSemiLagrangian), 1.0, 0.1);
  // The clamp acts near the extremes of the wave, on a shrinking part.
  EXPECT_NEAR(order(Scheme::kMacCormack), 2.0, 0.2);
}

// Where a displacement is so long that positions are rounded by many cells.
TEST(Advection, TakesDisplacementsOfAnyLength) {
  for (const int cols : {5, 8, 20}) {
    const Lattice lattice{3, cols, Lattice::Outside::kPeriodic};
    const VectorXd f = NormalVector(3 * cols, 1);
    for (double length = 1e3; length < 1e300; length *= 7.3) {
      for (const double sign : {-1.0, 1.0}) {
        const VectorXd y =
            AdvectedField(lattice,
                          Scheme::kSemiLagrangian,
                          f,
                          sign * length * NormalVector(6 * cols, 2))
                .value();
        EXPECT_GE(y.minCoeff(), f.minCoeff() - 1e-14);
        EXPECT_LE(y.maxCoeff(), f.maxCoeff() + 1e-14);
      }
    }
  }
}

TEST(Advection, ValuesThatAreNotFiniteAreNotHidden) {
  const Lattice lattice = {3, 3, Outside::kPeriodic};
  VectorXd d = VectorXd::Zero(18);
  d[4] = std::nan("");
  for (const Scheme scheme : kSchemes) {
    EXPECT_FALSE(AdvectedField(lattice, scheme, VectorXd::Ones(9), d)
                     .value()
                     .allFinite());
  }
}

TEST(Diffusion, ConservesTheMeanAndDampsAWaveByItsFactor) {
  const int n = 24, m = 3;
  const double a = 0.2;
  const VectorXd wave = VectorXd::NullaryExpr(
      n, [](Eigen::Index j) { return std::cos(2.0 * M_PI * m * j / n); });
  const double factor = 1.0 - 4.0 * a * std::pow(std::sin(M_PI * m / n), 2);
  EXPECT_LT((DiffuseExplicitly(wave, a) - factor * wave).norm(), 1e-14 * n);
  const VectorXd f = NormalVector(n, 1), w = NormalVector(n, 2);
  EXPECT_NEAR(DiffuseExplicitly(f, a).sum(), f.sum(), 1e-13);
  EXPECT_NEAR(
      w.dot(DiffuseExplicitly(f, a)), f.dot(DiffuseExplicitly(w, a)), 1e-12);
}

TEST(CosineGrid, TransformsACosineToOneModeAndBack) {
  const int rows = 6, cols = 10;
  const CosineGrid grid(rows, cols);
  VectorXd f(rows * cols);
  for (int p = 0; p < rows * cols; ++p) {
    const int row = p / cols, col = p % cols;
    f[p] = std::cos(M_PI * 2 * (row + 0.5) / rows) *
           std::cos(M_PI * 3 * (col + 0.5) / cols);
  }
  VectorXd modes(rows * cols), back(rows * cols);
  grid.Forward(f.data(), modes.data());
  EXPECT_NEAR(modes[2 * cols + 3], rows * cols, 1e-12);
  modes[2 * cols + 3] = 0.0;
  EXPECT_LT(modes.norm(), 1e-12);
  f = NormalVector(rows * cols, 1);
  grid.Forward(f.data(), modes.data());
  grid.Backward(modes.data(), back.data());
  EXPECT_LT((back - f).norm(), 1e-13 * f.norm());
}

std::vector<VelocityGrid> VelocityGrids() {
  using Place = VelocityGrid::Place;
  using Box = VelocityGrid::Box;
  return {{6, 10, Place::kFaces, Box::kPeriodic},
          {7, 5, Place::kFaces, Box::kPeriodic},
          {6, 10, Place::kFaces, Box::kClosed},
          {7, 5, Place::kFaces, Box::kClosed},
          {6, 10, Place::kCentres, Box::kPeriodic},
          {7, 5, Place::kCentres, Box::kPeriodic}};
}

TEST(VelocityGrid, ProjectionIsTheOrthogonalOneToNoDivergence) {
  for (const VelocityGrid& grid : VelocityGrids()) {
    const VectorXd u = NormalVector(grid.size(), 1);
    const VectorXd v = NormalVector(grid.size(), 2);
    const VectorXd Pu = grid.Project(u);
    EXPECT_GT((grid.divergence() * u).norm(), 1.0);
    EXPECT_LT((grid.divergence() * Pu).norm(), 1e-12 * u.norm());
    EXPECT_LT((grid.Project(Pu) - Pu).norm(), 1e-13 * u.norm());
    EXPECT_NEAR(v.dot(Pu), u.dot(grid.Project(v)), 1e-12 * u.norm() * v.norm());
    EXPECT_LT(Pu.norm(), u.norm());
  }
}

TEST(VelocityGrid, ProjectionKeepsTheMeanOfAPeriodicVelocity) {
  for (const VelocityGrid& grid : VelocityGrids()) {
    if (grid.cells().outside != Outside::kPeriodic) continue;
    const VectorXd u = NormalVector(grid.size(), 1);
    for (const int c : {0, 1}) {
      EXPECT_NEAR(grid.Component(grid.Project(u), c).sum(),
                  grid.Component(u, c).sum(),
                  1e-12);
    }
  }
}

TEST(VelocityGrid, ClosedBoxStoresNoWalls) {
  const VelocityGrid grid(
      40, 32, VelocityGrid::Place::kFaces, VelocityGrid::Box::kClosed);
  EXPECT_EQ(grid.component(0).size(), 40 * 31);
  EXPECT_EQ(grid.component(1).size(), 39 * 32);
  // What flows into the cells flows out of others.
  EXPECT_NEAR(
      (grid.divergence() * NormalVector(grid.size(), 1)).sum(), 0.0, 1e-12);
}

// A uniform velocity stays so wherever it is taken.
TEST(VelocityGrid, MapsAreMeans) {
  for (const VelocityGrid& grid : VelocityGrids()) {
    if (grid.cells().outside != Outside::kPeriodic) continue;
    const auto uniform = [](int n) {
      VectorXd both(2 * n);
      both << VectorXd::Constant(n, 2.0), VectorXd::Constant(n, -3.0);
      return both;
    };
    const int n = grid.num_cells();
    EXPECT_LT((grid.to_cells() * uniform(n) - uniform(n)).norm(), 1e-13);
    EXPECT_LT((grid.from_cells() * uniform(n) - uniform(n)).norm(), 1e-13);
    for (const int c : {0, 1}) {
      EXPECT_LT((grid.to_component(c) * uniform(n) - uniform(n)).norm(), 1e-13);
    }
  }
}

// The velocity (y, 0) in cells of a closed box, away from the walls: u_x on a
// face of a column is the mean of the four faces around it.
TEST(VelocityGrid, MeansAreThoseOfTheNeighbours) {
  const int rows = 5, cols = 4;
  const VelocityGrid grid(
      rows, cols, VelocityGrid::Place::kFaces, VelocityGrid::Box::kClosed);
  VectorXd u = VectorXd::Zero(grid.size());
  for (int i = 0; i < rows; ++i)
    u.segment(i * (cols - 1), cols - 1).setConstant(i);
  const VectorXd at_y_faces = grid.to_component(1) * u;
  const VectorXd at_cells = grid.to_cells() * u;
  for (int i = 0; i < rows - 1; ++i) {
    EXPECT_DOUBLE_EQ(at_y_faces[i * cols + 1], i + 0.5);
    // Half of the four faces are on the wall.
    EXPECT_DOUBLE_EQ(at_y_faces[i * cols], (i + 0.5) / 2.0);
    EXPECT_DOUBLE_EQ(at_cells[i * cols + 2], i);
    EXPECT_DOUBLE_EQ(at_cells[i * cols], i / 2.0);
  }
}

}  // namespace field_operators_test
}  // namespace invgrad
