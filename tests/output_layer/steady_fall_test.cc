#include "invgrad/output_layer/steady_fall.h"

#include <cmath>
#include <limits>

#include "gtest/gtest.h"

namespace invgrad {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A run of 1,000 steps with these losses in the three shares, judged at `spent`.
bool Stalls(double first, double second, double third, double spent = 0.1) {
  SteadyFall fall(SteadyFall::kLeastCountOfAll);
  for (int step = 0; step < 1000; ++step) {
    const double share = step / 1000.0;
    // Losses outside of the shares do not count.
    const bool is_outside = share < 0.0125 || share >= 0.1;
    fall.Add(share,
             is_outside      ? 1e9
             : share < 0.025 ? first
             : share < 0.05  ? second
                             : third);
  }
  return fall.HasStalled(spent);
}

TEST(SteadyFall, StallsUnlessTheLossFallsByFifteenPercentTwice) {
  EXPECT_FALSE(Stalls(3e-9, 0.84 * 3e-9, 0.84 * 0.84 * 3e-9));
  EXPECT_TRUE(Stalls(3e-9, 0.86 * 3e-9, 0.1 * 3e-9));
  EXPECT_TRUE(Stalls(3e-9, 0.1 * 3e-9, 0.86 * 0.1 * 3e-9));
  EXPECT_TRUE(Stalls(1.0, 1.0, 1.0));
  EXPECT_TRUE(Stalls(1.0, 9.0, 1.0)) << "a jump is no fall";
  EXPECT_FALSE(Stalls(1.0, 1.0, 1.0, 0.099)) << "judged too early";
  EXPECT_TRUE(Stalls(1.0, 1.0, 1.0, 1.0)) << "judged once and for all";
}

TEST(SteadyFall, FewLossesAreNotJudged) {
  for (const double share : {0.02, 0.06}) {
    for (const int count : {7, 8}) {
      SteadyFall fall(8);
      for (int k = 0; k < count; ++k) {
        fall.Add(share, 1.0);
        fall.Add(0.03, 1.0);
      }
      EXPECT_EQ(fall.HasStalled(0.1), count == 8);
    }
  }
  EXPECT_FALSE(SteadyFall(1).HasStalled(0.1));
}

TEST(SteadyFall, LossesOfZeroAndInfinity) {
  EXPECT_TRUE(Stalls(0.0, 0.0, 0.0)) << "nothing is left to lower";
  EXPECT_FALSE(Stalls(1.0, 1e-9, 0.0));
  EXPECT_TRUE(Stalls(1.0, 0.1, kInfinity));
  EXPECT_TRUE(Stalls(kInfinity, kInfinity, kInfinity));
  EXPECT_FALSE(Stalls(std::nan(""), 1.0, 0.1));
}

}  // namespace
}  // namespace invgrad
