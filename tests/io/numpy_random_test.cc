#include <cmath>
#include <cstdint>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/random.h"

namespace invgrad {
namespace numpy_random_test {

// Every literal below was printed by numpy 2.4.6 with the call beside it, with
// repr(), which gives the same double back. So all comparisons are exact.
class NumpyRandomTest : public testing::Test {
 protected:
  static void ExpectRand(std::uint32_t seed,
                         const std::vector<double>& wanted) {
    NumpyRandom random(seed);
    for (const double value : wanted) {
      EXPECT_EQ(random.Rand(), value) << "seed " << seed;
    }
  }
};

TEST_F(NumpyRandomTest, RandIsNumpys) {
  // np.random.seed(s); np.random.rand(3)
  ExpectRand(0, {0.5488135039273248, 0.7151893663724195, 0.6027633760716439});
  ExpectRand(1,
             {0.417022004702574, 0.7203244934421581, 0.00011437481734488664});
  ExpectRand(42, {0.3745401188473625, 0.9507143064099162, 0.7319939418114051});
  ExpectRand(4294967295u,
             {0.0976320289940138, 0.9123828453026218, 0.78903530185164});
}

TEST_F(NumpyRandomTest, MatricesAreFilledRowByRow) {
  // np.random.seed(s); np.random.rand(2, 3)
  Eigen::MatrixXd wanted(2, 3);
  wanted << 0.5488135039273248, 0.7151893663724195, 0.6027633760716439,  //
      0.5448831829968969, 0.4236547993389047, 0.6458941130666561;
  EXPECT_EQ(NumpyRandom(0).Rand(2, 3), wanted);
  wanted << 0.417022004702574, 0.7203244934421581, 0.00011437481734488664,  //
      0.30233257263183977, 0.14675589081711304, 0.0923385947687978;
  EXPECT_EQ(NumpyRandom(1).Rand(2, 3), wanted);
  wanted << 0.3745401188473625, 0.9507143064099162, 0.7319939418114051,  //
      0.5986584841970366, 0.15601864044243652, 0.15599452033620265;
  EXPECT_EQ(NumpyRandom(42).Rand(2, 3), wanted);
  EXPECT_EQ(NumpyRandom(0).Rand(0, 3).size(), 0);
}

TEST_F(NumpyRandomTest, PermutationIsNumpys) {
  // np.random.seed(s); np.random.permutation(10)
  EXPECT_EQ(NumpyRandom(0).Permutation(10),
            (std::vector<int>{2, 8, 4, 9, 1, 6, 7, 3, 0, 5}));
  EXPECT_EQ(NumpyRandom(1).Permutation(10),
            (std::vector<int>{2, 9, 6, 4, 0, 3, 1, 7, 8, 5}));
  EXPECT_EQ(NumpyRandom(42).Permutation(10),
            (std::vector<int>{8, 1, 5, 0, 7, 2, 9, 4, 3, 6}));
}

TEST_F(NumpyRandomTest, NormalPairsAreNumpys) {
  // np.random.seed(s); [np.random.normal() for _ in range(4)]
  NumpyRandom zero(0);
  EXPECT_EQ(zero.NormalPair(),
            Eigen::Vector2d(1.764052345967664, 0.4001572083672233));
  EXPECT_EQ(zero.NormalPair(),
            Eigen::Vector2d(0.9787379841057392, 2.240893199201458));
  NumpyRandom answer(42);
  EXPECT_EQ(answer.NormalPair(),
            Eigen::Vector2d(0.4967141530112327, -0.13826430117118466));
  EXPECT_EQ(answer.NormalPair(),
            Eigen::Vector2d(0.6476885381006925, 1.5230298564080254));
  // np.random.seed(1); np.random.normal(); np.random.normal();
  // np.random.uniform(0, 2 * np.pi)
  NumpyRandom one(1);
  EXPECT_EQ(one.NormalPair(),
            Eigen::Vector2d(1.6243453636632417, -0.6117564136500754));
  EXPECT_EQ(one.Uniform(0.0, 2.0 * M_PI), 0.0007186381718527407);
}

TEST_F(NumpyRandomTest, UniformIsNumpys) {
  // np.random.seed(s); np.random.uniform(-2.5, 4) twice
  NumpyRandom zero(0);
  EXPECT_EQ(zero.Uniform(-2.5, 4), 1.067287775527611);
  EXPECT_EQ(zero.Uniform(-2.5, 4), 2.148730881420726);
  NumpyRandom one(1);
  EXPECT_EQ(one.Uniform(-2.5, 4), 0.21064303056673106);
  EXPECT_EQ(one.Uniform(-2.5, 4), 2.182109207374028);
  NumpyRandom answer(42);
  EXPECT_EQ(answer.Uniform(-2.5, 4), -0.0654892274921437);
  EXPECT_EQ(answer.Uniform(-2.5, 4), 3.679642991664455);
}

TEST_F(NumpyRandomTest, OneStreamServesAllCalls) {
  // np.random.seed(1); np.random.rand(3); np.random.permutation(10);
  // np.random.rand()
  NumpyRandom random(1);
  random.Rand(1, 3);
  EXPECT_EQ(random.Permutation(10),
            (std::vector<int>{3, 7, 6, 2, 9, 4, 1, 8, 0, 5}));
  EXPECT_EQ(random.Rand(), 0.8463109166860171);

  // np.random.seed(5); the last of 1000 np.random.rand(), which is past the
  // refilling of the generator's 624 words; np.random.permutation(1000);
  // np.random.rand()
  NumpyRandom longer(5);
  const Eigen::MatrixXd values = longer.Rand(1000, 1);
  EXPECT_EQ(values(999), 0.7905930946436218);
  const std::vector<int> order = longer.Permutation(1000);
  EXPECT_EQ(std::vector<int>(order.begin(), order.begin() + 5),
            (std::vector<int>{418, 246, 176, 19, 49}));
  EXPECT_EQ(longer.Rand(), 0.6641821613483267);
}

TEST_F(NumpyRandomTest, EmptyAndSinglePermutationsDrawNothing) {
  NumpyRandom random(0);
  EXPECT_TRUE(random.Permutation(0).empty());
  EXPECT_EQ(random.Permutation(1), std::vector<int>{0});
  EXPECT_EQ(random.Rand(), 0.5488135039273248);
}

TEST_F(NumpyRandomTest, GoesOnFromItsState) {
  NumpyRandom random(3);
  for (int i = 0; i < 320; ++i) {
    NumpyRandom other(4);
    ASSERT_TRUE(other.SetState(random.State()));
    ASSERT_EQ(other.Rand(), random.Rand());
  }
}

TEST_F(NumpyRandomTest, RefusesWhatIsNoState) {
  NumpyRandom random(3);
  const Eigen::VectorXd state = random.State();
  EXPECT_FALSE(random.SetState(Eigen::VectorXd()));
  EXPECT_FALSE(random.SetState(state.head(624)));
  for (const double value : {-1.0, 0.5, 4294967296.0, std::nan("")}) {
    Eigen::VectorXd wrong = state;
    wrong[17] = value;
    EXPECT_FALSE(random.SetState(wrong)) << value;
  }
  Eigen::VectorXd outside = state;
  outside[624] = 625.0;  // the next word's position
  EXPECT_FALSE(random.SetState(outside));
  EXPECT_EQ(random.Rand(), NumpyRandom(3).Rand());
}

}  // namespace numpy_random_test
}  // namespace invgrad
