#include "invgrad/core/blas_kernels.h"

#include <cstdlib>
#include <iostream>
#include <string>
#include <thread>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/internal/blas.h"
#include "tests/support/log_warnings.h"

namespace invgrad {
namespace blas_kernels_test {

TEST(BetterBlasKernels, AreTheWidestOfTheProcessorForOldKernels) {
  for (const char* old :
       {"Prescott", "Core2", "Penryn", "Nehalem", "Atom", "Barcelona"}) {
    EXPECT_EQ(BetterBlasKernels(VectorUnits::kBelowAvx2, old), "");
    EXPECT_EQ(BetterBlasKernels(VectorUnits::kAvx2, old), "Haswell");
    EXPECT_EQ(BetterBlasKernels(VectorUnits::kAvx512, old), "SkylakeX");
  }
}

TEST(BetterBlasKernels, AreNoneForKernelsWithAvx2) {
  for (const char* modern :
       {"Haswell", "Zen", "Excavator", "SkylakeX", "Cooperlake"}) {
    EXPECT_EQ(BetterBlasKernels(VectorUnits::kAvx512, modern), "");
  }
}

// Also what a later OpenBLAS, or one for another architecture, may have.
TEST(BetterBlasKernels, AreNoneForUnknownKernels) {
  EXPECT_EQ(BetterBlasKernels(VectorUnits::kAvx512, "Sapphirerapids"), "");
  EXPECT_EQ(BetterBlasKernels(VectorUnits::kBelowAvx2, "armv8"), "");
}

// Two threads, two products each; then the number of warnings to stderr.
void MultiplyAndCountWarnings() {
  const LogWarnings warnings;
  const auto multiply = [] {
    const Eigen::MatrixXd A = Eigen::MatrixXd::Ones(3, 3);
    Eigen::MatrixXd C(3, 3);
    Gemm(Op::kNone, Op::kNone, 1.0, A, A, 0.0, C);
    Syrk(Op::kNone, 1.0, A, 0.0, C);
  };
  std::thread first(multiply);
  std::thread second(multiply);
  first.join();
  second.join();
  std::cerr << "warnings: " << warnings.Count("OPENBLAS_CORETYPE") << "\n";
  std::exit(0);
}

// OpenBLAS reads the variable when a process starts: the "threadsafe" style
// starts one.
void ExpectWarnings(const std::string& kernels, const std::string& count) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const char* value = std::getenv("OPENBLAS_CORETYPE");
  const std::string before = value == nullptr ? "" : value;
  setenv("OPENBLAS_CORETYPE", kernels.c_str(), /*overwrite=*/1);
  EXPECT_EXIT(MultiplyAndCountWarnings(),
              testing::ExitedWithCode(0),
              "warnings: " + count);
  if (value == nullptr) {
    unsetenv("OPENBLAS_CORETYPE");
  } else {
    setenv("OPENBLAS_CORETYPE", before.c_str(), /*overwrite=*/1);
  }
}

TEST(OldBlasKernelsDeathTest, AreLoggedOnceAtTheFirstProducts) {
  if (ProcessorVectorUnits() == VectorUnits::kBelowAvx2) {
    GTEST_SKIP() << "no kernels are too old for this processor";
  }
  ExpectWarnings("Prescott", "1");
}

TEST(OldBlasKernelsDeathTest, AreNotLoggedWhereTheyUseAvx2) {
  if (ProcessorVectorUnits() == VectorUnits::kBelowAvx2) {
    GTEST_SKIP() << "OpenBLAS has no kernels with AVX2 for this processor";
  }
  ExpectWarnings("Haswell", "0");
}

}  // namespace blas_kernels_test
}  // namespace invgrad
