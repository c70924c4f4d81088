// The accuracy that spectral_step.h promises, against long double arithmetic:
// below size 64, where all eigenvectors are computed, and from there on, where
// the Gram matrix is reduced to tridiagonal form.

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/spectral.h"
#include "tests/support/spectral_reference.h"
#include "tests/support/spectral_step_of.h"

namespace invgrad {
namespace spectral_accuracy_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// First-order theory says nothing about errors of order one.
constexpr double kMeaningful = 0.01;

std::vector<SpectralFilter> Filters() {
  std::vector<SpectralFilter> filters;
  for (const double kappa : {-1.0, -0.5, 0.0, 0.5, 1.0}) {
    for (const double tau : {0.0, 3.3e-2, 1e-3, 1e-4, 3.3e-6, 3.3e-9}) {
      filters.push_back(SpectralFilter::Power(kappa, tau));
    }
  }
  for (const double lambda : {0.0, 1.0, 1e-3, 1e-6, 1e-14, 1e-18}) {
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
  // Clamped, by all eigenvectors at any size.
  const size_t num_truncated = filters.size();
  for (size_t i = 0; i < num_truncated; i += 3) {
    if (filters[i].tau == 0.0) continue;
    filters.push_back(filters[i]);
    filters.back().clamp = true;
  }
  return filters;
}

std::string Describe(const SpectralFilter& filter) {
  std::ostringstream text;
  text << "kappa " << filter.kappa << ", tau " << filter.tau
       << (filter.clamp ? ", clamped" : "") << ", damping " << filter.damping
       << " + " << filter.relative_damping << " s_max^2";
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
  return spectra;
}

// All but a thousandth of it outside the range of J, if m > n.
VectorXd MostlyOutside(const MatrixXd& J, RandomMatrices* random) {
  VectorXd g = random->Vector(static_cast<int>(J.rows()));
  if (J.rows() <= J.cols()) return 1e-3 * g;
  SpectralStepSummary summary;
  const VectorXd fit = StepOf(
      J, g, SpectralFilter::GaussNewton(1e-6), SpectralRoute::kSvd, &summary);
  return g - (1.0 - 1e-3) * (J * fit);
}

class SpectralAccuracy : public testing::TestWithParam<std::pair<int, int>> {};

// The contract: with nothing undecided the error is at most its estimate, and
// the rank is the exact one.
TEST_P(SpectralAccuracy, ErrorIsAtMostItsEstimate) {
  const auto [m, n] = GetParam();
  const int k = std::min(m, n);
  RandomMatrices random(17);
  int num_tested[2] = {0, 0};
  double worst[2] = {0.0, 0.0};
  for (const Spectrum& spectrum : Spectra(k)) {
    const MatrixXd J = random.WithSpectrum(m, n, spectrum.s);
    const SpectralReference reference(J);
    // White data, data with all of it in the range of J, and data with hardly
    // anything there (if m > n).
    for (const VectorXd& g : {random.Vector(m),
                              VectorXd(J * random.Vector(n)),
                              MostlyOutside(J, &random)}) {
      for (const SpectralFilter& filter : Filters()) {
        const LongVector exact = reference.Step(filter, g);
        const auto rank =
            (reference.s().array() >
             static_cast<long double>(filter.tau) * reference.s(0))
                .count();
        for (int r = 0; r < 2; ++r) {
          SpectralStepSummary summary;
          const VectorXd d = StepOf(J, g, filter, kBothRoutes[r], &summary);
          if (summary.num_undecided > 0) continue;
          const std::string where =
              std::string(SpectralRouteName(kBothRoutes[r])) + ", " +
              spectrum.name + ", " + Describe(filter);
          // A clamped phi does not jump at tau.
          if (filter.tau > 0.0 && !filter.clamp) {
            EXPECT_EQ(summary.rank, rank) << where;
          }
          if (exact.norm() == 0.0L) {
            EXPECT_TRUE(d.isZero(0.0)) << where;
            continue;
          }
          if (!(summary.estimated_error <= kMeaningful)) continue;
          const double error = Distance(d, exact);
          EXPECT_LE(error, summary.estimated_error) << where;
          ++num_tested[r];
          worst[r] = std::max(worst[r], error / summary.estimated_error);
          // Only what g has outside the range of J, a thousand times as much
          // as in it, amplifies the 200 epsilon or so of equal values.
          if (spectrum.name == "all equal") {
            EXPECT_LE(summary.estimated_error, 1e3 * 400.0 * kEpsilon) << where;
          }
        }
      }
    }
  }
  for (int r = 0; r < 2; ++r) {
    EXPECT_GT(num_tested[r], 150);
    // In the XML report.
    RecordProperty(SpectralRouteName(kBothRoutes[r]), std::to_string(worst[r]));
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes,
                         SpectralAccuracy,
                         testing::Values(std::pair(1, 9),
                                         std::pair(40, 2),
                                         std::pair(12, 20),
                                         std::pair(20, 12),
                                         std::pair(16, 16),
                                         std::pair(64, 90),
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
        const VectorXd d = StepOf(J, g, filter, SpectralRoute::kGram, &summary);
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
//   svd   5 eps / tau_eff
//   gram  10 eps / tau_eff^2
// tau_eff the smallest kept value. A backward error E turns the vectors of the
// two values next to the threshold by |E| / gap. They are 21 % (k = 80) or 40 %
// (k = 37) apart: |E| = epsilon s_max and a gap of 0.2 s give 5 eps / tau_eff;
// in s^2 the gap is 0.4 s^2, and the reduction of K has |E| up to 4 epsilon
// s_max^2.
TEST(SpectralAccuracyLaws, HalfInverseOfLogUniformSpectra) {
  RandomMatrices random(8);
  for (const auto& [m, n] : {std::pair(80, 110),
                             std::pair(110, 80),
                             std::pair(37, 50),
                             std::pair(50, 37)}) {
    const int k = std::min(m, n);
    const VectorXd s = LogUniform(k, 1e-8);
    const MatrixXd J = random.WithSpectrum(m, n, s);
    const SpectralReference reference(J);
    const VectorXd g = random.Vector(m);
    for (const double share : {0.2, 0.3, 0.45, 0.55, 0.7, 0.8, 0.95}) {
      const int rank = static_cast<int>(share * k);
      SCOPED_TRACE(testing::Message() << m << " x " << n << ", rank " << rank);
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
      EXPECT_NEAR(summary.s_max, 1.0, 1e-12);
      EXPECT_NEAR(summary.s_min_kept, smallest, 0.01 * smallest);
      const double gram_law = 10.0 * kEpsilon / (smallest * smallest);
      if (gram_law > kMeaningful) continue;
      const VectorXd by_gram =
          StepOf(J, g, filter, SpectralRoute::kGram, &summary);
      EXPECT_LE(Distance(by_gram, exact), std::max(1e-12, gram_law));
      if (summary.num_undecided == 0) {
        EXPECT_EQ(summary.rank, rank);
      }
      EXPECT_LE(summary.estimated_error, 1e-12 + 30.0 * gram_law);
      EXPECT_NEAR(summary.s_max, 1.0, 1e-12);
      EXPECT_NEAR(summary.s_min_kept, smallest, 0.01 * smallest);
    }
  }
}

// d scales as c^-kappa with J -> c J, at any c whose square is a number.
TEST(SpectralAccuracyScale, AnyScale) {
  RandomMatrices random(4);
  for (const auto& [m, n] : {std::pair(10, 14),
                             std::pair(14, 10),
                             std::pair(66, 80),
                             std::pair(80, 66)}) {
    const int k = std::min(m, n);
    const MatrixXd J = random.WithSpectrum(m, n, LogUniform(k, 1e-4));
    const VectorXd g = random.Vector(m);
    for (const double kappa : {-0.5, 0.5, 1.0}) {
      const SpectralFilter filter = SpectralFilter::Power(kappa, 3.3e-4);
      for (const SpectralRoute route : kBothRoutes) {
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
            StepOf(J, 1e100 * g, filter, route, &summary) * 1e-100;
        EXPECT_LE((scaled - d).norm(), 2.0 * estimate * d.norm());
      }
    }
  }
}

}  // namespace spectral_accuracy_test
}  // namespace invgrad
