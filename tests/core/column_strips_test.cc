#include "invgrad/core/column_strips.h"

#include <vector>

#include "gtest/gtest.h"
#include "tests/support/one_rank.h"

namespace invgrad {
namespace column_strips_test {

using Eigen::Index;

constexpr Index kWidth = ColumnStrips::kWidth;

TEST(ColumnStrips, EveryColumnHasOneOwnerAndOnePlace) {
  for (const Index size : {Index{1}, kWidth, kWidth + 1, 5 * kWidth + 7}) {
    for (const int num_ranks : {1, 2, 3, 8}) {
      Index total = 0;
      for (int r = 0; r < num_ranks; ++r) {
        const OneRank rank(r, num_ranks);
        const ColumnStrips strips(size, &rank);
        std::vector<bool> is_taken(strips.num_local(), false);
        for (Index column = 0; column < size; ++column) {
          if (strips.Owner(column) != r) continue;
          EXPECT_TRUE(strips.Owns(column));
          const Index local = strips.Local(column);
          ASSERT_LT(local, strips.num_local());
          EXPECT_FALSE(is_taken[local]);
          is_taken[local] = true;
          ++total;
        }
        Index num_visited = 0;
        strips.ForOwn([&](Index first, Index count) {
          for (Index column = first; column < first + count; ++column) {
            EXPECT_TRUE(strips.Owns(column));
            // A strip is stored side by side.
            EXPECT_EQ(strips.Local(column),
                      strips.Local(first) + column - first);
          }
          num_visited += count;
        });
        EXPECT_EQ(num_visited, strips.num_local());
      }
      EXPECT_EQ(total, size);
    }
  }
}

TEST(ColumnStrips, OneProcessHoldsAllColumns) {
  const ColumnStrips strips(1000, nullptr);
  EXPECT_EQ(strips.num_local(), 1000);
  EXPECT_EQ(strips.Local(777), 777);
  EXPECT_TRUE(strips.Owns(999));
}

}  // namespace column_strips_test
}  // namespace invgrad
