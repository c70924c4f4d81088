#include "invgrad/train/averaged_weights.h"

#include <cmath>
#include <limits>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/io/numpy_random.h"
#include "tests/train/sum_of_weights.h"

namespace invgrad {
namespace averaged_weights_test {

using Eigen::VectorXd;

TEST(AveragedWeights, OfConstantWeightsAreTheseBitForBit) {
  const VectorXd weights = Eigen::Vector3d(0.1, -1.0 / 3.0, 1e300);
  AveragedWeights average;
  for (int k = 1; k <= 100; ++k) {
    EXPECT_EQ(average.With(weights), weights);
    average.Add(weights);
    EXPECT_EQ(average.average(), weights);
    EXPECT_EQ(average.num_weights_added(), k);
  }
}

// w_k = k v has the average ((g + 1) K + 1) / (g + 2) v, because the sum of
// k (k + 1) ... (k + p - 1) over k = 1..K is K (K + 1) ... (K + p) / (p + 1).
TEST(AveragedWeights, OfALinearDriftAreKnown) {
  constexpr double g = AveragedWeights::kDecay;
  const VectorXd v = Eigen::Vector2d(0.3, -7.0);
  AveragedWeights average;
  for (int k = 1; k <= 1000; ++k) {
    average.Add(k * v);
    const VectorXd expected = ((g + 1.0) * k + 1.0) / (g + 2.0) * v;
    // Rounding errors of later steps outweigh those of earlier ones.
    EXPECT_LE((average.average() - expected).norm(), 1e-14 * expected.norm())
        << k;
  }
}

TEST(AveragedWeights, AreTheSumOfTheHeader) {
  NumpyRandom random(1);
  std::vector<VectorXd> all;
  AveragedWeights average;
  for (int k = 1; k <= 300; ++k) {
    all.emplace_back(random.Rand(5, 1));
    const VectorXd next = average.With(all.back());
    average.Add(all.back());
    EXPECT_EQ(next, average.average());
    const VectorXd sum = SumOfWeights(all);
    EXPECT_LE((average.average() - sum).norm(), 1e-14 * sum.norm()) << k;
  }
}

TEST(AveragedWeights, LeaveOutWhatIsNotFinite) {
  constexpr double kMax = std::numeric_limits<double>::max();
  const VectorXd good = Eigen::Vector2d(1.0, kMax);
  AveragedWeights average;
  for (int repeat = 0; repeat < 2; ++repeat) {
    average.Add(Eigen::Vector2d(NAN, 0.0));
    average.Add(Eigen::Vector2d(0.0, HUGE_VAL));
    if (repeat == 0) {
      EXPECT_EQ(average.num_weights_added(), 0);
      EXPECT_EQ(average.average().size(), 0);
      average.Add(good);
    }
  }
  // Their difference overflows.
  average.Add(-good);
  EXPECT_EQ(average.average(), good);
  EXPECT_EQ(average.num_weights_added(), 1);
}

}  // namespace averaged_weights_test
}  // namespace invgrad
