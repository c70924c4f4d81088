// A step for 6 unknowns allocates nothing. This file replaces malloc in its
// executable.
#include <cstddef>
#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/degeneracy/determined_step.h"
#include "tests/support/random_matrix.h"

namespace {

thread_local long num_allocations = 0;

}  // namespace

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || \
    !defined(__GLIBC__)
#define INVGRAD_COUNTS_MALLOC 0
#else
#define INVGRAD_COUNTS_MALLOC 1
extern "C" {
// NOLINTNEXTLINE(bugprone-reserved-identifier): glibc's own name.
void* __libc_malloc(std::size_t size);

void* malloc(std::size_t size) {
  ++num_allocations;
  return __libc_malloc(size);
}
}  // extern "C"
#endif

namespace invgrad {
namespace {

TEST(DeterminedStepAllocation, IsNone) {
  if (INVGRAD_COUNTS_MALLOC == 0) GTEST_SKIP() << "no malloc to replace";
  DeterminedStepOptions options;
  options.group_sizes = {3, 3};
  DeterminedStep determined(options);
  Eigen::Matrix<double, 6, 6> H;
  H.setIdentity();
  H(5, 5) = 0.01;
  const Eigen::Matrix<double, 6, 1> gradient = RandomMatrix(6, 1, 1);
  DeterminedStep::Vector step;
  std::string error;
  num_allocations = 0;
  for (int i = 0; i < 3; ++i) {
    // Left alone, and then in the band.
    H(5, 5) = i == 0 ? 0.005 : 0.015;
    EXPECT_TRUE(determined.Compute(H, gradient, &step, &error));
    EXPECT_EQ(determined.num_left_alone(), 1);
  }
  EXPECT_EQ(num_allocations, 0);
  const Eigen::MatrixXd counted = Eigen::MatrixXd::Ones(100, 100);
  EXPECT_GT(num_allocations, 0) << counted(0, 0);
}

}  // namespace
}  // namespace invgrad
