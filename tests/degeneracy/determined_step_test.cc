#include "invgrad/determined_step.h"

#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "Eigen/Dense"
#include "gtest/gtest.h"
#include "invgrad/internal/qr.h"
#include "tests/support/least_squares.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace determined_step_test {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Options = DeterminedStepOptions;

constexpr double kPi = 3.14159265358979323846;

Options WithGroups(const std::vector<int>& sizes, double tau = 0.1) {
  Options options;
  options.tau = tau;
  options.group_sizes = sizes;
  return options;
}

template <typename Step>
VectorXd StepOf(Step* determined, const MatrixXd& J, const VectorXd& r) {
  typename Step::Vector step;
  std::string error;
  EXPECT_TRUE(
      determined->Compute(J.transpose() * J, J.transpose() * r, &step, &error))
      << error;
  return step;
}

VectorXd StepOf(const Options& options, const MatrixXd& J, const VectorXd& r) {
  DeterminedStep determined(options);
  return StepOf(&determined, J, r);
}

// Point-to-plane rows (n, p x n) of a corridor of 2 m by 3 m along x, with
// normals that are off by angles of standard deviation `sigma`.
MatrixXd Corridor(int num_rows, double sigma, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::normal_distribution<double> gauss;
  MatrixXd J(num_rows, 6);
  for (int i = 0; i < num_rows; ++i) {
    const int axis = 1 + i % 2;
    Vector3d n = (i % 4 < 2 ? 1.0 : -1.0) * Vector3d::Unit(axis);
    Vector3d p(
        5.0 * uniform(generator), uniform(generator), 1.5 * uniform(generator));
    p[axis] = -n[axis] * (axis == 1 ? 1.0 : 1.5);
    n[0] += sigma * gauss(generator);
    n[3 - axis] += sigma * gauss(generator);
    n.normalize();
    J.row(i) << n.transpose(), p.cross(n).transpose();
  }
  return J;
}

TEST(DeterminedStep, IsGaussNewtonWhereEverythingIsDetermined) {
  for (int n = 1; n <= 6; ++n) {
    const MatrixXd J = RandomMatrix(40, n, n);
    const VectorXd r = RandomMatrix(40, 1, 10 + n);
    DeterminedStep determined;
    const VectorXd expected = -LeastSquares(J, r);
    EXPECT_LT((StepOf(&determined, J, r) - expected).norm(),
              1e-12 * expected.norm());
    EXPECT_EQ(determined.num_left_alone(), 0);
    EXPECT_EQ(determined.Report(), "all " + std::to_string(n) + " determined");
    EXPECT_EQ(determined.singular_values()[n - 1], 1.0);
  }
}

// With one unit for all unknowns the step is that of the truncated SVD.
TEST(DeterminedStep, IsTheTruncatedPseudoInverse) {
  const MatrixXd U = Orthonormalized(RandomMatrix(20, 5, 1));
  const MatrixXd V = Orthonormalized(RandomMatrix(5, 5, 2));
  VectorXd s(5);
  s << 3.0, 2.0, 1.0, 0.2, 0.01;
  const MatrixXd J = U * s.asDiagonal() * V.transpose();
  const VectorXd r = RandomMatrix(20, 1, 3);
  DeterminedStep determined(WithGroups({5}, 0.1));
  const VectorXd step = StepOf(&determined, J, r);
  VectorXd inverse = s.cwiseInverse();
  inverse.tail(2).setZero();
  const VectorXd expected =
      -V * inverse.asDiagonal() * (U.transpose() * r).eval();
  EXPECT_LT((step - expected).norm(), 1e-12 * expected.norm());
  ASSERT_EQ(determined.num_left_alone(), 2);
  EXPECT_NEAR(determined.left_alone_values()[0], 0.01 / 3.0, 1e-12);
  EXPECT_NEAR(determined.left_alone_values()[1], 0.2 / 3.0, 1e-12);
  for (int i = 0; i < 2; ++i) {
    const VectorXd motion = determined.left_alone().col(i);
    EXPECT_EQ(motion.cwiseAbs().maxCoeff(), 1.0);
    EXPECT_NEAR(std::abs(motion.normalized().dot(V.col(4 - i))), 1.0, 1e-10);
    EXPECT_LT(std::abs(step.dot(motion)), 1e-12);
  }
}

