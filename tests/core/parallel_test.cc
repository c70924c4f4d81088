#include "invgrad/internal/parallel.h"

#include <stdexcept>
#include <string>

#include "gtest/gtest.h"

namespace invgrad {
namespace parallel_test {

TEST(ForShares, ReturnsTheFirstSampleThatFails) {
  for (const int num_threads : {1, 2, 3, 64}) {
    const auto fails_at = [&](int failing) {
      return ForShares(40, num_threads, [&](int begin, int end) {
        return begin <= failing && failing < end ? failing : end;
      });
    };
    EXPECT_EQ(fails_at(40), 40);
    for (int failing = 0; failing < 40; ++failing) {
      EXPECT_EQ(fails_at(failing), failing);
    }
  }
}

TEST(ForShares, ExceptionsReachTheCaller) {
  for (const int num_threads : {1, 2, 3, 64}) {
    try {
      ForShares(40, num_threads, [](int begin, int end) {
        if (end > 8) throw std::runtime_error(begin <= 8 ? "first" : "later");
        return end;
      });
      FAIL() << num_threads;
    } catch (const std::runtime_error& error) {
      EXPECT_EQ(std::string(error.what()), "first") << num_threads;
    }
  }
}

}  // namespace parallel_test
}  // namespace invgrad
