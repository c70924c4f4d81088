// A step for 6 unknowns allocates nothing.
#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/determined_step.h"
#include "tests/support/count_allocations.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace {

TEST(DeterminedStepAllocation, IsNone) {
  if (!CountsAllocations()) GTEST_SKIP() << "the sanitizer owns malloc";
  DeterminedStepOptions options;
  options.group_sizes = {3, 3};
  DeterminedStep determined(options);
  Eigen::Matrix<double, 6, 6> H;
  H.setIdentity();
  H(5, 5) = 0.01;
  const Eigen::Matrix<double, 6, 1> gradient = RandomMatrix(6, 1, 1);
  DeterminedStep::Vector step;
  std::string error;
  const long num_allocations = CountAllocations([&] {
    for (int i = 0; i < 3; ++i) {
      // Left alone, and then in the band.
      H(5, 5) = i == 0 ? 0.005 : 0.015;
      EXPECT_TRUE(determined.Compute(H, gradient, &step, &error));
      EXPECT_EQ(determined.num_left_alone(), 1);
    }
  });
  EXPECT_EQ(num_allocations, 0);
  Eigen::MatrixXd counted;
  EXPECT_GT(CountAllocations([&] { counted.setOnes(100, 100); }), 0);
}

}  // namespace
}  // namespace invgrad