// H is diag(16, 1, 1, 1, 1), D = 2: all numbers are exact, s = s_max / 4.
TEST(DeterminedStep, AValueAtTheThresholdIsLeftAlone) {
  VectorXd diagonal = VectorXd::Ones(5);
  diagonal[0] = 16.0;
  const MatrixXd J = diagonal.cwiseSqrt().asDiagonal();
  for (const auto& [tau, num_left_alone] :
       {std::pair(0.25, 4), std::pair(std::nextafter(0.25, 0.0), 0)}) {
    DeterminedStep determined(WithGroups({5}, tau));
    const VectorXd step = StepOf(&determined, J, VectorXd::Ones(5));
    EXPECT_EQ(determined.num_left_alone(), num_left_alone);
    EXPECT_EQ(step[1], num_left_alone == 0 ? -1.0 : 0.0);
    EXPECT_NEAR(step[0], -0.25, 1e-15);
  }
}

// Metres or millimetres, radians or degrees, and any scale of the residuals.
TEST(DeterminedStep, IsFreeOfUnits) {
  MatrixXd J = Corridor(400, 0.01, 1);
  J.col(5) = J.col(4) + 1e-3 * J.col(5);
  const VectorXd r = RandomMatrix(400, 1, 2);
  for (const std::vector<int>& groups :
       {std::vector<int>{}, std::vector<int>{3, 3}}) {
    DeterminedStep reference(WithGroups(groups));
    const VectorXd expected = StepOf(&reference, J, r);
    EXPECT_GT(reference.num_left_alone(), 0);
    for (const double length : {1e3, 1e-3, 39.37}) {
      for (const double angle : {180.0 / kPi, 1.0, 1e9}) {
        VectorXd unit(6);
        unit << length, length, length, angle, angle, angle;
        DeterminedStep determined(WithGroups(groups));
        const VectorXd step =
            StepOf(&determined,
                   length * J * unit.cwiseInverse().asDiagonal(),
                   length * r);
        EXPECT_EQ(determined.num_left_alone(), reference.num_left_alone());
        EXPECT_LT((step.cwiseQuotient(unit) - expected).norm(),
                  1e-9 * expected.norm());
        EXPECT_LT(
            (determined.singular_values() - reference.singular_values()).norm(),
            1e-7);
      }
    }
  }
}

// With the groups {3, 3}, the coordinates may be rotated.
TEST(DeterminedStep, RotatesWithTheCoordinatesOfAGroup) {
  const MatrixXd J = Corridor(400, 0.01, 1);
  const VectorXd r = RandomMatrix(400, 1, 2);
  const VectorXd expected = StepOf(WithGroups({3, 3}), J, r);
  const Matrix3d R =
      Eigen::AngleAxisd(0.7, Vector3d(1.0, -2.0, 0.5).normalized())
          .toRotationMatrix();
  MatrixXd rotated(6, 6);
  rotated << R, Matrix3d::Zero(), Matrix3d::Zero(), R;
  const VectorXd step = StepOf(WithGroups({3, 3}), J * rotated.transpose(), r);
  EXPECT_LT((step - rotated * expected).norm(), 1e-10 * expected.norm());
}

