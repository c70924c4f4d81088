#include "invgrad/spectral/spectral_step.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/QR"
#include "bin/support/spectral_reference.h"
#include "gtest/gtest.h"

namespace invgrad {
namespace spectral_step_test {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

using Random = RandomMatrices;
using Reference = SpectralReference;

SpectralStepOptions Route(SpectralRoute route) {
  SpectralStepOptions options;
  options.route = route;
  return options;
}

SpectralRoute GramSide(const MatrixXd& J) {
  return J.rows() <= J.cols() ? SpectralRoute::kGram
                              : SpectralRoute::kParameterGram;
}

VectorXd StepOf(const MatrixXd& J,
                const VectorXd& g,
                const SpectralFilter& filter,
                SpectralRoute route,
                SpectralStepSummary* summary) {
  VectorXd d;
  EXPECT_TRUE(
      SpectralStep(DenseJacobian(J), g, filter, Route(route), &d, summary))
      << summary->message;
  EXPECT_EQ(d.size(), J.cols());
  return d;
}

std::vector<SpectralFilter> AllFilters(const std::vector<double>& taus) {
  std::vector<SpectralFilter> filters;
  for (const double kappa : {-1.0, -0.5, 0.0, 0.5, 0.75, 1.0}) {
    for (const double tau : taus) {
      filters.push_back(SpectralFilter::Power(kappa, tau));
      filters.push_back(SpectralFilter::Power(kappa, tau));
      filters.back().clamp = true;
    }
  }
  for (const double lambda : {1.0, 1e-3, 1e-6, 1e-10}) {
    filters.push_back(SpectralFilter::LevenbergMarquardt(0.0, lambda));
  }
  for (const double kappa : {-0.5, 0.0, 0.5, 0.75}) {
    for (const double lambda : {1e-2, 1e-6, 1e-10, 1e-14, 1e-18}) {
      filters.push_back(SpectralFilter::Power(kappa, 0.0));
      filters.back().relative_damping = lambda;
      filters.push_back(filters.back());
      filters.back().tau = 1e-4;
      filters.push_back(filters.back());
      filters.back().clamp = true;
    }
  }
  return filters;
}

std::string Describe(const SpectralFilter& filter) {
  std::ostringstream text;
  text << "kappa " << filter.kappa << ", tau " << filter.tau
       << (filter.clamp ? ", clamped" : ", truncated") << ", damping "
       << filter.relative_damping;
  return text.str();
}

struct Spectrum {
  std::string name;
  std::function<VectorXd(int)> s;
};

std::vector<Spectrum> Spectra() {
  return {{"log-uniform to 1e-12", [](int k) { return LogUniform(k, 1e-12); }},
          {"log-uniform to 1e-4", [](int k) { return LogUniform(k, 1e-4); }},
          {"all equal", [](int k) { return VectorXd(VectorXd::Ones(k)); }},
          {"one dominant",
           [](int k) {
             VectorXd s = VectorXd::Constant(k, 1e-3);
             s[0] = 1.0;
             return s;
           }},
          {"two clusters", [](int k) {
             return VectorXd(VectorXd::NullaryExpr(k, [k](Index i) {
               return (i < (k + 1) / 2 ? 1.0 : 1e-3) * (1.0 - 1e-9 * i);
             }));
           }}};
}

// The contract of the header: with nothing undecided the error is at most its
// estimate, whatever the shape, spectrum, filter, data and route. The
// estimate must not be trivially large either: on equal values there is nothing
// to amplify a rounding.
TEST(SpectralStep, ErrorIsAtMostItsEstimate) {
  int num_tested = 0;
  Random random(5);
  const std::vector<std::pair<int, int>> shapes = {
      {12, 20}, {20, 12}, {16, 16}, {1, 9}, {9, 1}, {2, 40}, {40, 2}};
  for (const auto& [m, n] : shapes) {
    for (const Spectrum& spectrum : Spectra()) {
      const VectorXd s = spectrum.s(std::min(m, n));
      const MatrixXd J = random.WithSpectrum(m, n, s);
      const Reference reference(J);
      // White data, and data with all of it in the range of J.
      for (const VectorXd& g :
           {random.Vector(m), VectorXd(J * random.Vector(n))}) {
        for (const SpectralFilter& filter :
             AllFilters({0.0, 3.3e-2, 1e-4, 3.3e-6, 3.3e-9})) {
          for (const SpectralRoute route : {SpectralRoute::kSvd, GramSide(J)}) {
            SpectralStepSummary summary;
            const VectorXd d = StepOf(J, g, filter, route, &summary);
            if (summary.num_undecided > 0) continue;
            // First-order theory says nothing about errors of order one.
            if (summary.estimated_error > 0.01) continue;
            EXPECT_LE(reference.RelativeError(filter, g, d),
                      summary.estimated_error)
                << SpectralRouteName(route) << " " << m << " x " << n << " "
                << spectrum.name << " " << Describe(filter);
            ++num_tested;
            if (spectrum.name == "all equal") {
              EXPECT_LE(summary.estimated_error, 200 * kEpsilon);
            }
          }
        }
      }
    }
  }
  EXPECT_GT(num_tested, 2000);
}

// Half-inverse, white data, log-uniform spectrum, tau in the middle of a gap:
// the laws eps / tau_eff and eps / tau_eff^2 for the estimate and so for the
// error, with room for some modes near the threshold that add up.
TEST(SpectralStep, AccuracyFollowsTheThreshold) {
  Random random(8);
  const VectorXd s = LogUniform(37, 1e-12);
  const MatrixXd J = random.WithSpectrum(37, 50, s);
  const VectorXd g = random.Vector(37);
  const Reference reference(J);
  for (const int rank : {4, 7, 10, 13, 16, 19}) {
    const SpectralFilter filter =
        SpectralFilter::HalfInverse(TauAbove(s, rank));
    const double smallest = s[rank - 1];
    for (const auto& [route, bound] :
         {std::pair(SpectralRoute::kSvd, 25.0 * kEpsilon / smallest),
          std::pair(SpectralRoute::kGram,
                    25.0 * kEpsilon / (smallest * smallest))}) {
      SpectralStepSummary summary;
      const VectorXd d = StepOf(J, g, filter, route, &summary);
      EXPECT_EQ(summary.rank, rank);
      EXPECT_EQ(summary.num_undecided, 0);
      EXPECT_LE(reference.RelativeError(filter, g, d), bound);
      EXPECT_LE(summary.estimated_error, bound + 64 * kEpsilon);
      EXPECT_NEAR(summary.s_max, 1.0, 1e-13);
      EXPECT_NEAR(summary.s_min_kept, smallest, 0.01 * smallest);
    }
  }
}

// Two values a hair to either side of the threshold: rounding mixes their
// singular vectors by about epsilon / gap, and the estimate has to say so.
TEST(SpectralStep, EstimateKnowsOfLeaksAcrossTheThreshold) {
  Random random(12);
  VectorXd s = LogUniform(9, 1e-2);
  constexpr double kGap = 1e-8;
  s[7] = 3e-2 * (1.0 + kGap);
  s[8] = 3e-2 * (1.0 - kGap);
  const MatrixXd J = random.WithSpectrum(9, 12, s);
  const VectorXd g = random.Vector(9);
  const SpectralFilter filter = SpectralFilter::HalfInverse(3e-2);
  for (const auto& [route, gap] :
       {std::pair(SpectralRoute::kSvd, 6e-2 * kGap),
        std::pair(SpectralRoute::kGram, 4.0 * 9e-4 * kGap)}) {
    SpectralStepSummary summary;
    const VectorXd d = StepOf(J, g, filter, route, &summary);
    EXPECT_EQ(summary.num_undecided, 0);
    EXPECT_LE(Reference(J).RelativeError(filter, g, d),
              summary.estimated_error);
    EXPECT_GE(summary.estimated_error, 0.1 * kEpsilon / gap);
    EXPECT_LE(summary.estimated_error, 100.0 * kEpsilon / gap);
  }
}

TEST(SpectralStep, AutoTakesTheGramSideWhereItIsAccurate) {
  Random random(2);
  for (const auto& [m, n] : {std::pair(15, 30), std::pair(30, 15)}) {
    const MatrixXd J = random.WithSpectrum(m, n, LogUniform(15, 1e-3));
    SpectralStepSummary summary;
    StepOf(J,
           random.Vector(m),
           SpectralFilter::HalfInverse(1e-6),
           SpectralRoute::kAuto,
           &summary);
    EXPECT_EQ(summary.route, GramSide(J));
    EXPECT_EQ(summary.rank, 15);
    EXPECT_EQ(summary.message, "");
    EXPECT_LE(summary.estimated_error, 1e-6);
  }
}

TEST(SpectralStep, AutoTakesTheSvdWhereSquaringHurts) {
  Random random(2);
  const VectorXd s = LogUniform(15, 1e-12);
  const MatrixXd J = random.WithSpectrum(15, 30, s);
  const VectorXd g = random.Vector(15);
  const SpectralFilter filter = SpectralFilter::HalfInverse(TauAbove(s, 8));
  SpectralStepSummary summary;
  const VectorXd d = StepOf(J, g, filter, SpectralRoute::kAuto, &summary);
  EXPECT_EQ(summary.route, SpectralRoute::kSvd);
  EXPECT_EQ(summary.rank, 8);
  EXPECT_EQ(summary.message.rfind("gram: estimated error", 0), 0u)
      << summary.message;
  EXPECT_LE(Reference(J).RelativeError(filter, g, d), 1e-9);
  // A user who is content with less gets the fast route.
  SpectralStepOptions loose;
  loose.tolerance = 1e-2;
  VectorXd unused;
  ASSERT_TRUE(
      SpectralStep(DenseJacobian(J), g, filter, loose, &unused, &summary));
  EXPECT_EQ(summary.route, SpectralRoute::kGram);
}

// Structural zeros (one per sample in the quantum dipole): repeated rows of J
// make them exact. With tau = 1e-4 squaring leaves them far below the
// threshold; with tau = 1e-10 the Gram matrix cannot tell them from it.
TEST(SpectralStep, ExactZerosAreDecidedOnlyIfResolved) {
  Random random(3);
  MatrixXd J(18, 40);
  J.topRows(12) = random.WithSpectrum(12, 40, LogUniform(12, 1e-2));
  J.bottomRows(6) = J.topRows(6);
  const VectorXd g = random.Vector(18);
  const Reference reference(J);
  ASSERT_LT(reference.s(12), 1e-18 * reference.s(0));
  SpectralStepSummary summary;
  SpectralFilter filter = SpectralFilter::HalfInverse(1e-4);
  VectorXd d = StepOf(J, g, filter, SpectralRoute::kAuto, &summary);
  EXPECT_EQ(summary.route, SpectralRoute::kGram);
  EXPECT_EQ(summary.rank, 12);
  EXPECT_LE(reference.RelativeError(filter, g, d), summary.estimated_error);

  filter.tau = 1e-10;
  StepOf(J, g, filter, SpectralRoute::kGram, &summary);
  EXPECT_EQ(summary.num_undecided, 6);
  d = StepOf(J, g, filter, SpectralRoute::kAuto, &summary);
  EXPECT_EQ(summary.route, SpectralRoute::kSvd);
  EXPECT_EQ(summary.num_undecided, 0);
  EXPECT_EQ(summary.rank, 12);
  EXPECT_EQ(summary.message, "gram: 6 values undecided");
  EXPECT_LE(reference.RelativeError(filter, g, d), summary.estimated_error);

  // Clamping would raise them, but zeros have no direction: nobody can tell.
  filter.clamp = true;
  for (const SpectralRoute route :
       {SpectralRoute::kSvd, SpectralRoute::kGram}) {
    StepOf(J, g, filter, route, &summary);
    EXPECT_EQ(summary.num_undecided, 6) << SpectralRouteName(route);
  }
}

// s = 1, 1e-6 (1 + 1e-3), 0.5e-6: the Gram matrix resolves a threshold of 1e-6
// to some 2e-3, the SVD much better.
TEST(SpectralStep, AutoKeepsAnUndecidedValueIfTheThresholdMayBeThatUnsharp) {
  const MatrixXd J = Eigen::Vector3d(1.0, 1.001e-6, 0.5e-6).asDiagonal();
  const VectorXd g = Eigen::Vector3d(1.0, 1e-9, 1e-9);
  const SpectralFilter filter = SpectralFilter::HalfInverse(1e-6);
  SpectralStepOptions options;
  options.tolerance = 1.0;
  SpectralStepSummary summary;
  VectorXd d;
  ASSERT_TRUE(SpectralStep(DenseJacobian(J), g, filter, options, &d, &summary));
  EXPECT_EQ(summary.route, SpectralRoute::kSvd);
  EXPECT_EQ(summary.rank, 2);
  EXPECT_EQ(summary.num_undecided, 0);
  EXPECT_LT(summary.threshold_resolution, 1e-8);

  options.threshold_tolerance = 0.01;
  ASSERT_TRUE(SpectralStep(DenseJacobian(J), g, filter, options, &d, &summary));
  EXPECT_EQ(summary.route, SpectralRoute::kGram);
  EXPECT_EQ(summary.num_undecided, 1);
  EXPECT_GT(summary.threshold_resolution, 1e-3);
  EXPECT_LT(summary.threshold_resolution, 0.01);

  // A threshold of zero is never resolved by a Gram matrix.
  const MatrixXd singular = Eigen::Vector3d(1.0, 0.5, 0.0).asDiagonal();
  ASSERT_TRUE(SpectralStep(DenseJacobian(singular),
                           g,
                           SpectralFilter::HalfInverse(0.0),
                           options,
                           &d,
                           &summary));
  EXPECT_EQ(summary.route, SpectralRoute::kSvd);
}

TEST(SpectralStep, AValueAtTheThresholdIsReportedAsUndecided) {
  // Powers of two: the thresholds are exact.
  const MatrixXd J = Eigen::Vector4d(1.0, 0.5, 0.25, 0.125).asDiagonal();
  const VectorXd g = VectorXd::Ones(4);
  for (const SpectralRoute route : {SpectralRoute::kSvd,
                                    SpectralRoute::kGram,
                                    SpectralRoute::kParameterGram}) {
    SpectralStepSummary summary;
    const VectorXd d =
        StepOf(J, g, SpectralFilter::GaussNewton(0.25), route, &summary);
    EXPECT_EQ(summary.num_undecided, 1);
    EXPECT_EQ(summary.rank, 2);
    EXPECT_EQ(summary.s_max, 1.0);
    EXPECT_EQ(summary.s_min_kept, 0.5);
    EXPECT_LE((d - Eigen::Vector4d(1.0, 2.0, 0.0, 0.0)).norm(), 8 * kEpsilon);
    StepOf(J, g, SpectralFilter::GaussNewton(0.2), route, &summary);
    EXPECT_EQ(summary.num_undecided, 0);
    EXPECT_EQ(summary.rank, 3);
  }
  SpectralStepSummary summary;
  StepOf(
      J, g, SpectralFilter::GaussNewton(0.25), SpectralRoute::kAuto, &summary);
  EXPECT_EQ(summary.route, SpectralRoute::kSvd);
}

// d scales as c^-kappa with J -> c J, at any c whose square is a number.
TEST(SpectralStep, AnyScale) {
  Random random(4);
  const VectorXd s = LogUniform(10, 1e-3);
  for (const auto& [m, n] : {std::pair(10, 14), std::pair(14, 10)}) {
    const MatrixXd J = random.WithSpectrum(m, n, s);
    const VectorXd g = random.Vector(m);
    for (const double kappa : {-0.5, 0.5, 1.0}) {
      const SpectralFilter filter = SpectralFilter::Power(kappa, 1e-6);
      SpectralStepSummary summary;
      for (const SpectralRoute route : {SpectralRoute::kSvd, GramSide(J)}) {
        const VectorXd d = StepOf(J, g, filter, route, &summary);
        const double estimate = summary.estimated_error;
        for (const double scale : {1e-100, 1e-30, 1e30, 1e100}) {
          const VectorXd scaled =
              StepOf(scale * J, g, filter, route, &summary) *
              std::pow(scale, kappa);
          EXPECT_LE((scaled - d).norm(), 2.0 * estimate * d.norm())
              << SpectralRouteName(route) << " " << scale << " " << kappa;
          EXPECT_NEAR(summary.estimated_error, estimate, 0.01 * estimate);
          EXPECT_EQ(summary.rank, 10);
          EXPECT_NEAR(summary.s_max / scale, 1.0, 1e-13);
        }
      }
      // The scale of g is g's own.
      const VectorXd d = StepOf(J, g, filter, SpectralRoute::kAuto, &summary);
      const VectorXd scaled =
          StepOf(J, 1e150 * g, filter, SpectralRoute::kAuto, &summary) * 1e-150;
      EXPECT_LE((scaled - d).norm(), 2.0 * summary.estimated_error * d.norm());
    }
  }
}

TEST(SpectralStep, WhereSquaresOverOrUnderflowAutoTakesTheSvd) {
  Random random(4);
  const MatrixXd J = random.WithSpectrum(6, 8, LogUniform(6, 1e-2));
  const VectorXd g = random.Vector(6);
  const SpectralFilter filter = SpectralFilter::HalfInverse(1e-6);
  SpectralStepSummary summary;
  const VectorXd d = StepOf(J, g, filter, SpectralRoute::kSvd, &summary);
  for (const double scale : {1e-170, 1e-140, 1e170}) {
    VectorXd scaled;
    EXPECT_FALSE(SpectralStep(DenseJacobian(scale * J),
                              g,
                              filter,
                              Route(SpectralRoute::kGram),
                              &scaled,
                              &summary));
    EXPECT_NE(summary.message, "");
    scaled = StepOf(scale * J, g, filter, SpectralRoute::kAuto, &summary);
    EXPECT_EQ(summary.route, SpectralRoute::kSvd);
    EXPECT_LE((scaled * std::sqrt(scale) - d).norm(), 1e-12 * d.norm());
  }
}

TEST(SpectralStep, GradientDescentNeedsNoFactorization) {
  Random random(6);
  const MatrixXd J = random.WithSpectrum(5, 7, LogUniform(5, 1e-9));
  const VectorXd g = random.Vector(5);
  const VectorXd gradient = J.transpose() * g;
  SpectralStepSummary summary;
  const VectorXd d = StepOf(
      J, g, SpectralFilter::GradientDescent(), SpectralRoute::kAuto, &summary);
  EXPECT_EQ(summary.route, SpectralRoute::kGradient);
  EXPECT_LE((d - gradient).norm(), 8 * kEpsilon * gradient.norm());
  // The other routes agree; the Gram route as well as its estimate says.
  for (const SpectralRoute route :
       {SpectralRoute::kSvd, SpectralRoute::kGram}) {
    const VectorXd other =
        StepOf(J, g, SpectralFilter::GradientDescent(), route, &summary);
    EXPECT_LE((other - gradient).norm(),
              summary.estimated_error * gradient.norm());
  }
}

TEST(SpectralStep, GaussNewtonIsLeastSquares) {
  Random random(7);
  for (const auto& [m, n] : {std::pair(9, 14), std::pair(14, 9)}) {
    const MatrixXd J = random.WithSpectrum(m, n, LogUniform(9, 1e-2));
    const VectorXd g = random.Vector(m);
    const VectorXd least_squares = J.completeOrthogonalDecomposition().solve(g);
    for (const SpectralRoute route :
         {SpectralRoute::kAuto, SpectralRoute::kSvd}) {
      SpectralStepSummary summary;
      const VectorXd d =
          StepOf(J, g, SpectralFilter::GaussNewton(1e-9), route, &summary);
      // The QR solution has an error of its own, epsilon times the condition.
      EXPECT_LE((d - least_squares).norm(),
                (summary.estimated_error + 1e-13) * least_squares.norm());
    }
  }
}

// Every route, where one side is larger than it need be, too.
TEST(SpectralStep, AllRoutesAgreeOnBothShapes) {
  Random random(9);
  for (const auto& [m, n] : {std::pair(6, 11), std::pair(11, 6)}) {
    const MatrixXd J = random.WithSpectrum(m, n, LogUniform(6, 1e-2));
    const VectorXd g = random.Vector(m);
    const SpectralFilter filter = SpectralFilter::HalfInverse(1e-4);
    SpectralStepSummary summary;
    const VectorXd d = StepOf(J, g, filter, SpectralRoute::kSvd, &summary);
    for (const SpectralRoute route :
         {SpectralRoute::kGram, SpectralRoute::kParameterGram}) {
      const VectorXd other = StepOf(J, g, filter, route, &summary);
      EXPECT_LE((other - d).norm(), summary.estimated_error * d.norm());
      EXPECT_LE(summary.estimated_error, 1e-9);
      EXPECT_EQ(summary.rank, 6);
    }
  }
}

TEST(SpectralStep, ZeroJacobianOrZeroDataGiveAZeroStep) {
  for (const SpectralRoute route : {SpectralRoute::kAuto,
                                    SpectralRoute::kSvd,
                                    SpectralRoute::kGram,
                                    SpectralRoute::kParameterGram}) {
    for (const bool clamp : {false, true}) {
      SpectralFilter filter = SpectralFilter::HalfInverse(1e-3);
      filter.clamp = clamp;
      SpectralStepSummary summary;
      VectorXd d = StepOf(
          MatrixXd::Zero(3, 5), VectorXd::Ones(3), filter, route, &summary);
      EXPECT_TRUE(d.isZero(0.0));
      EXPECT_EQ(summary.rank, 0);
      d = StepOf(Random(1).WithSpectrum(3, 5, LogUniform(3, 0.1)),
                 VectorXd::Zero(3),
                 filter,
                 route,
                 &summary);
      EXPECT_TRUE(d.isZero(0.0));
      EXPECT_EQ(summary.rank, 3);
      EXPECT_EQ(summary.estimated_error, 0.0);
    }
  }
}

TEST(SpectralStep, RefusesWhatIsNotFinite) {
  for (const SpectralRoute route : {SpectralRoute::kAuto,
                                    SpectralRoute::kSvd,
                                    SpectralRoute::kGram,
                                    SpectralRoute::kParameterGram,
                                    SpectralRoute::kGradient}) {
    const SpectralFilter filter = route == SpectralRoute::kGradient
                                      ? SpectralFilter::GradientDescent()
                                      : SpectralFilter::HalfInverse(1e-6);
    for (const double bad : {kNaN, kInfinity, -kInfinity}) {
      MatrixXd J = MatrixXd::Identity(3, 4);
      VectorXd g = VectorXd::Ones(3);
      VectorXd d;
      SpectralStepSummary summary;
      g[1] = bad;
      EXPECT_FALSE(SpectralStep(
          DenseJacobian(J), g, filter, Route(route), &d, &summary));
      EXPECT_EQ(summary.message.rfind("g is not finite: row 1 is ", 0), 0u)
          << summary.message;
      g[1] = 1.0;
      J(2, 3) = bad;
      EXPECT_FALSE(SpectralStep(
          DenseJacobian(J), g, filter, Route(route), &d, &summary));
      EXPECT_EQ(summary.message, "J is not finite: row 2");
    }
  }
}

TEST(SpectralStep, RefusesAStepThatOverflows) {
  VectorXd d;
  SpectralStepSummary summary;
  EXPECT_FALSE(SpectralStep(DenseJacobian(MatrixXd::Constant(1, 1, 1e-200)),
                            VectorXd::Constant(1, 1e200),
                            SpectralFilter::GaussNewton(0.0),
                            SpectralStepOptions(),
                            &d,
                            &summary));
  EXPECT_EQ(summary.message, "the step is not finite: entry 0 is inf");
}

// Levenberg-Marquardt tends to Gauss-Newton and to short gradient steps.
TEST(SpectralStep, LevenbergMarquardtLimits) {
  Random random(10);
  const MatrixXd J = random.WithSpectrum(8, 12, LogUniform(8, 1e-1));
  const VectorXd g = random.Vector(8);
  SpectralStepSummary summary;
  const auto step = [&](const SpectralFilter& filter) {
    return StepOf(J, g, filter, SpectralRoute::kAuto, &summary);
  };
  const VectorXd gauss_newton = step(SpectralFilter::GaussNewton(0.0));
  // s / (s^2 + lambda) = 1 / s (1 - lambda / s^2 + ...), s >= 0.1.
  const VectorXd weak = step(SpectralFilter::LevenbergMarquardt(1e-8, 0.0));
  EXPECT_LE((weak - gauss_newton).norm(), 2e-6 * gauss_newton.norm());
  EXPECT_GE((weak - gauss_newton).norm(), 1e-9 * gauss_newton.norm());
  EXPECT_LE((step(SpectralFilter::LevenbergMarquardt(0.0, 0.0)) - gauss_newton)
                .norm(),
            1e-12 * gauss_newton.norm());
  const VectorXd gradient = J.transpose() * g;
  const VectorXd strong = step(SpectralFilter::LevenbergMarquardt(1e8, 0.0));
  EXPECT_LE((1e8 * strong - gradient).norm(), 2e-8 * gradient.norm());
}

TEST(SpectralStepDeathTest, CallerBugsAreChecked) {
  const DenseJacobian J(MatrixXd::Identity(2, 3));
  VectorXd d;
  SpectralStepSummary summary;
  EXPECT_DEATH(SpectralStep(J,
                            VectorXd::Ones(3),
                            SpectralFilter(),
                            SpectralStepOptions(),
                            &d,
                            &summary),
               "g.size");
  EXPECT_DEATH(SpectralStep(J,
                            VectorXd::Ones(2),
                            SpectralFilter::Power(3.0, 0.0),
                            SpectralStepOptions(),
                            &d,
                            &summary),
               "kappa=3 is out of range");
  EXPECT_DEATH(SpectralStep(J,
                            VectorXd::Ones(2),
                            SpectralFilter(),
                            Route(SpectralRoute::kGradient),
                            &d,
                            &summary),
               "only computes phi");
}

}  // namespace spectral_step_test
}  // namespace invgrad
