#include "invgrad/linalg/tridiagonalization.h"

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "Eigen/Core"
#include "Eigen/Eigenvalues"
#include "gtest/gtest.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Method = Tridiagonalization::Method;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// Entries uniform in (-1, 1).
MatrixXd RandomSymmetric(int m, int seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  MatrixXd K(m, m);
  for (int j = 0; j < m; ++j) {
    for (int i = j; i < m; ++i) K(i, j) = K(j, i) = uniform(generator);
  }
  return K;
}

MatrixXd TridiagonalOf(const Tridiagonalization& reduction) {
  MatrixXd T = reduction.diagonal().asDiagonal();
  for (Index i = 0; i < reduction.off_diagonal().size(); ++i) {
    T(i + 1, i) = T(i, i + 1) = reduction.off_diagonal()[i];
  }
  return T;
}

// Q, column by column.
MatrixXd QOf(const Tridiagonalization& reduction, int m) {
  MatrixXd Q(m, m);
  for (int j = 0; j < m; ++j) {
    VectorXd x = VectorXd::Unit(m, j);
    reduction.ApplyQ(&x);
    Q.col(j) = x;
  }
  return Q;
}

// Backward errors of Householder reductions are a small multiple of
// sqrt(m) epsilon |K|_F in practice.
double Tolerance(int m) { return 20.0 * kEpsilon * std::sqrt(m); }

class TridiagonalizationTest : public testing::TestWithParam<Method> {};

TEST_P(TridiagonalizationTest, FactorsAreThoseOfK) {
  for (const int m : {1, 2, 3, 4, 5, 7, 31, 33, 64, 65, 100, 129, 200, 300}) {
    SCOPED_TRACE(m);
    const MatrixXd K = RandomSymmetric(m, m);
    MatrixXd reflectors = K;
    reflectors.triangularView<Eigen::StrictlyUpper>().setConstant(
        std::numeric_limits<double>::quiet_NaN());
    Tridiagonalization reduction;
    reduction.Compute(&reflectors, GetParam());
    const MatrixXd Q = QOf(reduction, m);
    EXPECT_LE((Q.transpose() * Q - MatrixXd::Identity(m, m)).norm(),
              Tolerance(m) * std::sqrt(m));
    EXPECT_LE((Q * TridiagonalOf(reduction) * Q.transpose() - K).norm(),
              Tolerance(m) * K.norm());
  }
}

TEST_P(TridiagonalizationTest, ApplyQTransposeInvertsApplyQ) {
  for (const int m : {1, 2, 3, 65, 129}) {
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

INSTANTIATE_TEST_SUITE_P(Methods,
                         TridiagonalizationTest,
                         testing::Values(Method::kAuto,
                                         Method::kOneStage,
                                         Method::kTwoStage));

}  // namespace
}  // namespace invgrad