// The header's example: two walls along (cos a, sin a), the pose e too close to
// one of them.
TEST(DeterminedStep, OneScaleForTheTranslationKeepsTheStepOffTheCorridor) {
  const double a = 10.0 / 180.0 * kPi;
  const double e = 0.1;
  const Eigen::Vector2d along(std::cos(a), std::sin(a));
  const Eigen::Vector2d normal(-std::sin(a), std::cos(a));
  MatrixXd J(2, 2);
  J << normal.transpose(), -normal.transpose();
  const VectorXd r = Eigen::Vector2d(-e, e);
  const VectorXd grouped = StepOf(WithGroups({2}), J, r);
  EXPECT_NEAR(grouped.dot(normal), e, 1e-14);
  EXPECT_NEAR(grouped.dot(along), 0.0, 1e-14);
  const VectorXd by_columns = StepOf(WithGroups({}), J, r);
  EXPECT_NEAR(by_columns.dot(normal), e, 1e-13);
  EXPECT_NEAR(std::abs(by_columns.dot(along)), e / std::tan(2.0 * a), 1e-13);
}

// Noise of the normals alone gives sqrt(3) sigma along the corridor, with a
// relative standard deviation of 1 / sqrt(2 m); s_max >= 1.
TEST(DeterminedStep, TheNoiseOfNormalsIsBelowItsThreshold) {
  for (const double sigma : {0.003, 0.03, 0.1}) {
    Options options = WithGroups({3, 3}, Options::TauForNormals(sigma));
    EXPECT_NEAR(options.tau, 2.0 * std::sqrt(3.0) * sigma, 1e-15);
    DeterminedStep determined(options);
    StepOf(&determined, Corridor(4000, sigma, 7), RandomMatrix(4000, 1, 8));
    ASSERT_EQ(determined.num_left_alone(), 1) << sigma;
    const VectorXd motion = determined.left_alone().col(0);
    EXPECT_EQ(motion[0], 1.0);
    EXPECT_LT(motion.tail(5).norm(), 0.2);
    EXPECT_LE(determined.left_alone_values()[0], std::sqrt(3.0) * sigma * 1.1);
  }
}

// Exact normals of a corridor of 2 m by 3 m or, round, of a tunnel with a radius
// of 2 m, along x: J and the noise of normals that are off by 0.03 rad.
struct Scan {
  Scan(double half_length, bool is_round, double sigma) {
    std::mt19937 generator(3);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    std::normal_distribution<double> gauss;
    J.resize(2000, 6);
    for (int i = 0; i < J.rows(); ++i) {
      const double angle = kPi * uniform(generator);
      Vector3d n(0.0, std::cos(angle), std::sin(angle));
      Vector3d p = -2.0 * n;
      if (!is_round) {
        const int axis = 1 + i % 2;
        n = (i % 4 < 2 ? 1.0 : -1.0) * Vector3d::Unit(axis);
        p = {0.0, uniform(generator), 1.5 * uniform(generator)};
        p[axis] = -n[axis] * (axis == 1 ? 1.0 : 1.5);
      }
      p[0] = half_length * uniform(generator);
      n += sigma *
           Vector3d(gauss(generator), gauss(generator), gauss(generator));
      J.row(i) << n.transpose(), p.cross(n).transpose();
      DeterminedStep::AddNoiseOfNormal(p, 0.03, &noise);
    }
  }
  MatrixXd J;
  Eigen::Matrix<double, 6, 6> noise = Eigen::Matrix<double, 6, 6>::Zero();
};

// Without the noise, tau = 0.1 leaves roll alone from +-16 m on.
TEST(DeterminedStep, ByItsNoiseRollIsDeterminedInACorridorOfAnyLength) {
  for (const double half_length : {2.0, 16.0, 40.0, 200.0, 1000.0}) {
    for (const bool is_round : {false, true}) {
      for (const double sigma : {0.0, 0.03}) {
        SCOPED_TRACE(testing::Message() << half_length << ' ' << is_round);
        const Scan scan(half_length, is_round, sigma);
        const VectorXd r = RandomMatrix(scan.J.rows(), 1, 2);
        DeterminedStep determined(WithGroups({3, 3}));
        determined.SetNoise(scan.noise);
        const VectorXd step = StepOf(&determined, scan.J, r);
        // The tunnel leaves roll open, too.
        ASSERT_EQ(determined.num_left_alone(), is_round ? 2 : 1)
            << determined.Report();
        EXPECT_LT(determined.left_alone().bottomRows(2).norm(), 0.05);
        // In millimetres and degrees.
        VectorXd unit(6);
        unit << 1e3, 1e3, 1e3, 180.0 / kPi, 180.0 / kPi, 180.0 / kPi;
        const MatrixXd to_units = unit.cwiseInverse().asDiagonal();
        determined.Reset();
        determined.SetNoise(to_units * scan.noise * to_units);
        const VectorXd in_units = StepOf(&determined, scan.J * to_units, r);
        EXPECT_EQ(determined.num_left_alone(), is_round ? 2 : 1);
        EXPECT_LT((in_units.cwiseQuotient(unit) - step).norm(),
                  1e-6 * step.norm());
      }
    }
  }
}

