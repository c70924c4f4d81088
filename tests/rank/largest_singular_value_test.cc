#include <cmath>
#include <limits>

#include "gtest/gtest.h"
#include "invgrad/rank/smallest_singular.h"
#include "tests/support/spectral_reference.h"

namespace invgrad {
namespace largest_singular_value_test {

using Eigen::MatrixXd;

TEST(LargestSingularValue, OfKnownSpectra) {
  RandomMatrices random(7);
  for (const auto& [m, n] : {std::pair(60, 200), std::pair(200, 60)}) {
    const MatrixXd J = random.WithSpectrum(m, n, 3.0 * LogUniform(60, 1e-8));
    // From below, and within the tolerance.
    const double s = LargestSingularValue(J.sparseView());
    EXPECT_LE(s, 3.0 * (1.0 + 1e-12));
    EXPECT_GE(s, 3.0 * (1.0 - 1e-3));
  }
}

// A flat spectrum ends the iteration at its first step.
TEST(LargestSingularValue, OfAMultipleOfTheIdentity) {
  EXPECT_NEAR(LargestSingularValue(
                  MatrixXd(-4.0 * MatrixXd::Identity(9, 9)).sparseView()),
              4.0,
              1e-14);
}

TEST(LargestSingularValue, OfOneColumnAndOfZero) {
  const MatrixXd column = (MatrixXd(2, 1) << 3.0, 4.0).finished();
  EXPECT_NEAR(LargestSingularValue(column.sparseView()), 5.0, 1e-14);
  EXPECT_EQ(LargestSingularValue(Eigen::SparseMatrix<double>(3, 2)), 0.0);
}

TEST(LargestSingularValue, NotFinite) {
  MatrixXd J = MatrixXd::Ones(3, 3);
  J(1, 2) = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(std::isnan(LargestSingularValue(J.sparseView())));
}

}  // namespace largest_singular_value_test
}  // namespace invgrad
