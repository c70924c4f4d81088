#include "invgrad/blas_threads.h"

#include "gtest/gtest.h"

namespace invgrad {
namespace blas_threads_test {

TEST(BlasThreads, AreWhatWasSet) {
  SetBlasThreads(2);
  EXPECT_EQ(BlasThreads(), 2);
  SetBlasThreads(1);
  EXPECT_EQ(BlasThreads(), 1);
}

TEST(BlasThreadsDeathTest, AreAtLeastOne) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  EXPECT_DEATH(SetBlasThreads(0), "num_threads");
}

}  // namespace blas_threads_test
}  // namespace invgrad
