// The tests' main function: one thread of BLAS, as the programs have, and the
// problems by their names.
#include "gtest/gtest.h"
#include "invgrad/blas_threads.h"
#include "problems/problems.h"

int main(int argc, char** argv) {
  invgrad::RegisterProblems();  // before tests with a parameter are listed
  testing::InitGoogleTest(&argc, argv);
  invgrad::SetBlasThreads(1);
  return RUN_ALL_TESTS();
}
