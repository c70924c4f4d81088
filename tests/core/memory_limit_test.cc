#include "invgrad/core/memory_limit.h"

#include <sys/resource.h>

#include <string>
#include <vector>

#include "gtest/gtest.h"

namespace invgrad {
namespace memory_limit_test {

TEST(FormatBytes, HasThreeDigitsAndAUnit) {
  EXPECT_EQ(FormatBytes(0.0), "0 bytes");
  EXPECT_EQ(FormatBytes(999.0), "999 bytes");
  EXPECT_EQ(FormatBytes(1000.0), "1 kB");
  EXPECT_EQ(FormatBytes(17.6e9), "17.6 GB");
  EXPECT_EQ(FormatBytes(1.004e12), "1 TB");
  // Rounded up into the next unit, not to 1e+03.
  EXPECT_EQ(FormatBytes(999.6e6), "1 GB");
  EXPECT_EQ(FormatBytes(999.4e6), "999 MB");
  EXPECT_EQ(FormatBytes(2.5e18), "2.5 EB");
}

TEST(FitsInMemory, NamesTheLargestPartsFirst) {
  const std::vector<MemoryPart> parts = {
      {"batch", 1e6}, {"activations", 3e9}, {"Gram matrix", 32e9}};
  std::string error;
  EXPECT_TRUE(FitsInMemory("it", parts, TotalBytes(parts), &error));
  EXPECT_EQ(error, "");
  EXPECT_FALSE(FitsInMemory("it", parts, TotalBytes(parts) - 1.0, &error));
  // The batch explains nothing.
  EXPECT_EQ(error,
            "it needs 35 GB (Gram matrix 32 GB, activations 3 GB); the limit "
            "is 35 GB");
  EXPECT_FALSE(FitsInMemory("n=7", {{"its data", 2e3}}, 1e3, &error));
  EXPECT_EQ(error, "n=7 needs 2 kB for its data; the limit is 1 kB");
}

TEST(FitsInMemory, KnowsTheMachine) {
  std::string error;
  EXPECT_TRUE(FitsInMemory("it", {{"all", 1e6}}, 0.0, &error)) << error;
  EXPECT_FALSE(FitsInMemory("it", {{"all", 1e300}}, 0.0, &error));
  EXPECT_NE(error.find("the limit is " + FormatBytes(MemoryLimit()) +
                       " (three quarters of "),
            std::string::npos)
      << error;
}

TEST(MemoryLimit, IsThatOfTheProcessIfLess) {
  rlimit before;
  ASSERT_EQ(getrlimit(RLIMIT_AS, &before), 0);
  const double machine = MemoryLimit();
  EXPECT_GT(machine, 1e8);
  rlimit low = before;
  low.rlim_cur = static_cast<rlim_t>(machine / 2.0);
  ASSERT_EQ(setrlimit(RLIMIT_AS, &low), 0);
  const double process = MemoryLimit();
  std::string error;
  FitsInMemory("it", {{"all", machine}}, 0.0, &error);
  ASSERT_EQ(setrlimit(RLIMIT_AS, &before), 0);
  EXPECT_NEAR(process, 0.75 * static_cast<double>(low.rlim_cur), 1.0);
  EXPECT_NE(error.find("(three quarters of what this process may have)"),
            std::string::npos)
      << error;
}

}  // namespace memory_limit_test
}  // namespace invgrad
