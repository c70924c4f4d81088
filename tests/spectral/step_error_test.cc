// The estimates of step_error.h against what they are meant to be: the root
// mean square of the step's change over random perturbations.
#include "invgrad/spectral/step_error.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/spectral_reference.h"

namespace invgrad {
namespace step_error_test {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

std::vector<SpectralFilter> Filters() {
  return {SpectralFilter::Power(-0.5, 1e-3),
          SpectralFilter::Power(0.0, 0.1),
          SpectralFilter::HalfInverse(1e-3),
          SpectralFilter::HalfInverse(0.1),
          SpectralFilter::GaussNewton(0.05),
          SpectralFilter::LevenbergMarquardt(0.0, 1e-2)};
}

std::string Describe(const SpectralFilter& filter) {
  return "kappa " + std::to_string(filter.kappa) + ", tau " +
         std::to_string(filter.tau) + ", damping " +
         std::to_string(filter.relative_damping);
}

// f(K) b with f(lambda) = phi(s) / s.
VectorXd GramFunction(const SpectralFilter& filter,
                      const MatrixXd& K,
                      double s_max,
                      const VectorXd& b) {
  const SymmetricEigen eigen(K);
  VectorXd f(b.size());
  for (Index i = 0; i < b.size(); ++i) {
    const double s = std::sqrt(std::max(eigen.values[i], 0.0));
    const double phi = filter(s, s_max);
    f[i] = phi == 0.0 ? 0.0 : phi / s;
  }
  return eigen.U * f.cwiseProduct(eigen.U.transpose() * b);
}

// Perturbations this large are far above rounding and far below the spectrum's
// gaps; as many give the mean to some 15 %.
constexpr double kSize = 1e-8;
constexpr int kNumDraws = 40;

// What remains of an estimate without roundings, per size of a perturbation.
double Sensitivity(double estimate, Index size) {
  return (estimate - RoundingError()) / BackwardError(size);
}

// Spectra with no two values close to each other: no gap between divided
// differences and slopes.
VectorXd Spectrum(Index k) { return LogUniform(static_cast<int>(k), 1e-2); }

TEST(StepError, SvdEstimateIsTheMeanChangeOfTheStep) {
  RandomMatrices random(1);
  for (const auto& [m, n] :
       {std::pair(12, 12), std::pair(12, 30), std::pair(30, 12)}) {
    const Index k = std::min(m, n);
    const MatrixXd J = random.WithSpectrum(m, n, Spectrum(k));
    const VectorXd g = random.Vector(m);
    for (const SpectralFilter& filter : Filters()) {
      const SpectralReference reference(J);
      const LongVector step = reference.Step(filter, g);
      const VectorXd c = reference.Components(g).cast<double>();
      double squared = 0.0;
      for (int draw = 0; draw < kNumDraws; ++draw) {
        MatrixXd perturbed = J;
        for (int j = 0; j < n; ++j)
          perturbed.col(j) += kSize * random.Vector(m);
        squared += static_cast<double>(
            (SpectralReference(perturbed).Step(filter, g) - step)
                .squaredNorm() /
            step.squaredNorm());
      }
      const double measured = std::sqrt(squared / kNumDraws) / kSize;
      const double outside =
          std::sqrt(std::max(0.0, g.squaredNorm() - c.squaredNorm()));
      const VectorXd s = reference.s().cast<double>();
      const double estimated = Sensitivity(
          SvdStepError(filter, s, s[0], c, m > n ? outside : 0.0, n > m), k);
      // For wide J the estimate counts k columns more than rows, as backward
      // errors of a factorization do, and not n - k of them.
      EXPECT_LE(measured, 2.0 * estimated)
          << m << " x " << n << " " << Describe(filter);
      EXPECT_GE(measured, 0.5 * estimated)
          << m << " x " << n << " " << Describe(filter);
    }
  }
}

TEST(StepError, GramEstimatesAreTheMeanChangeOfTheStep) {
  RandomMatrices random(2);
  constexpr int k = 12;
  const VectorXd s = Spectrum(k);
  const MatrixXd J = random.WithSpectrum(k, k, s);
  const VectorXd g = random.Vector(k);
  for (const bool parameter_side : {false, true}) {
    const MatrixXd K = parameter_side ? MatrixXd(J.transpose() * J)
                                      : MatrixXd(J * J.transpose());
    const VectorXd b = parameter_side ? VectorXd(J.transpose() * g) : g;
    const SymmetricEigen eigen(K);
    const VectorXd lambda = eigen.values / eigen.values[k - 1];
    const VectorXd c = eigen.U.transpose() * b;
    const double s_max = std::sqrt(eigen.values[k - 1]);
    for (const SpectralFilter& filter : Filters()) {
      const auto step_of = [&](const MatrixXd& gram) {
        const VectorXd y = GramFunction(filter, gram, s_max, b);
        return parameter_side ? y : VectorXd(J.transpose() * y);
      };
      const VectorXd step = step_of(K);
      double squared = 0.0;
      for (int draw = 0; draw < kNumDraws; ++draw) {
        squared +=
            (step_of(K + kSize * random.Symmetric(k)) - step).squaredNorm() /
            step.squaredNorm();
      }
      const double measured = std::sqrt(squared / kNumDraws) / kSize;
      const double estimated = Sensitivity(
          GramStepError(
              filter,
              lambda,
              s_max,
              c,
              parameter_side ? std::optional<double>(g.norm()) : std::nullopt,
              0.0),
          k);
      // The estimates add the roundings of the products with J.
      EXPECT_LE(measured, 2.0 * estimated)
          << parameter_side << " " << Describe(filter);
      EXPECT_GE(measured, 0.3 * estimated)
          << parameter_side << " " << Describe(filter);
    }
  }
}

// One value, phi = 1: even differences are zero, the odd one is 1; and one
// more, in variance, if J is wide. By hand.
TEST(StepError, ClosedFormOfASingleValue) {
  const SpectralFilter constant = SpectralFilter::Power(0.0, 0.0);
  const VectorXd one = VectorXd::Ones(1);
  EXPECT_NEAR(SvdStepError(constant, one, 1.0, one, 0.0, false),
              RoundingError() + 10.0 * kEpsilon * std::sqrt(0.5),
              0.1 * kEpsilon);
  EXPECT_NEAR(SvdStepError(constant, one, 1.0, one, 0.0, true),
              RoundingError() + 10.0 * kEpsilon * std::sqrt(1.5),
              0.1 * kEpsilon);
  // What g has outside of J's range leaks in, in proportion.
  EXPECT_NEAR(SvdStepError(constant, one, 1.0, one, 1e6, false),
              RoundingError() + 1e7 * kEpsilon,
              1e2 * kEpsilon);
  EXPECT_DOUBLE_EQ(BackwardError(4), 0.5 * BackwardError(1));
}

// Relative errors have no units: those of g, of J, and of both.
TEST(StepError, IsFreeOfUnits) {
  RandomMatrices random(3);
  const VectorXd s = Spectrum(9);
  const VectorXd lambda = s.cwiseAbs2();
  const VectorXd c = random.Vector(9);
  for (const SpectralFilter& filter : Filters()) {
    const double svd = SvdStepError(filter, s, 1.0, c, 2.0, false);
    const double gram = GramStepError(filter, lambda, 1.0, c, {}, 1e-14);
    const double parameter = GramStepError(filter, lambda, 1.0, c, 3.0, 1e-14);
    for (const double u : {1e-120, 1e-7, 1e120}) {
      EXPECT_NEAR(
          SvdStepError(filter, s, 1.0, u * c, u * 2.0, false), svd, 1e-9 * svd);
      EXPECT_NEAR(
          SvdStepError(filter, u * s, u, c, 2.0, false), svd, 1e-6 * svd);
      EXPECT_NEAR(GramStepError(filter, lambda, u, u * c, {}, 1e-14),
                  gram,
                  1e-6 * gram);
      EXPECT_NEAR(GramStepError(filter, lambda, 1.0, u * c, u * 3.0, 1e-14),
                  parameter,
                  1e-6 * parameter);
    }
  }
}

// Values below what a Gram matrix resolves contribute anything up to phi.
TEST(StepError, WhatIsBelowTheResolutionCounts) {
  const VectorXd lambda = Eigen::Vector2d(1e-18, 1.0);
  const VectorXd c = VectorXd::Ones(2);
  const SpectralFilter filter = SpectralFilter::Power(-0.5, 0.0);
  const double blind = GramStepError(filter, lambda, 1.0, c, {}, 1e-12);
  // phi(1e-6) = 1e-3 beside a step of size one.
  EXPECT_NEAR(blind, 1e-3, 1e-4);
  EXPECT_LE(GramStepError(filter, lambda, 1.0, c, {}, 0.0), 0.5 * blind);
}

TEST(StepError, ZeroStepsHaveNoError) {
  const VectorXd s = Spectrum(5);
  const VectorXd zero = VectorXd::Zero(5);
  const SpectralFilter filter = SpectralFilter::HalfInverse(1e-3);
  EXPECT_EQ(SvdStepError(filter, s, 1.0, zero, 0.0, false), 0.0);
  EXPECT_EQ(GramStepError(filter, s.cwiseAbs2(), 1.0, zero, {}, 1e-14), 0.0);
}

}  // namespace step_error_test
}  // namespace invgrad
