#include "invgrad/spectral/routes/simd.h"

#include <vector>

#include "gtest/gtest.h"

namespace invgrad {
namespace simd {
namespace simd_test {

TEST(Pack, IsReadAndWrittenAtAnyAddress) {
  for (int offset = 0; offset < kPack; ++offset) {
    double x[2 * kPack] = {0, 1, 2, 3, 4, 5, 6, 7};
    At(x + offset).v = 2.0 * At(x + offset).v;
    EXPECT_EQ(Sum(At(x + offset).v), 2 * (4 * offset + 6));
    for (int i = 0; i < 2 * kPack; ++i) {
      const bool inside = i >= offset && i < offset + kPack;
      EXPECT_EQ(x[i], inside ? 2 * i : i);
    }
  }
}

// 1 + 4 + 9 + ... = n (n + 1) (2 n + 1) / 6: exact, in any order.
TEST(Dot, IsTheSumOfProducts) {
  for (int n = 0; n <= 4 * kPack; ++n) {
    std::vector<double> x(n + 1);
    for (int i = 0; i <= n; ++i) x[i] = i;
    double dot = -1.0;
    simd::Run([&]()
                  INVGRAD_INLINE { dot = Dot(n, x.data() + 1, x.data() + 1); });
    EXPECT_EQ(dot, n * (n + 1) * (2 * n + 1) / 6);
    // The baseline's instructions.
    EXPECT_EQ(Dot(n, x.data() + 1, x.data() + 1), dot);
  }
}

}  // namespace simd_test
}  // namespace simd
}  // namespace invgrad