TEST(DeterminedStep, NoiseMustBeAGramMatrix) {
  DeterminedStep determined;
  DeterminedStep::Vector step;
  std::string error;
  determined.SetNoise(-MatrixXd::Identity(6, 6));
  EXPECT_FALSE(determined.Compute(
      MatrixXd::Identity(6, 6), VectorXd::Ones(6), &step, &error));
  EXPECT_EQ(error, "the noise is not finite, or not positive semidefinite");
}

TEST(DeterminedStep, ZeroColumnsAndZeroMatricesAreLeftAlone) {
  MatrixXd J = RandomMatrix(30, 6, 1);
  J.col(2).setZero();
  const VectorXd r = RandomMatrix(30, 1, 2);
  DeterminedStep determined;
  const VectorXd step = StepOf(&determined, J, r);
  EXPECT_EQ(determined.num_left_alone(), 1);
  EXPECT_LT(determined.left_alone_values()[0], 1e-7);
  EXPECT_EQ(determined.left_alone()(2, 0), 1.0);
  EXPECT_LT(std::abs(step[2]), 1e-14);
  const std::string report = determined.Report();
  EXPECT_EQ(report.substr(0, 27), "1 of 6 left alone: s/s_max ") << report;
  EXPECT_EQ(report.substr(report.rfind(':')), ": +1 [2]") << report;
  EXPECT_TRUE(StepOf(&determined, MatrixXd::Zero(30, 6), r).isZero(0.0));
  EXPECT_EQ(determined.num_left_alone(), 6);
  EXPECT_TRUE(determined.singular_values().isZero(0.0));
}

TEST(DeterminedStep, RefusesValuesThatAreNotFinite) {
  DeterminedStep determined;
  MatrixXd J = RandomMatrix(30, 6, 1);
  J.col(2).setZero();
  StepOf(&determined, J, RandomMatrix(30, 1, 2));
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity()}) {
    for (const bool in_gradient : {true, false}) {
      MatrixXd H = MatrixXd::Identity(6, 6);
      VectorXd gradient = VectorXd::Ones(6);
      (in_gradient ? gradient[3] : H(4, 3)) = bad;
      DeterminedStep::Vector step;
      std::string error;
      EXPECT_FALSE(determined.Compute(H, gradient, &step, &error));
      EXPECT_TRUE(step.isZero(0.0));
      EXPECT_EQ(error, "the Gram matrix or the gradient is not finite");
      EXPECT_EQ(determined.num_left_alone(), 1);
    }
  }
}

