#include "problems/navier_stokes/navier_stokes.h"

#include <cmath>
#include <memory>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/loss.h"
#include "problems/navier_stokes/time_reversal.h"
#include "tests/support/create_problem.h"
#include "tests/support/simulator_identities.h"

namespace invgrad {
namespace navier_stokes_test {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;
using Place = VelocityGrid::Place;

NavierStokesSettings Cells(int cells) {
  NavierStokesSettings settings;
  settings.cells = cells;
  return settings;
}

DataSet RandomBatch(const NavierStokesSettings& settings,
                    int num_samples,
                    NumpyRandom* random) {
  return NavierStokesSamples(
      settings, RandomNavierStokesFields(settings, num_samples, random));
}

// A smooth blob.
VectorXd Blob(const Vector2d& centre, const NavierStokesSettings& settings) {
  const int n = settings.cells;
  VectorXd marker(n * n);
  for (int p = 0; p < n * n; ++p) {
    const int row = p / n, col = p % n;
    const Vector2d r = settings.dx() * Vector2d(col + 0.5, row + 0.5) - centre;
    marker[p] = std::exp(-r.squaredNorm() / (2.0 * 15.0 * 15.0));
  }
  return marker;
}

TEST(InviscidFlow, ConservesTheEnergyOfEachComponentAndHasNoDivergence) {
  for (const Place place : {Place::kFaces, Place::kCentres}) {
    const NavierStokesSettings settings = Cells(32);
    const InviscidFlow flow(32, place, settings.courant());
    const VelocityGrid& grid = flow.grid();
    const VectorXd start = SwirlVelocity(Vector2d(3.0, -2.0), 1.0, settings);
    InviscidFlow::State state = {Blob({64.0, 64.0}, settings),
                                 grid.Project(grid.from_cells() * start)};
    std::vector<InviscidFlow::Step> steps;
    const InviscidFlow::State next = flow.Advance(state, &steps);
    for (const int c : {0, 1}) {
      EXPECT_NEAR(grid.Component(next.velocity, c).squaredNorm(),
                  grid.Component(state.velocity, c).squaredNorm(),
                  1e-10 * state.velocity.squaredNorm());
    }
    EXPECT_LT((grid.divergence() * steps[0].projected).norm(),
              1e-12 * state.velocity.norm());
    EXPECT_GE(next.marker.minCoeff(), state.marker.minCoeff() - 1e-14);
    EXPECT_LE(next.marker.maxCoeff(), state.marker.maxCoeff() + 1e-14);
  }
}

TEST(InviscidFlow, FluidAtRestStaysAtRest) {
  const InviscidFlow flow(8, Place::kFaces, 0.1);
  const InviscidFlow::State state = {NormalVector(64, 1), VectorXd::Zero(128)};
  std::vector<InviscidFlow::Step> steps;
  const InviscidFlow::State next = flow.Advance(state, &steps);
  EXPECT_EQ(next.marker, state.marker);
  EXPECT_EQ(next.velocity, state.velocity);
  EXPECT_TRUE(flow.PullBack(steps, NormalVector(64, 2)).allFinite());
}

TEST(NavierStokes, UniformFlowCarriesTheBlobToTheMiddle) {
  for (const int cells : {32, 64}) {
    const NavierStokesSettings settings = Cells(cells);
    const NavierStokesSimulator simulator(settings);
    const VectorXd marker = Blob({50.0, 75.0}, settings);
    const VectorXd x = SwirlVelocity(
        (Vector2d(64.0, 64.0) - CentreOfMass(marker, settings)) / 2.0,
        0.0,
        settings);
    VectorXd y(simulator.num_outputs());
    ASSERT_TRUE(simulator.Value(x.data(), marker.data(), y.data()));
    EXPECT_LT((CentreOfMass(y, settings) - Vector2d(64.0, 64.0)).norm(), 0.2);
  }
}

// The same run by PhiFlow 2.2.7 in double precision, with a pressure solve to
// 1e-13: five values of the last marker, and their sum over the cells.
TEST(NavierStokes, AgreesWithPhiFlow) {
  const NavierStokesSettings settings = Cells(16);
  const NavierStokesSimulator simulator(settings);
  const VectorXd marker = Blob({50.0, 75.0}, settings);
  const VectorXd x = SwirlVelocity(Vector2d(4.0, 1.0), 1.3, settings);
  const int cells[] = {
      7 * 16 + 6, 7 * 16 + 7, 8 * 16 + 8, 9 * 16 + 7, 6 * 16 + 9};
  const auto expect =
      [&](const VectorXd& y, const double(&values)[5], double sum) {
        for (int k = 0; k < 5; ++k) EXPECT_NEAR(y[cells[k]], values[k], 1e-12);
        EXPECT_NEAR(y.sum(), sum, 1e-11);
      };
  VectorXd y(256);
  ASSERT_TRUE(simulator.Value(x.data(), marker.data(), y.data()));
  expect(y,
         {0.8943519120662367,
          0.8531017822300766,
          0.4399396385509555,
          0.20713660881334311,
          0.6101969107501075},
         21.855473744192725);
  const InviscidFlow truth(16, Place::kCentres, settings.courant());
  InviscidFlow::State state = {marker, x};
  for (int t = 0; t < 8; ++t) state = truth.Advance(state, nullptr);
  expect(state.marker,
         {0.8829560743662077,
          0.8361744191207969,
          0.43618869174458497,
          0.19023717184319613,
          0.6299993161511465},
         21.864936581836318);
}

// The error of the marker for a smooth flow against twice as many cells.
TEST(NavierStokes, ConvergesWithTheGrid) {
  const auto run = [](int cells) {
    const NavierStokesSettings settings = Cells(cells);
    const NavierStokesSimulator simulator(settings);
    const VectorXd x = SwirlVelocity(Vector2d(4.0, 1.0), 0.3, settings);
    const VectorXd marker = Blob({56.0, 60.0}, settings);
    VectorXd y(simulator.num_outputs());
    EXPECT_TRUE(simulator.Value(x.data(), marker.data(), y.data()));
    return y;
  };
  const auto coarsen = [](const VectorXd& y, int cells) {
    VectorXd coarse(cells * cells);
    for (int p = 0; p < cells * cells; ++p) {
      const int low = p / cells * 2 * 2 * cells + p % cells * 2;
      coarse[p] = 0.25 * (y[low] + y[low + 1] + y[low + 2 * cells] +
                          y[low + 2 * cells + 1]);
    }
    return coarse;
  };
  const VectorXd y32 = run(32), y64 = run(64), y128 = run(128);
  const double coarse_error = (y32 - coarsen(y64, 32)).norm() / 32.0;
  const double fine_error = (y64 - coarsen(y128, 64)).norm() / 64.0;
  EXPECT_LT(fine_error, 0.4 * coarse_error);
}

TEST(NavierStokes, DerivativesAgree) {
  NumpyRandom random(1);
  const NavierStokesSettings settings = Cells(32);
  const DataSet batch = RandomBatch(settings, 1, &random);
  const NavierStokesSimulator simulator(settings);
  ExpectAdjointIdentity(
      simulator, batch.solutions.col(0), batch.contexts.col(0).data());
  // A smooth marker and few cells: no look-up lies within h of a kink.
  const NavierStokesSettings small = Cells(12);
  const NavierStokesSimulator coarse(small);
  const VectorXd x =
      SwirlVelocity(Vector2d(3.0, 2.0), 0.5, small) + NormalVector(288, 1);
  const VectorXd marker = Blob({60.0, 66.0}, small);
  ExpectAdjointIdentity(coarse, x, marker.data());
  ExpectTangentIsDifference(coarse, x, marker.data(), 1e-7, 1e-6);
}

TEST(NavierStokes, ReportsNoFiniteValue) {
  const NavierStokesSimulator simulator(Cells(8));
  VectorXd x = VectorXd::Ones(128), marker = VectorXd::Ones(64), y(64);
  x[5] = std::nan("");
  EXPECT_FALSE(simulator.Value(x.data(), marker.data(), y.data()));
  EXPECT_EQ(simulator.Linearize(x.data(), marker.data(), y.data()), nullptr);
}

TEST(NavierStokesData, AreAsDescribed) {
  NumpyRandom random(3), same(3);
  const NavierStokesSettings settings = Cells(64);
  const DataSet batch = RandomBatch(settings, 3, &random);
  std::string error;
  ASSERT_TRUE(batch.IsFinite(&error)) << error;
  EXPECT_EQ(RandomBatch(settings, 3, &same).targets, batch.targets);
  for (int i = 0; i < 3; ++i) {
    const VectorXd marker = batch.contexts.col(i);
    EXPECT_TRUE((marker.array() * (marker.array() - 1.0) == 0.0).all());
    EXPECT_GT(marker.sum(), 0.02 * 4096);
    EXPECT_LE(marker.sum(), 0.15 * 4096 + 1.0);
    EXPECT_EQ(batch.inputs.col(i).head(4096), marker);
    EXPECT_EQ(batch.inputs.col(i).tail(4096), batch.targets.col(i));
    // The uniform velocity is what moves it to the middle; swirl and
    // fluctuations have no mean over the box.
    const Vector2d mean(batch.solutions.col(i).head(4096).mean(),
                        batch.solutions.col(i).tail(4096).mean());
    EXPECT_LT(
        (2.0 * mean - Vector2d(64.0, 64.0) + CentreOfMass(marker, settings))
            .norm(),
        1e-9);
    // The swirl turns the blob about the middle while it gets there.
    EXPECT_LT(
        (CentreOfMass(batch.targets.col(i), settings) - Vector2d(64.0, 64.0))
            .norm(),
        16.0);
  }
}

TEST(NavierStokesData, RandomFieldHasNoLongWavesAndUnitVariance) {
  const FourierGrid grid(64, 64);
  NumpyRandom random(1);
  const VectorXd field = RandomField(grid, &random);
  EXPECT_NEAR(field.mean(), 0.0, 1e-12);
  EXPECT_NEAR(field.squaredNorm() / field.size(), 1.0, 1e-12);
  Eigen::ArrayXcd modes(grid.num_modes());
  grid.Forward(field.data(), modes.data());
  const double unit = std::pow(2.0 * M_PI / 64.0, 2);
  const Eigen::ArrayXd waves = grid.SquaredWaveNumbers() / unit;
  for (int k = 0; k < grid.num_modes(); ++k) {
    EXPECT_EQ(std::abs(modes[k]) > 1e-9, std::lround(waves[k]) >= 17) << k;
  }
}

TEST(NavierStokesData, TheFluctuationsAreTheFloorOfTheMetric) {
  NumpyRandom random(4);
  const NavierStokesSettings settings = Cells(64);
  const DataSet batch = RandomBatch(settings, 4, &random);
  const TimeReversal inverse(std::make_shared<NavierStokesSimulator>(settings),
                             TimeReversal::Way::kStraight);
  MatrixXd x = batch.solutions;
  for (int i = 0; i < 4; ++i) {
    const Vector2d way =
        Vector2d(64.0, 64.0) - CentreOfMass(batch.contexts.col(i), settings);
    x.col(i) = SwirlVelocity(
        way / 2.0, inverse.SwirlStrength(batch.solutions.col(i)), settings);
  }
  EXPECT_NEAR(MeanVelocityError(x, batch.solutions), 0.125, 0.01);
}

TEST(CoarseShapeLoss, IsItsFloorForAPerfectMatch) {
  const CoarseShapeLoss loss(64);
  const VectorXd y = NormalVector(4096, 1);
  // The mean does not count.
  const VectorXd shifted = y.array() + 3.0;
  double value = 0.0;
  VectorXd gradient(4096);
  ASSERT_TRUE(loss.Evaluate(
      shifted.data(), y.data(), &value, gradient.data(), nullptr));
  EXPECT_NEAR(value, 4096.0 * std::sqrt(1e-5), 1e-9);
  EXPECT_EQ(gradient, VectorXd::Zero(4096));
}

TEST(CoarseShapeLoss, WeighsTheWaves) {
  const CoarseShapeLoss loss(64);
  const double expected[] = {0.46, 0.044, 9e-4};
  for (const int waves : {1, 2, 3}) {
    const VectorXd y = VectorXd::NullaryExpr(4096, [&](Eigen::Index p) {
      return std::cos(2.0 * M_PI * waves * (p % 64) / 64.0);
    });
    const VectorXd zero = VectorXd::Zero(4096);
    double value = 0.0;
    ASSERT_TRUE(loss.Evaluate(y.data(), zero.data(), &value, nullptr, nullptr));
    // Two conjugate modes of 2048.
    const double weight = (value - 4094.0 * std::sqrt(1e-5)) / 4096.0;
    EXPECT_NEAR(weight, expected[waves - 1], 0.03 * expected[waves - 1]);
  }
}

TEST(CoarseShapeLoss, DerivativesAreThoseOfTheLoss) {
  for (const int cells : {6, 7}) {
    const CoarseShapeLoss loss(cells);
    const int n = loss.size();
    const VectorXd y = NormalVector(n, 1), target = NormalVector(n, 2);
    double value = 0.0, above = 0.0, below = 0.0;
    VectorXd gradient(n), gradient_above(n), gradient_below(n);
    ASSERT_TRUE(loss.Evaluate(
        y.data(), target.data(), &value, gradient.data(), nullptr));
    const double h = 1e-5;
    for (int i = 0; i < n; ++i) {
      const VectorXd di = h * VectorXd::Unit(n, i);
      const VectorXd y_above = y + di, y_below = y - di;
      ASSERT_TRUE(loss.Evaluate(y_above.data(),
                                target.data(),
                                &above,
                                gradient_above.data(),
                                nullptr));
      ASSERT_TRUE(loss.Evaluate(y_below.data(),
                                target.data(),
                                &below,
                                gradient_below.data(),
                                nullptr));
      EXPECT_NEAR(gradient[i], (above - below) / (2.0 * h), 1e-8);
      const VectorXd column =
          loss.HessianTimes(y.data(), target.data(), VectorXd::Unit(n, i));
      EXPECT_LT((column - (gradient_above - gradient_below) / (2.0 * h)).norm(),
                1e-7);
    }
  }
}

// The error of 8 steps forth and 8 back, as a share of how far they went: that
// of the time steps, on any grid.
TEST(TimeReversal, TheFlowRunsBack) {
  const NavierStokesSettings settings = Cells(32);
  const NavierStokesSimulator simulator(settings);
  const VectorXd marker = Blob({50.0, 60.0}, settings);
  const VectorXd x = SwirlVelocity(Vector2d(7.0, 2.0), 1.0, settings);
  const auto forward = simulator.Run(simulator.Start(x.data(), marker.data()));
  const auto backward = simulator.RunBack(forward.back());
  EXPECT_EQ(backward.back().velocity, forward.back().velocity);
  EXPECT_LT((backward.front().marker - marker).norm(),
            0.2 * (forward.back().marker - marker).norm());
  EXPECT_LT((backward.front().velocity - forward.front().velocity).norm(),
            0.1 * forward.front().velocity.norm());
  // The marker is passive.
  const auto other = simulator.RunBack({marker, forward.back().velocity});
  EXPECT_EQ(other.front().velocity, backward.front().velocity);
}

TEST(TimeReversal, FindsTheStrengthOfASwirlExactly) {
  const NavierStokesSettings settings = Cells(32);
  const TimeReversal inverse(std::make_shared<NavierStokesSimulator>(settings),
                             TimeReversal::Way::kStraight);
  const VectorXd x = SwirlVelocity(Vector2d(3.0, -5.0), -1.3, settings);
  EXPECT_NEAR(inverse.SwirlStrength(x), -1.3, 1e-12);
}

// From a wrong swirl the answer is nearer to the right one, on both sides.
TEST(TimeReversal, MovesTheSwirlTowardsTheTruth) {
  const NavierStokesSettings settings = Cells(64);
  const auto simulator = std::make_shared<NavierStokesSimulator>(settings);
  const VectorXd marker = Blob({48.0, 60.0}, settings);
  const Vector2d uniform =
      (Vector2d(64.0, 64.0) - CentreOfMass(marker, settings)) / 2.0;
  const double truth = 0.8;
  const VectorXd x_true = SwirlVelocity(uniform, truth, settings);
  VectorXd y(4096);
  ASSERT_TRUE(simulator->Value(x_true.data(), marker.data(), y.data()));
  for (const auto way :
       {TimeReversal::Way::kStraight, TimeReversal::Way::kReleased}) {
    const TimeReversal inverse(simulator, way);
    EXPECT_FALSE(inverse.reaches_target());
    for (const double wrong : {truth - 0.3, truth + 0.3}) {
      VectorXd x;
      std::string why;
      ASSERT_TRUE(inverse.Invert(
          y, SwirlVelocity(uniform, wrong, settings), marker, &x, &why))
          << why;
      EXPECT_LT(std::abs(inverse.SwirlStrength(x) - truth), 0.3);
    }
  }
}

TEST(TimeReversal, FindsTheSwirlsOfRandomSamples) {
  constexpr int kNumSamples = 8;
  const NavierStokesSettings settings = Cells(32);
  NumpyRandom random(5);
  const DataSet batch = RandomBatch(settings, kNumSamples, &random);
  for (const auto way :
       {TimeReversal::Way::kStraight, TimeReversal::Way::kReleased}) {
    const TimeReversal inverse(
        std::make_shared<NavierStokesSimulator>(settings), way);
    double at_first = 0.0, at_last = 0.0;
    for (int i = 0; i < kNumSamples; ++i) {
      const double truth = inverse.SwirlStrength(batch.solutions.col(i));
      // The first answer has the right uniform velocity.
      VectorXd x = VectorXd::Zero(batch.solutions.rows());
      at_first += std::abs(truth);
      for (int k = 0; k < 20; ++k) {
        VectorXd next;
        std::string why;
        ASSERT_TRUE(inverse.Invert(
            batch.targets.col(i), x, batch.contexts.col(i), &next, &why))
            << why;
        x = next;
      }
      at_last += std::abs(inverse.SwirlStrength(x) - truth);
    }
    EXPECT_LT(at_last, 0.3 * at_first);
  }
}

TEST(TimeReversal, AnEmptyMarkerHasNoInverse) {
  const NavierStokesSettings settings = Cells(8);
  const TimeReversal inverse(std::make_shared<NavierStokesSimulator>(settings),
                             TimeReversal::Way::kStraight);
  VectorXd x;
  std::string why;
  EXPECT_FALSE(inverse.Invert(
      VectorXd::Zero(64), VectorXd::Ones(128), VectorXd::Ones(64), &x, &why));
  EXPECT_FALSE(why.empty());
}

TEST(NavierStokesData, DeformationIsTheLargestDifferenceOfNeighbours) {
  const NavierStokesSettings settings = Cells(8);
  MatrixXd fields = MatrixXd::Zero(3 * 64, 2);
  EXPECT_EQ(GreatestDeformation(settings, fields), 0.0);
  // Across the periodic border of the rows, of u_x in the second sample.
  fields(64 + 3, 1) = -0.5;
  fields(64 + 56 + 3, 1) = 1.5;
  EXPECT_DOUBLE_EQ(GreatestDeformation(settings, fields),
                   2.0 * settings.courant());
}

LearningProblem CreateNetwork(const MatrixXd* data = nullptr) {
  return CreateLearningProblem("navier_stokes:resolution=8:num_samples=2",
                               data);
}

TEST(NavierStokesNetwork, MakesItsSamplesFromTheArray) {
  const LearningProblem problem = CreateNetwork();
  EXPECT_EQ(problem.data.rows(), 4);
  const MatrixXd half = 0.5 * problem.data;
  const LearningProblem given = CreateNetwork(&half);
  EXPECT_EQ(given.train.solutions, 0.5 * problem.train.solutions);
  EXPECT_EQ(given.test.contexts, 0.5 * problem.test.contexts);
}

TEST(NavierStokesNetwork, WarnsOfVelocitiesThatAreTooSteep) {
  MatrixXd data = CreateNetwork().data;
  data.rightCols(128).setZero();
  data(0, 64) = 1.1 / Cells(8).courant();
  testing::internal::CaptureStderr();
  CreateNetwork(&data);
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_NE(said.find("dt |du/dx| is 1.1 in the data"), std::string::npos)
      << said;
  data(0, 64) = 0.9 / Cells(8).courant();
  testing::internal::CaptureStderr();
  CreateNetwork(&data);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace navier_stokes_test
}  // namespace invgrad
