// The accuracy that spectral_step.h promises, for sizes at which the Gram
// matrix is reduced to tridiagonal form (spectral_step_test.cc has smaller
// ones): against long double arithmetic.
#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "Eigen/QR"
#include "bin/support/spectral_reference.h"
#include "gtest/gtest.h"
#include "invgrad/spectral/spectral_step.h"

namespace invgrad {
namespace spectral_accuracy_test {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// First-order theory says nothing about errors of order one.
constexpr double kMeaningful = 0.01;

SpectralRoute GramSide(const MatrixXd& J) {
  return J.rows() <= J.cols() ? SpectralRoute::kGram
                              : SpectralRoute::kParameterGram;
}

SpectralStepOptions Route(SpectralRoute route) {
  SpectralStepOptions options;
  options.route = route;
  // For which the cascade splits at 1e-3.
  if (route == SpectralRoute::kCascade) options.tolerance = 1e-8;
  return options;
}

VectorXd StepOf(const MatrixXd& J,
                const VectorXd& g,
                const SpectralFilter& filter,
                SpectralRoute route,
                SpectralStepSummary* summary) {
  VectorXd d = VectorXd::Zero(J.cols());
  EXPECT_TRUE(
      SpectralStep(DenseJacobian(J), g, filter, Route(route), &d, summary))
      << SpectralRouteName(route) << ": " << summary->message;
  return d;
}

double Distance(const VectorXd& d, const LongVector& exact) {
  return static_cast<double>((d.cast<long double>() - exact).norm() /
                             exact.norm());
}

std::vector<SpectralFilter> Filters() {
  std::vector<SpectralFilter> filters;
  for (const double kappa : {-1.0, -0.5, 0.0, 0.5, 1.0}) {
    for (const double tau : {0.0, 3.3e-2, 1e-3, 1e-4, 3.3e-6, 3.3e-9}) {
      filters.push_back(SpectralFilter::Power(kappa, tau));
    }
  }
  for (const double lambda : {0.0, 1e-3, 1e-6, 1e-14, 1e-18}) {
    filters.push_back(SpectralFilter::LevenbergMarquardt(0.0, lambda));
  }
  filters.push_back(SpectralFilter::LevenbergMarquardt(1e-4, 0.0));
  filters.back().tau = 1e-3;
  for (const double kappa : {-0.5, 0.0, 0.5, 0.75}) {
    for (const double lambda : {1e-2, 1e-6, 1e-10, 1e-14, 6e-15, 1e-18}) {
      for (const double tau : {0.0, 1e-4}) {
        filters.push_back(SpectralFilter::Power(kappa, tau));
        filters.back().relative_damping = lambda;
      }
    }
  }
  return filters;
}

std::string Describe(const SpectralFilter& filter) {
  std::ostringstream text;
  text << "kappa " << filter.kappa << ", tau " << filter.tau << ", damping "
       << filter.damping << " + " << filter.relative_damping << " s_max^2";
  return text.str();
}

struct Spectrum {
  std::string name;
  VectorXd s;
};

std::vector<Spectrum> Spectra(int k) {
  std::vector<Spectrum> spectra = {
      {"log-uniform to 1e-12", LogUniform(k, 1e-12)},
      {"log-uniform to 1e-4", LogUniform(k, 1e-4)},
      {"all equal", VectorXd::Ones(k)}};
  VectorXd s = VectorXd::Constant(k, 1e-3);
  s[0] = 1.0;
  spectra.push_back({"one dominant", s});
  for (int i = 0; i < k; ++i) {
    s[i] = (i < (k + 1) / 2 ? 1.0 : 1e-3) * (1.0 - 1e-9 * i);
  }
  spectra.push_back({"two clusters", s});
  s = LogUniform(k, 1e-7);
  s.tail(k / 5).setZero();
  spectra.push_back({"a fifth zero", s});
  s = LogUniform(k, 1e-2);
  s.tail(k / 4) *= 1e-7;
  spectra.push_back({"a gap of seven decades", s});
  s.setZero();
  s[0] = 1.0;
  spectra.push_back({"rank one", s});
  // All that the cascade leaves to the Gram matrix is just above its split.
  s = LogUniform(k, 1.3e-3);
  s.tail(k / 4) *= 1e-6;
  spectra.push_back({"a gap below 1e-3", s});
  return spectra;
}

struct Worst {
  int num_tested = 0;
  double ratio = 0.0;
  std::string where;
};

class SpectralAccuracy : public testing::TestWithParam<std::pair<int, int>> {};

// The contract: with nothing undecided the error is at most its estimate, and
// the rank is the exact one.
TEST_P(SpectralAccuracy, ErrorIsAtMostItsEstimate) {
  const auto [m, n] = GetParam();
  const int k = std::min(m, n);
  RandomMatrices random(17);
  Worst worst[3];
  for (const Spectrum& spectrum : Spectra(k)) {
    const MatrixXd J = random.WithSpectrum(m, n, spectrum.s);
    const SpectralReference reference(J);
    const SpectralRoute routes[] = {
        SpectralRoute::kSvd, GramSide(J), SpectralRoute::kCascade};
    // White data, data with all of it in the range of J, and data with hardly
    // anything there (if m > n).
    const Eigen::HouseholderQR<MatrixXd> qr(J);
    VectorXd rotated = qr.householderQ().transpose() * random.Vector(m);
    rotated.head(k) *= 1e-3;
    const VectorXd outside = qr.householderQ() * rotated;
    for (const VectorXd& g :
         {random.Vector(m), VectorXd(J * random.Vector(n)), outside}) {
      for (const SpectralFilter& filter : Filters()) {
        const LongVector exact = reference.Step(filter, g);
        const auto rank =
            (reference.s().array() >
             static_cast<long double>(filter.tau) * reference.s(0))
                .count();
        for (int r = 0; r < 3; ++r) {
          SpectralStepSummary summary;
          VectorXd d;
          if (!SpectralStep(DenseJacobian(J),
                            g,
                            filter,
                            Route(routes[r]),
                            &d,
                            &summary)) {
            // The cascade may refuse; nobody else.
            ASSERT_EQ(routes[r], SpectralRoute::kCascade) << summary.message;
            continue;
          }
          if (summary.num_undecided > 0) continue;
          const std::string where = std::string(SpectralRouteName(routes[r])) +
                                    ", " + spectrum.name + ", " +
                                    Describe(filter);
          if (filter.tau > 0.0) {
            EXPECT_EQ(summary.rank, rank) << where;
          }
          if (exact.norm() == 0.0L) {
            EXPECT_TRUE(d.isZero(0.0)) << where;
            continue;
          }
          if (!(summary.estimated_error <= kMeaningful)) continue;
          const double error = Distance(d, exact);
          EXPECT_LE(error, summary.estimated_error) << where;
          ++worst[r].num_tested;
          if (error > worst[r].ratio * summary.estimated_error) {
            worst[r].ratio = error / summary.estimated_error;
            worst[r].where = where;
          }
          // There is little to amplify a rounding; but the cascade's estimate
          // knows only its split.
          if (spectrum.name == "all equal") {
            EXPECT_LE(summary.estimated_error,
                      routes[r] == SpectralRoute::kCascade ? 1e-7 : 1e-11)
                << where;
          }
        }
      }
    }
  }
  for (const Worst& of_route : worst) EXPECT_GT(of_route.num_tested, 150);
  // What the XML report of the test holds.
  RecordProperty("svd", std::to_string(worst[0].ratio) + worst[0].where);
  RecordProperty("gram", std::to_string(worst[1].ratio) + worst[1].where);
  RecordProperty("cascade", std::to_string(worst[2].ratio) + worst[2].where);
}

INSTANTIATE_TEST_SUITE_P(Shapes,
                         SpectralAccuracy,
                         testing::Values(std::pair(64, 90),
                                         std::pair(90, 64),
                                         std::pair(65, 65)));

// Where a single product of g with a vector decides the error, an estimate by
// sampling must not be small just because another such product is: many g.
TEST(SpectralAccuracySampling, OneNumberDecides) {
  RandomMatrices random(5);
  VectorXd one_dominant = VectorXd::Constant(64, 1e-3);
  one_dominant[0] = 1.0;
  VectorXd rank_one = VectorXd::Zero(64);
  rank_one[0] = 1.0;
  VectorXd one_small = LogUniform(64, 1e-3);
  one_small[63] *= 0.1;
  for (const auto& [m, n] : {std::pair(64, 90), std::pair(90, 64)}) {
    for (const auto& [s, filter] :
         {std::pair(one_dominant, SpectralFilter::HalfInverse(0.033)),
          std::pair(rank_one, SpectralFilter::LevenbergMarquardt(0.0, 1e-3)),
          std::pair(one_small, SpectralFilter::HalfInverse(1e-6))}) {
      const MatrixXd J = random.WithSpectrum(m, n, s);
      const SpectralReference reference(J);
      int num_violated = 0;
      for (int draw = 0; draw < 300; ++draw) {
        const VectorXd g = random.Vector(m);
        SpectralStepSummary summary;
        const VectorXd d = StepOf(J, g, filter, GramSide(J), &summary);
        EXPECT_EQ(summary.num_undecided, 0);
        if (Distance(d, reference.Step(filter, g)) > summary.estimated_error) {
          ++num_violated;
        }
      }
      EXPECT_EQ(num_violated, 0) << m << ", s_1 = " << s[1];
    }
  }
}

// Half-inverse, white g, log-uniform spectrum, tau in the middle of a gap:
//   SVD      5 eps / tau_eff
//   cascade  10 eps / split^2 + 40 eps / tau_eff, split = 1e-3
//   Gram     10 eps / tau_eff^2
// tau_eff the smallest kept value. Many modes near the threshold add up, and a
// gap of 10^(-8 / 80) between neighbours leaks little.
TEST(SpectralAccuracyLaws, HalfInverseOfLogUniformSpectra) {
  RandomMatrices random(8);
  const VectorXd s = LogUniform(80, 1e-8);
  for (const auto& [m, n] : {std::pair(80, 110), std::pair(110, 80)}) {
    const MatrixXd J = random.WithSpectrum(m, n, s);
    const SpectralReference reference(J);
    const VectorXd g = random.Vector(m);
    for (const int rank : {15, 25, 35, 45, 55, 65, 75}) {
      const SpectralFilter filter =
          SpectralFilter::HalfInverse(TauAbove(s, rank));
      const double smallest = s[rank - 1];
      const LongVector exact = reference.Step(filter, g);
      SpectralStepSummary summary;
      const VectorXd by_svd =
          StepOf(J, g, filter, SpectralRoute::kSvd, &summary);
      EXPECT_LE(Distance(by_svd, exact),
                64.0 * kEpsilon + 5.0 * kEpsilon / smallest);
      EXPECT_EQ(summary.rank, rank);
      EXPECT_LE(summary.estimated_error, 100.0 * kEpsilon / smallest);
      const double gram_law = 10.0 * kEpsilon / (smallest * smallest);
      if (gram_law < kMeaningful) {
        const VectorXd by_gram = StepOf(J, g, filter, GramSide(J), &summary);
        EXPECT_LE(Distance(by_gram, exact), std::max(1e-12, gram_law));
        if (summary.num_undecided == 0) {
          EXPECT_EQ(summary.rank, rank);
        }
        EXPECT_LE(summary.estimated_error, 1e-12 + 30.0 * gram_law);
      }
      EXPECT_NEAR(summary.s_max, 1.0, 1e-12);
      EXPECT_NEAR(summary.s_min_kept, smallest, 0.01 * smallest);
      if (rank < 35) continue;  // too many small values
      const VectorXd by_cascade =
          StepOf(J, g, filter, SpectralRoute::kCascade, &summary);
      EXPECT_EQ(summary.num_undecided, 0);
      EXPECT_EQ(summary.rank, rank);
      EXPECT_LE(Distance(by_cascade, exact),
                10.0 * kEpsilon / 1e-6 + 40.0 * kEpsilon / smallest);
    }
  }
}

// diag(1, ..., 1, tau, ..., tau, 1/8, ...) with tau a power of two: values on
// the threshold are on no side of it, and every route says so.
TEST(SpectralAccuracyThreshold, ValuesOnItAreUndecided) {
  VectorXd s = VectorXd::Ones(70);
  s.segment(30, 25).setConstant(0.25);
  s.tail(15).setConstant(0.125);
  const MatrixXd J = s.asDiagonal();
  const VectorXd g = VectorXd::Ones(70);
  for (const SpectralRoute route : {SpectralRoute::kSvd,
                                    SpectralRoute::kGram,
                                    SpectralRoute::kParameterGram,
                                    SpectralRoute::kAuto}) {
    SCOPED_TRACE(SpectralRouteName(route));
    SpectralStepSummary summary;
    StepOf(J, g, SpectralFilter::HalfInverse(0.25), route, &summary);
    EXPECT_EQ(summary.num_undecided, 25);
    if (route == SpectralRoute::kAuto) {
      EXPECT_EQ(summary.route, SpectralRoute::kSvd);
    }
    StepOf(J, g, SpectralFilter::HalfInverse(0.2), route, &summary);
    EXPECT_EQ(summary.num_undecided, 0);
    EXPECT_EQ(summary.rank, 55);
    EXPECT_NEAR(summary.s_min_kept, 0.25, 1e-12);
  }
}

// Two values a hair to either side: rounding mixes their vectors by about
// epsilon s_max / gap (in s, or in s^2), and the estimate must say so, within
// two decades.
TEST(SpectralAccuracyThreshold, LeaksAcrossItAreEstimated) {
  RandomMatrices random(12);
  constexpr double kTau = 3e-2;
  for (const double hair : {1e-6, 1e-8, 1e-10}) {
    VectorXd s = LogUniform(64, 1e-2);
    for (double& value : s) {
      if (std::abs(value / kTau - 1.0) < 0.05) value = 0.9 * kTau;
    }
    s[40] = kTau * (1.0 + hair);
    s[63] = kTau * (1.0 - hair);
    const MatrixXd J = random.WithSpectrum(64, 80, s);
    const VectorXd g = random.Vector(64);
    const SpectralFilter filter = SpectralFilter::HalfInverse(kTau);
    const LongVector exact = SpectralReference(J).Step(filter, g);
    for (const auto& [route, gap] :
         {std::pair(SpectralRoute::kSvd, 2.0 * kTau * hair),
          std::pair(SpectralRoute::kCascade, 2.0 * kTau * hair),
          std::pair(SpectralRoute::kGram, 4.0 * kTau * kTau * hair)}) {
      SCOPED_TRACE(SpectralRouteName(route));
      SpectralStepSummary summary;
      const VectorXd d = StepOf(J, g, filter, route, &summary);
      EXPECT_EQ(summary.num_undecided, 0);
      EXPECT_LE(Distance(d, exact), summary.estimated_error);
      EXPECT_GE(summary.estimated_error, 0.01 * kEpsilon / gap);
      EXPECT_LE(summary.estimated_error, 1e-9 + 100.0 * kEpsilon / gap);
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
  // The others resolve it.
  for (const SpectralRoute route :
       {SpectralRoute::kSvd, SpectralRoute::kCascade, SpectralRoute::kAuto}) {
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
  MatrixXd J(80, 120);
  J.topRows(72) = random.WithSpectrum(72, 120, LogUniform(72, 1e-5));
  J.bottomRows(8) = J.topRows(8);
  const VectorXd g = random.Vector(80);
  const SpectralReference reference(J);
  ASSERT_LT(reference.s(72), 1e-17L * reference.s(0));
  SpectralStepSummary summary;
  SpectralFilter filter = SpectralFilter::HalfInverse(1e-4);
  VectorXd d = StepOf(J, g, filter, SpectralRoute::kGram, &summary);
  EXPECT_EQ(summary.num_undecided, 0);
  EXPECT_LE(Distance(d, reference.Step(filter, g)), summary.estimated_error);

  filter.tau = 1e-10;
  StepOf(J, g, filter, SpectralRoute::kGram, &summary);
  EXPECT_EQ(summary.num_undecided, 8);
  for (const SpectralRoute route :
       {SpectralRoute::kAuto, SpectralRoute::kCascade, SpectralRoute::kSvd}) {
    d = StepOf(J, g, filter, route, &summary);
    EXPECT_NE(summary.route, SpectralRoute::kGram);
    EXPECT_EQ(summary.num_undecided, 0);
    EXPECT_EQ(summary.rank, 72);
    EXPECT_LE(Distance(d, reference.Step(filter, g)), summary.estimated_error);
    EXPECT_LE(summary.estimated_error, 1e-6);
  }
}

// d scales as c^-kappa with J -> c J, at any c whose square is a number.
TEST(SpectralAccuracyScale, AnyScale) {
  RandomMatrices random(4);
  const VectorXd s = LogUniform(66, 1e-4);
  for (const auto& [m, n] : {std::pair(66, 80), std::pair(80, 66)}) {
    const MatrixXd J = random.WithSpectrum(m, n, s);
    const VectorXd g = random.Vector(m);
    for (const double kappa : {-0.5, 0.5, 1.0}) {
      const SpectralFilter filter = SpectralFilter::Power(kappa, 3.3e-4);
      for (const SpectralRoute route :
           {SpectralRoute::kSvd, GramSide(J), SpectralRoute::kCascade}) {
        SpectralStepSummary summary;
        const VectorXd d = StepOf(J, g, filter, route, &summary);
        const double estimate = summary.estimated_error;
        const int rank = summary.rank;
        for (const double scale : {1e-100, 1e-30, 1e30, 1e100}) {
          const VectorXd scaled =
              StepOf(scale * J, g, filter, route, &summary) *
              std::pow(scale, kappa);
          // The roundings of scale * J are of a size with one rounding of J.
          EXPECT_LE((scaled - d).norm(), 2.0 * estimate * d.norm())
              << SpectralRouteName(route) << " " << scale << " " << kappa;
          EXPECT_NEAR(summary.estimated_error, estimate, 0.2 * estimate);
          EXPECT_EQ(summary.rank, rank);
          EXPECT_NEAR(summary.s_max / scale, 1.0, 1e-12);
        }
        // The scale of g is g's own.
        const VectorXd scaled =
            StepOf(J, 1e150 * g, filter, route, &summary) * 1e-150;
        EXPECT_LE((scaled - d).norm(), 2.0 * estimate * d.norm());
      }
    }
  }
}

}  // namespace spectral_accuracy_test
}  // namespace invgrad
