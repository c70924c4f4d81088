// Spectral steps with singular values at the threshold, against long double
// arithmetic.

#include <cmath>
#include <limits>
#include <utility>

#include "gtest/gtest.h"
#include "invgrad/spectral.h"
#include "tests/support/spectral_reference.h"
#include "tests/support/spectral_step_of.h"

namespace invgrad {
namespace spectral_accuracy_threshold_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// Powers of two: the thresholds are exact. Values on the threshold are on no
// side of it, and both routes say so.
TEST(SpectralAccuracyThreshold, ValuesOnItAreUndecided) {
  for (const int size : {14, 70}) {
    VectorXd s = VectorXd::Ones(size);
    s.segment(3 * size / 7, 5 * size / 14).setConstant(0.25);
    s.tail(3 * size / 14).setConstant(0.125);
    const MatrixXd J = s.asDiagonal();
    const VectorXd g = VectorXd::Ones(size);
    for (const SpectralRoute route :
         {SpectralRoute::kSvd, SpectralRoute::kGram, SpectralRoute::kAuto}) {
      SCOPED_TRACE(testing::Message()
                   << SpectralRouteName(route) << " " << size);
      SpectralStepSummary summary;
      StepOf(J, g, SpectralFilter::HalfInverse(0.25), route, &summary);
      EXPECT_EQ(summary.num_undecided, 5 * size / 14);
      if (route == SpectralRoute::kAuto) {
        EXPECT_EQ(summary.route, SpectralRoute::kSvd);
      }
      StepOf(J, g, SpectralFilter::HalfInverse(0.2), route, &summary);
      EXPECT_EQ(summary.num_undecided, 0);
      EXPECT_EQ(summary.rank, 11 * size / 14);
      EXPECT_NEAR(summary.s_min_kept, 0.25, 1e-12);
    }
  }
}

// Two values a hair to either side: rounding mixes their vectors by about
// epsilon s_max / gap (in s, or in s^2), and the estimate must say so, within
// two decades.
TEST(SpectralAccuracyThreshold, LeaksAcrossItAreEstimated) {
  RandomMatrices random(12);
  constexpr double kTau = 3e-2;
  for (const int size : {9, 64}) {
    for (const double hair : {1e-6, 1e-8, 1e-10}) {
      VectorXd s = LogUniform(size, 1e-2);
      for (double& value : s) {
        if (std::abs(value / kTau - 1.0) < 0.05) value = 0.9 * kTau;
      }
      s[size / 2] = kTau * (1.0 + hair);
      s[size - 1] = kTau * (1.0 - hair);
      const MatrixXd J = random.WithSpectrum(size, size + 16, s);
      const VectorXd g = random.Vector(size);
      const SpectralFilter filter = SpectralFilter::HalfInverse(kTau);
      const LongVector exact = SpectralReference(J).Step(filter, g);
      for (const auto& [route, gap] :
           {std::pair(SpectralRoute::kSvd, 2.0 * kTau * hair),
            std::pair(SpectralRoute::kGram, 4.0 * kTau * kTau * hair)}) {
        SCOPED_TRACE(testing::Message()
                     << SpectralRouteName(route) << " " << size << " " << hair);
        SpectralStepSummary summary;
        const VectorXd d = StepOf(J, g, filter, route, &summary);
        EXPECT_EQ(summary.num_undecided, 0);
        EXPECT_LE(Distance(d, exact), summary.estimated_error);
        EXPECT_GE(summary.estimated_error, 0.01 * kEpsilon / gap);
        EXPECT_LE(summary.estimated_error, 1e-9 + 100.0 * kEpsilon / gap);
      }
    }
  }
}

// With values undecided the step is that of a threshold within the resolution:
// the exact one of the rank that the summary states.
TEST(SpectralAccuracyThreshold, UndecidedStepsAreThoseOfANearbyThreshold) {
  RandomMatrices random(13);
  VectorXd s = LogUniform(64, 1e-5);
  constexpr double kTau = 1e-6;
  s[62] = 1.0005 * kTau;
  s[63] = 0.9995 * kTau;
  const MatrixXd J = random.WithSpectrum(64, 100, s);
  const VectorXd g = random.Vector(64);
  const SpectralReference reference(J);
  const SpectralFilter filter = SpectralFilter::HalfInverse(kTau);
  SpectralStepSummary summary;
  const VectorXd d = StepOf(J, g, filter, SpectralRoute::kGram, &summary);
  EXPECT_EQ(summary.num_undecided, 2);
  EXPECT_GE(summary.threshold_resolution, 0.0005);
  EXPECT_LE(summary.threshold_resolution, 0.05);
  ASSERT_GE(summary.rank, 62);
  SpectralFilter moved = filter;
  if (summary.rank == 62) moved.tau = 1.02 * kTau;
  if (summary.rank == 64) moved.tau = 0.98 * kTau;
  EXPECT_LE(Distance(d, reference.Step(moved, g)), summary.estimated_error);
  // The SVD resolves it.
  for (const SpectralRoute route :
       {SpectralRoute::kSvd, SpectralRoute::kAuto}) {
    const VectorXd decided = StepOf(J, g, filter, route, &summary);
    EXPECT_EQ(summary.num_undecided, 0);
    EXPECT_EQ(summary.rank, 63);
    EXPECT_LE(Distance(decided, reference.Step(filter, g)),
              summary.estimated_error);
  }
}

// One zero per sample, as the dipole has: repeated rows of J make them exact.
TEST(SpectralAccuracyThreshold, ExactZerosAreDroppedWhereTheyAreResolved) {
  RandomMatrices random(14);
  for (const int rank : {12, 72}) {
    const int zeros = rank / 3;
    MatrixXd J(rank + zeros, 2 * rank);
    J.topRows(rank) =
        random.WithSpectrum(rank, 2 * rank, LogUniform(rank, 1e-2));
    J.bottomRows(zeros) = J.topRows(zeros);
    const VectorXd g = random.Vector(rank + zeros);
    const SpectralReference reference(J);
    ASSERT_LT(reference.s(rank), 1e-17L * reference.s(0));
    SpectralStepSummary summary;
    SpectralFilter filter = SpectralFilter::HalfInverse(1e-4);
    VectorXd d = StepOf(J, g, filter, SpectralRoute::kAuto, &summary);
    EXPECT_EQ(summary.route, SpectralRoute::kGram);
    EXPECT_EQ(summary.num_undecided, 0);
    EXPECT_EQ(summary.rank, rank);
    EXPECT_LE(Distance(d, reference.Step(filter, g)), summary.estimated_error);

    filter.tau = 1e-10;
    StepOf(J, g, filter, SpectralRoute::kGram, &summary);
    EXPECT_EQ(summary.num_undecided, zeros);
    for (const SpectralRoute route :
         {SpectralRoute::kAuto, SpectralRoute::kSvd}) {
      d = StepOf(J, g, filter, route, &summary);
      EXPECT_EQ(summary.route, SpectralRoute::kSvd);
      EXPECT_EQ(summary.num_undecided, 0);
      EXPECT_EQ(summary.rank, rank);
      EXPECT_LE(Distance(d, reference.Step(filter, g)),
                summary.estimated_error);
      EXPECT_LE(summary.estimated_error, 1e-6);
    }

    // Clamping would raise them, but zeros have no direction: nobody can tell.
    filter.clamp = true;
    for (const SpectralRoute route : kBothRoutes) {
      StepOf(J, g, filter, route, &summary);
      EXPECT_EQ(summary.num_undecided, zeros) << SpectralRouteName(route);
    }
  }
}

}  // namespace spectral_accuracy_threshold_test
}  // namespace invgrad