// Two values rise and fall by a little around tau, and cross each other.
TEST(DeterminedStep, HysteresisFollowsTheDirectionNotTheIndex) {
  const MatrixXd V = Orthonormalized(RandomMatrix(3, 3, 2));
  Options options = WithGroups({3}, 0.1);
  options.tau_high = 0.2;
  DeterminedStep determined(options);
  const auto count = [&](double first, double second) {
    const MatrixXd J =
        Vector3d(1.0, first, second).asDiagonal() * V.transpose();
    StepOf(&determined, J, VectorXd::Ones(3));
    return determined.num_left_alone();
  };
  const auto is_second = [&] {
    return std::abs(determined.left_alone().col(0).normalized().dot(V.col(2))) >
           0.999;
  };
  EXPECT_EQ(count(0.15, 0.12), 0);  // nothing was left alone before
  EXPECT_EQ(count(0.15, 0.09), 1);
  EXPECT_TRUE(is_second());
  EXPECT_EQ(count(0.15, 0.11), 1);
  EXPECT_EQ(count(0.15, 0.19), 1);  // the larger of the two stays left alone
  EXPECT_TRUE(is_second());
  EXPECT_EQ(count(0.17, 0.17), 1);  // any basis of the two would be as good
  EXPECT_TRUE(is_second());
  EXPECT_EQ(count(0.15, 0.21), 0);
  EXPECT_EQ(count(0.15, 0.19), 0);
  EXPECT_EQ(count(0.05, 0.09), 2);
  EXPECT_EQ(count(0.15, 0.15), 2);
  determined.Reset();
  EXPECT_EQ(count(0.15, 0.15), 0);
}

// In the band, the step on the kept directions is that of least squares on
// them, and leaves the others alone.
TEST(DeterminedStep, SolvesOnTheKeptDirectionsInTheBand) {
  Options options = WithGroups({3}, 0.1);
  options.tau_high = 0.5;
  DeterminedStep determined(options);
  const VectorXd r = RandomMatrix(3, 1, 4);
  MatrixXd J = Vector3d(1.0, 0.3, 0.05).asDiagonal();
  StepOf(&determined, J, r);
  // The direction of 0.05 has turned by 30 degrees against the eigenvectors.
  const Matrix3d turn =
      Eigen::AngleAxisd(kPi / 6.0, Vector3d::UnitX()).toRotationMatrix();
  J = Vector3d(1.0, 0.3, 0.2).asDiagonal() * turn;
  const VectorXd step = StepOf(&determined, J, r);
  ASSERT_EQ(determined.num_left_alone(), 1);
  const MatrixXd kept = Vector3d(determined.left_alone().col(0))
                            .normalized()
                            .jacobiSvd(Eigen::ComputeFullU)
                            .matrixU()
                            .rightCols(2);
  const VectorXd expected = -kept * LeastSquares(J * kept, r);
  EXPECT_LT((step - expected).norm(), 1e-12);
  EXPECT_NEAR(
      std::abs(determined.left_alone().col(0).normalized()[2]), 1.0, 1e-12);
}

TEST(DeterminedStep, OfAnySizeIsTheSame) {
  const MatrixXd J = Corridor(400, 0.01, 1);
  const VectorXd r = RandomMatrix(400, 1, 2);
  DeterminedStepOfAnySize any(WithGroups({3, 3}));
  EXPECT_LT((StepOf(&any, J, r) - StepOf(WithGroups({3, 3}), J, r)).norm(),
            1e-12);
  MatrixXd wide = RandomMatrix(60, 40, 5);
  wide.col(7) = wide.col(3);
  DeterminedStepOfAnySize large;
  const VectorXd step = StepOf(&large, wide, RandomMatrix(60, 1, 6));
  EXPECT_GE(large.num_left_alone(), 1);
  EXPECT_NEAR(step[7], step[3], 1e-10);
}

TEST(DeterminedStep, OptionsAreChecked) {
  std::string error;
  for (const double tau : {0.0, 1.0, -1.0, std::nan("")}) {
    EXPECT_FALSE(WithGroups({}, tau).IsValid(&error)) << tau;
  }
  Options options;
  EXPECT_TRUE(options.IsValid(&error));
  EXPECT_NEAR(options.TauHigh(), std::sqrt(2.0) * 0.1, 1e-15);
  options.tau_high = 0.05;
  EXPECT_FALSE(options.IsValid(&error));
  EXPECT_FALSE(WithGroups({3, 0}).IsValid(&error));
  EXPECT_DEATH(StepOf(WithGroups({3, 2}), MatrixXd::Ones(6, 6), VectorXd(6)),
               "do not add up to 6");
}

}  // namespace determined_step_test
}  // namespace invgrad
