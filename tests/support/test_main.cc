// The tests' main function: one thread of BLAS, as the programs have.
#include "gtest/gtest.h"
#include "invgrad/blas_threads.h"

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  invgrad::SetBlasThreads(1);
  return RUN_ALL_TESTS();
}
