#include "invgrad/spectral/routes/tridiagonalization.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/spectral/routes/two_stage.h"
#include "tests/support/spectral_reference.h"

namespace invgrad {
namespace tridiagonalization_test {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Method = Tridiagonalization::Method;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

MatrixXd RandomSymmetric(int m, int seed) {
  return RandomMatrices(seed).Symmetric(m);
}

MatrixXd WithSpectrum(const VectorXd& eigenvalues, int seed) {
  const int m = static_cast<int>(eigenvalues.size());
  const MatrixXd U = RandomMatrices(seed).Orthonormal(m, m).cast<double>();
  return U * eigenvalues.asDiagonal() * U.transpose();
}

MatrixXd Tridiagonal(const VectorXd& diagonal, const VectorXd& off_diagonal) {
  MatrixXd T = diagonal.asDiagonal();
  for (Index i = 0; i < off_diagonal.size(); ++i) {
    T(i + 1, i) = T(i, i + 1) = off_diagonal[i];
  }
  return T;
}

// The matrix of x -> f(x).
MatrixXd MatrixOf(int m, const std::function<void(VectorXd*)>& f) {
  MatrixXd A(m, m);
  for (int j = 0; j < m; ++j) {
    VectorXd x = VectorXd::Unit(m, j);
    f(&x);
    A.col(j) = x;
  }
  return A;
}

// The lower triangle of K, so that reading the upper one shows.
MatrixXd LowerTriangle(const MatrixXd& K) {
  MatrixXd lower = K;
  lower.triangularView<Eigen::StrictlyUpper>().setConstant(kNan);
  return lower;
}

// m reflections, of a rounding each in every entry that they change: the
// backward error is of order sqrt(m) epsilon |K|_F; the bound of the theory is
// of order m.
double Tolerance(int m) { return 10.0 * kEpsilon * std::sqrt(m); }

void ExpectFactors(const MatrixXd& K, const MatrixXd& Q, const MatrixXd& T) {
  const int m = static_cast<int>(K.rows());
  EXPECT_LE((Q.transpose() * Q - MatrixXd::Identity(m, m)).norm(),
            Tolerance(m) * std::sqrt(m));
  EXPECT_LE((Q * T * Q.transpose() - K).norm(), Tolerance(m) * K.norm());
}

// Sizes around the packs of four, the bandwidth 48, and the tiles of 64, 192
// and 512 rows.
std::vector<int> Sizes() {
  return {1,  2,  3,  4,  5,  7,  8,   31,  47,  48,  49,
          50, 51, 63, 65, 95, 97, 100, 129, 191, 193, 240};
}

TEST(BandReduction, FactorsAreThoseOfK) {
  constexpr int b = kBandwidth;
  for (const int m : Sizes()) {
    SCOPED_TRACE(m);
    const MatrixXd K = RandomSymmetric(m, m);
    MatrixXd reflectors = LowerTriangle(K);
    VectorXd tau;
    BandReduction().Compute(ColumnStrips(m, nullptr), &reflectors, &tau);
    ASSERT_EQ(tau.size(), std::max(0, m - b));
    MatrixXd Q = MatrixXd::Identity(m, m);
    MatrixXd B = MatrixXd::Zero(m, m);
    for (int j = 0; j < m; ++j) {
      const int rows = std::min(b + 1, m - j);
      B.col(j).segment(j, rows) = reflectors.col(j).segment(j, rows);
      if (j >= tau.size()) continue;
      VectorXd u = VectorXd::Unit(m, j + b);
      u.tail(m - 1 - b - j) = reflectors.col(j).tail(m - 1 - b - j);
      Q -= (tau[j] * (Q * u)) * u.transpose();
    }
    ExpectFactors(K, Q, B.selfadjointView<Eigen::Lower>());
  }
}

TEST(BulgeChase, FactorsAreThoseOfTheBand) {
  constexpr int b = kBandwidth;
  for (const int m : Sizes()) {
    SCOPED_TRACE(m);
    MatrixXd K = RandomSymmetric(m, m);
    // What is outside of the band is not read.
    MatrixXd input = LowerTriangle(K);
    for (int j = 0; j < m; ++j) {
      for (int i = j + b + 1; i < m; ++i) {
        K(i, j) = K(j, i) = 0.0;
        input(i, j) = kNan;
      }
    }
    VectorXd diagonal;
    VectorXd off_diagonal;
    BulgeChase chase;
    chase.Compute(ColumnStrips(m, nullptr), input, &diagonal, &off_diagonal);
    const MatrixXd Q =
        MatrixOf(m, [&](VectorXd* x) { chase.ApplyQ(false, x); });
    const MatrixXd Q_transpose =
        MatrixOf(m, [&](VectorXd* x) { chase.ApplyQ(true, x); });
    ExpectFactors(K, Q, Tridiagonal(diagonal, off_diagonal));
    EXPECT_LE((Q_transpose - Q.transpose()).norm(),
              Tolerance(m) * std::sqrt(m));
  }
}

class TridiagonalizationTest : public testing::TestWithParam<Method> {};

MatrixXd TridiagonalOf(const Tridiagonalization& reduction) {
  return Tridiagonal(reduction.diagonal(), reduction.off_diagonal());
}

TEST_P(TridiagonalizationTest, FactorsAreThoseOfK) {
  for (const int m : Sizes()) {
    SCOPED_TRACE(m);
    const MatrixXd K = RandomSymmetric(m, m);
    MatrixXd reflectors = LowerTriangle(K);
    Tridiagonalization reduction;
    reduction.Compute(&reflectors, GetParam());
    ASSERT_EQ(reduction.diagonal().size(), m);
    ASSERT_EQ(reduction.off_diagonal().size(), m - 1);
    const MatrixXd Q = MatrixOf(m, [&](VectorXd* x) { reduction.ApplyQ(x); });
    ExpectFactors(K, Q, TridiagonalOf(reduction));
  }
}

// Tiles of 512 rows below the diagonal need a larger matrix.
TEST_P(TridiagonalizationTest, LargeMatrixTimesVector) {
  const int m = 901;
  const MatrixXd K = RandomSymmetric(m, 1);
  const VectorXd x = RandomMatrices(2).Vector(m);
  MatrixXd reflectors = LowerTriangle(K);
  Tridiagonalization reduction;
  reduction.Compute(&reflectors, GetParam());
  VectorXd y = x;
  reduction.ApplyQTranspose(&y);
  EXPECT_NEAR(y.norm(), x.norm(), Tolerance(m) * x.norm());
  y = TridiagonalOf(reduction) * y;
  reduction.ApplyQ(&y);
  EXPECT_LE((y - K * x).norm(), Tolerance(m) * K.norm() * x.norm());
}

TEST_P(TridiagonalizationTest, ApplyQTransposeInvertsApplyQ) {
  for (const int m : Sizes()) {
    MatrixXd K = RandomSymmetric(m, m);
    const VectorXd x = K.col(0);
    Tridiagonalization reduction;
    reduction.Compute(&K, GetParam());
    VectorXd y = x;
    reduction.ApplyQ(&y);
    reduction.ApplyQTranspose(&y);
    EXPECT_LE((y - x).norm(), Tolerance(m) * x.norm());
  }
}

TEST_P(TridiagonalizationTest, EigenvaluesAreThoseOfSpecialMatrices) {
  for (const int m : {2, 50, 130}) {
    const VectorXd grades = VectorXd::NullaryExpr(
        m, [m](Index i) { return std::pow(1e-16, i / (m - 1.0)); });
    const VectorXd x = RandomMatrices(3).Vector(m);
    MatrixXd graded = RandomSymmetric(m, 4);
    graded = grades.asDiagonal() * graded * grades.asDiagonal();
    const std::vector<std::pair<std::string, MatrixXd>> matrices = {
        {"zero", MatrixXd::Zero(m, m)},
        {"identity", MatrixXd::Identity(m, m)},
        {"diagonal", MatrixXd(x.asDiagonal())},
        {"rank one", x * x.transpose()},
        {"tridiagonal", Tridiagonal(x, x.tail(m - 1))},
        {"eigenvalues from 1 to 1e-16", WithSpectrum(grades, 5)},
        {"entries from 1 to 1e-32", graded},
        {"entries from 1e-32 to 1", graded.reverse()},
        {"entries whose squares underflow",
         1e-200 * RandomSymmetric(m, 6) + MatrixXd::Identity(m, m)}};
    for (const auto& [name, K] : matrices) {
      SCOPED_TRACE(name + ", m = " + std::to_string(m));
      MatrixXd reflectors = LowerTriangle(K);
      Tridiagonalization reduction;
      reduction.Compute(&reflectors, GetParam());
      const MatrixXd Q = MatrixOf(m, [&](VectorXd* x) { reduction.ApplyQ(x); });
      const MatrixXd T = TridiagonalOf(reduction);
      ExpectFactors(K, Q, T);
      const VectorXd of_K = SymmetricEigen(K).values;
      const VectorXd of_T = SymmetricEigen(T).values;
      // Weyl: eigenvalues move by at most the norm of the backward errors, of
      // this reduction and of the reference's.
      EXPECT_LE((of_K - of_T).cwiseAbs().maxCoeff(),
                3.0 * Tolerance(m) * K.norm());
    }
  }
}

TEST_P(TridiagonalizationTest, RepeatsAreBitIdentical) {
  // The second object has other memory and another history.
  Tridiagonalization first;
  Tridiagonalization second;
  MatrixXd other = RandomSymmetric(211, 9);
  second.Compute(&other, GetParam());
  const MatrixXd K = RandomSymmetric(150, 8);
  MatrixXd K_first = K;
  MatrixXd K_second = K;
  first.Compute(&K_first, GetParam());
  second.Compute(&K_second, GetParam());
  EXPECT_EQ(first.diagonal(), second.diagonal());
  EXPECT_EQ(first.off_diagonal(), second.off_diagonal());
  VectorXd x_first = K.col(0);
  VectorXd x_second = K.col(0);
  first.ApplyQ(&x_first);
  second.ApplyQ(&x_second);
  EXPECT_EQ(x_first, x_second);
}

TEST_P(TridiagonalizationTest, NanEndsInNan) {
  for (const int m : {1, 2, 60, 130}) {
    MatrixXd K = RandomSymmetric(m, 1);
    K(m - 1, m / 2) = kNan;
    Tridiagonalization reduction;
    reduction.Compute(&K, GetParam());
    EXPECT_FALSE(reduction.diagonal().allFinite());
  }
}

TEST_P(TridiagonalizationTest, BytesIsAboutWhatTheFactorsNeed) {
  const double m = 4096;
  const double bytes = Tridiagonalization::Bytes(4096, GetParam());
  // In one stage a copy of K; in two, reflectors of m^2 / 2 numbers.
  const double factor = GetParam() == Method::kOneStage ? 1.0 : 0.5;
  EXPECT_GT(bytes, factor * 8 * m * m);
  EXPECT_LT(bytes, 1.5 * factor * 8 * m * m);
}

INSTANTIATE_TEST_SUITE_P(Methods,
                         TridiagonalizationTest,
                         testing::Values(Method::kAuto,
                                         Method::kOneStage,
                                         Method::kTwoStage));

TEST(Tridiagonalization, AutomaticChoiceIsOneStageForSmallMatrices) {
  EXPECT_EQ(Tridiagonalization::Bytes(512, Method::kAuto),
            Tridiagonalization::Bytes(512, Method::kOneStage));
  EXPECT_EQ(Tridiagonalization::Bytes(4096, Method::kAuto),
            Tridiagonalization::Bytes(4096, Method::kTwoStage));
}

}  // namespace tridiagonalization_test
}  // namespace invgrad
