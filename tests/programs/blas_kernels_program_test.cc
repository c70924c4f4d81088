// A program starts itself again where OpenBLAS' kernels are too old for the
// processor, once, and says so.
#include <cstdlib>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/core/blas_kernels.h"
#include "tests/support/program_runner.h"
#include "tests/support/source_tree.h"

namespace invgrad {
namespace {

class BlasKernelsProgram : public ProgramRunner {
 protected:
  BlasKernelsProgram() : ProgramRunner("compare") {}

  void SetUp() override {
    better_ = BetterBlasKernels(ProcessorVectorUnits(), "Prescott");
    if (better_.empty()) {
      GTEST_SKIP() << "no kernels are too old for this processor";
    }
  }

  // With these environment variables; an empty one is not set.
  Output RunWith(const std::string& core_type,
                 const std::string& preloaded) const {
    const std::string before = Set("OPENBLAS_CORETYPE", core_type);
    Set("LD_PRELOAD", preloaded);
    const Output output = Run({"--list"});
    Set("OPENBLAS_CORETYPE", before);
    Set("LD_PRELOAD", "");
    return output;
  }

  static int Count(const std::string& text, const std::string& word) {
    int count = 0;
    for (size_t at = text.find(word); at != std::string::npos;
         at = text.find(word, at + 1)) {
      ++count;
    }
    return count;
  }

  std::string better_;

 private:
  // Returns what it was.
  static std::string Set(const char* variable, const std::string& value) {
    const char* before = std::getenv(variable);
    const std::string result = before == nullptr ? "" : before;
    if (value.empty()) {
      unsetenv(variable);
    } else {
      setenv(variable, value.c_str(), /*overwrite=*/1);
    }
    return result;
  }
};

TEST_F(BlasKernelsProgram, WarnsOfOldKernelsThatTheUserChose) {
  const Output output = RunWith("Prescott", "");
  EXPECT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output,
             {"compare: OpenBLAS runs its Prescott kernels",
              "OPENBLAS_CORETYPE=" + better_,
              "oscillator_chain"});
  EXPECT_EQ(Count(output.text, "starting again"), 0) << output.text;
}

TEST_F(BlasKernelsProgram, StartsAgainOnceWithBetterKernels) {
#if defined(__SANITIZE_ADDRESS__)
  GTEST_SKIP() << "the address sanitizer must be loaded first";
#endif
  const Output output = RunWith("", BinDir() + "/libold_openblas.so");
  EXPECT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output,
             {"compare: OpenBLAS chose its Prescott kernels",
              "starting again with OPENBLAS_CORETYPE=" + better_,
              "oscillator_chain"});
  EXPECT_EQ(Count(output.text, "starting again"), 1) << output.text;
}

TEST_F(BlasKernelsProgram, SaysNothingOfKernelsThatUseTheProcessor) {
  const Output output = RunWith(better_, "");
  EXPECT_EQ(output.exit_code, 0) << output.text;
  EXPECT_EQ(Count(output.text, "OpenBLAS"), 0) << output.text;
}

}  // namespace
}  // namespace invgrad
