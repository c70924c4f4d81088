#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/random.h"

namespace invgrad {
namespace numpy_generator_test {

// Every literal below was printed by numpy 2.4.6 with the call beside it, with
// repr(), which gives the same double back. So all comparisons are exact, but
// for the tail's: its numbers are logarithms of the C library.

// Where the ziggurat's tail begins: r.
constexpr double kTailStart = 3.6541528853610088;

TEST(NumpyGenerator, RandomIsNumpys) {
  // np.random.default_rng(s).random(3)
  const auto expect_random = [](std::uint32_t seed,
                                const std::vector<double>& wanted) {
    NumpyGenerator generator(seed);
    for (const double value : wanted) {
      EXPECT_EQ(generator.Random(), value) << "seed " << seed;
    }
  };
  expect_random(0,
                {0.6369616873214543, 0.2697867137638703, 0.04097352393619469});
  expect_random(1,
                {0.5118216247002567, 0.9504636963259353, 0.14415961271963373});
  expect_random(42,
                {0.7739560485559633, 0.4388784397520523, 0.8585979199113825});
  expect_random(57728,
                {0.9324039686661156, 0.5927897807133846, 0.6180139974115314});
  expect_random(4294967295u,
                {0.2519435680449965, 0.21906579628685663, 0.28728472043517017});
}

TEST(NumpyGenerator, StandardNormalIsNumpys) {
  // np.random.default_rng(s).standard_normal(3)
  const auto expect_normal = [](std::uint32_t seed,
                                const std::vector<double>& wanted) {
    NumpyGenerator generator(seed);
    for (const double value : wanted) {
      EXPECT_EQ(generator.StandardNormal(), value) << "seed " << seed;
    }
  };
  expect_normal(0,
                {0.1257302210933933, -0.1321048632913019, 0.6404226504432821});
  expect_normal(1,
                {0.345584192064786, 0.8216181435011584, 0.33043707618338714});
  expect_normal(42,
                {0.30471707975443135, -1.0399841062404955, 0.7504511958064572});
  expect_normal(57728,
                {-1.312088817454338, 1.3243207364391192, 2.81213503809564});
  expect_normal(
      4294967295u,
      {-0.027271763074256376, 0.2153539268318988, -0.6669252679186933});
}

TEST(NumpyGenerator, MatricesAreFilledRowByRow) {
  // np.random.default_rng(7).normal(size=(2, 3))
  Eigen::MatrixXd wanted(2, 3);
  wanted << 0.0012301533574825742, 0.2987455375084699, -0.2741378553622176,  //
      -0.8905918387572742, -0.45467078517172255, -0.9916465549964624;
  EXPECT_EQ(NumpyGenerator(7).StandardNormal(2, 3), wanted);
  EXPECT_EQ(NumpyGenerator(7).StandardNormal(0, 3).size(), 0);
}

TEST(NumpyGenerator, OneStreamServesAllCalls) {
  // rng = np.random.default_rng(3); rng.standard_normal(); rng.random(); twice
  NumpyGenerator generator(3);
  EXPECT_EQ(generator.StandardNormal(), 2.0409191213851825);
  EXPECT_EQ(generator.Random(), 0.2368105065960997);
  EXPECT_EQ(generator.StandardNormal(), 0.41809884672577885);
  EXPECT_EQ(generator.Random(), 0.5821620360643678);
}

// Every layer is drawn some 780 times, so one wrong bit in the width of one of
// them would change the hash.
TEST(NumpyGenerator, ManyNormalNumbersAreNumpys) {
  // a = np.random.default_rng(s).standard_normal(200000)
  // a = a[np.abs(a) < 3.654]; FNV-1a over a.view(np.uint64), word by word
  const auto hash_of = [](std::uint32_t seed) {
    NumpyGenerator generator(seed);
    std::uint64_t hash = 1469598103934665603u;
    for (int i = 0; i < 200000; ++i) {
      const double value = generator.StandardNormal();
      if (std::abs(value) >= 3.654) continue;
      std::uint64_t bits = 0;
      std::memcpy(&bits, &value, sizeof(bits));
      hash = (hash ^ bits) * 1099511628211u;
    }
    return hash;
  };
  EXPECT_EQ(hash_of(0), 0x83104bda78751232u);
  EXPECT_EQ(hash_of(1), 0x957bfa8294540a24u);
  EXPECT_EQ(hash_of(57728), 0x5a9267c974478ec5u);
  EXPECT_EQ(hash_of(4294967295u), 0x1a0aff875c93c60fu);
}

TEST(NumpyGenerator, TailIsNumpys) {
  // a = np.random.default_rng(0).standard_normal(200000); the first of
  // a[np.abs(a) > 3.6541528853610088]
  NumpyGenerator generator(0);
  std::vector<double> tail;
  while (tail.size() < 3) {
    const double value = generator.StandardNormal();
    if (std::abs(value) > kTailStart) tail.push_back(value);
  }
  EXPECT_DOUBLE_EQ(tail[0], -3.772275156122734);
  EXPECT_DOUBLE_EQ(tail[1], -3.899421730054339);
  EXPECT_DOUBLE_EQ(tail[2], 3.945549686526577);
}

TEST(NumpyGenerator, MomentsAreThoseOfTheDistributions) {
  constexpr int kDraws = 1000000;
  NumpyGenerator generator(11);
  double mean = 0.0, square = 0.0, fourth = 0.0, uniform = 0.0;
  int in_tail = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = generator.StandardNormal();
    mean += x / kDraws;
    square += x * x / kDraws;
    fourth += x * x * x * x / kDraws;
    if (std::abs(x) > kTailStart) ++in_tail;
    const double u = generator.Random();
    ASSERT_GE(u, 0.0);
    ASSERT_LT(u, 1.0);
    uniform += u / kDraws;
  }
  // Four standard deviations: the variances of x, x^2, x^4 and u are 1, 2, 96
  // and 1/12, that of the count is its mean.
  const double sigmas = 4.0 / std::sqrt(kDraws);
  EXPECT_NEAR(mean, 0.0, sigmas);
  EXPECT_NEAR(square, 1.0, sigmas * std::sqrt(2.0));
  EXPECT_NEAR(fourth, 3.0, sigmas * std::sqrt(96.0));
  EXPECT_NEAR(uniform, 0.5, sigmas * std::sqrt(1.0 / 12.0));
  const double wanted_in_tail = kDraws * std::erfc(kTailStart * M_SQRT1_2);
  EXPECT_NEAR(in_tail, wanted_in_tail, 4.0 * std::sqrt(wanted_in_tail));
}

}  // namespace numpy_generator_test
}  // namespace invgrad
