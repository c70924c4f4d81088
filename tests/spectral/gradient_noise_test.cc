#include "invgrad/spectral/gradient_noise.h"

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "gtest/gtest.h"
#include "tests/spectral/refit.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace gradient_noise_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

LeaveOneOutScore GradientScore(const MatrixXd& J,
                               const VectorXd& g,
                               const std::vector<int>& rows,
                               int max_num_samples = 0) {
  LeaveOneOutOptions options;
  options.max_num_samples = max_num_samples;
  LeaveOneOutSummary summary;
  ChangeOf(J, g, rows, SpectralFilter::GradientDescent(), &summary, options);
  return summary.score;
}

double NoiseScale(const MatrixXd& J, const VectorXd& g, int num_samples) {
  const std::vector<int> rows(num_samples,
                              static_cast<int>(J.rows()) / num_samples);
  return GradientNoiseScale(GradientScore(J, g, rows), num_samples);
}

// The samples' gradients one by one, and the estimates of McCandlish et al.,
// appendix A.1, from batches of 1 and B.
TEST(GradientNoiseScale, EqualsTheFormulasOfTheSamplesGradients) {
  for (const SampleBatch& batch : kSampleBatches) {
    SCOPED_TRACE(batch.name);
    const MatrixXd J = JacobianOf(batch, 1);
    // The loss of each sample falls in the direction of one x.
    const VectorXd g = J * RandomMatrix(batch.n, 1, 2);
    const auto B = static_cast<int>(batch.rows.size());
    MatrixXd h(batch.n, B);
    for (int i = 0, first = 0; i < B; first += batch.rows[i++]) {
      h.col(i) = J.middleRows(first, batch.rows[i]).transpose() *
                 g.segment(first, batch.rows[i]);
    }
    const VectorXd mean = h.rowwise().mean();
    const double trace = (h.colwise() - mean).squaredNorm() / (B - 1.0);
    const double squared_mean = mean.squaredNorm() - trace / B;
    ASSERT_GT(squared_mean, 0.01 * mean.squaredNorm());

    const double of_one = h.squaredNorm() / B;
    const double of_all = mean.squaredNorm();
    EXPECT_NEAR(
        (B * of_all - of_one) / (B - 1.0), squared_mean, 1e-12 * of_all);
    EXPECT_NEAR((of_one - of_all) / (1.0 - 1.0 / B), trace, 1e-12 * of_one);

    const LeaveOneOutScore score = GradientScore(J, g, batch.rows);
    EXPECT_NEAR(score.g_c / (B * (B - 1.0)), squared_mean, 1e-12 * of_all);
    EXPECT_NEAR(
        score.g_fitted / B - score.g_c / (B - 1.0), trace, 1e-12 * of_one);
    const double expected = trace / squared_mean;
    // |h|^2 / |mu|^2 times the rounding of G, 1e-14.
    EXPECT_NEAR(GradientNoiseScale(score, B),
                expected,
                1e-13 * of_one / squared_mean * (B + expected));

    // The factor in front of the loss does not matter.
    EXPECT_NEAR(GradientNoiseScale(GradientScore(J, 1e-3 * g, batch.rows), B),
                expected,
                1e-13 * of_one / squared_mean * (B + expected));
  }
}

// Gradients of a known distribution. (B - 1) g_fitted - (N + B) g_c has the mean
// zero if N is the ratio of the means, also where few samples are chosen.
TEST(GradientNoiseScale, MeansAreThoseOfTheDistribution) {
  constexpr int kSamples = 10;
  constexpr int kParameters = 25;
  constexpr int kBatches = 400;
  const VectorXd mu = VectorXd::Constant(kParameters, 0.2);  // |mu| = 1
  constexpr double kSigma = 0.4;
  constexpr double kNoiseScale = kParameters * kSigma * kSigma;  // 4
  const std::vector<int> rows(kSamples, 1);
  for (const int max_num_samples : {0, 3}) {
    std::mt19937 generator(3);
    std::normal_distribution<double> normal;
    LeaveOneOutScore sum;
    VectorXd differences(kBatches);
    for (int batch = 0; batch < kBatches; ++batch) {
      const MatrixXd J =
          MatrixXd::NullaryExpr(
              kSamples,
              kParameters,
              [&](Eigen::Index) { return kSigma * normal(generator); }) +
          VectorXd::Ones(kSamples) * mu.transpose();
      const LeaveOneOutScore score =
          GradientScore(J, VectorXd::Ones(kSamples), rows, max_num_samples);
      differences[batch] = (kSamples - 1.0) * score.g_fitted -
                           (kNoiseScale + kSamples) * score.g_c;
      sum += score;
    }
    const double mean = differences.mean();
    const double standard_error =
        std::sqrt((differences.array() - mean).square().sum() /
                  (kBatches - 1.0) / kBatches);
    EXPECT_LE(std::abs(mean), 3.0 * standard_error) << max_num_samples;
    // In units of the noise scale: small enough to see a wrong one.
    const double g_c = sum.g_c / kBatches;
    EXPECT_LE(standard_error / g_c, 0.3) << max_num_samples;
    EXPECT_NEAR(
        GradientNoiseScale(sum, kSamples), kNoiseScale + mean / g_c, 1e-10);
  }
}

TEST(GradientNoiseScale, EqualSamplesHaveNoNoise) {
  for (const int n : {20, 3}) {
    const MatrixXd J = VectorXd::Ones(6) * RandomMatrix(1, n, 4);
    const double noise_scale = NoiseScale(J, VectorXd::Constant(6, 2.0), 6);
    EXPECT_GE(noise_scale, 0.0);
    EXPECT_LE(noise_scale, 1e-13);
    EXPECT_EQ(NoiseScale(J, VectorXd::Zero(6), 6), 0.0);
    EXPECT_EQ(NoiseScale(MatrixXd::Zero(6, n), VectorXd::Ones(6), 6), 0.0);
  }
}

// Gradients that add up to nothing.
TEST(GradientNoiseScale, NoiseAloneIsInfinite) {
  for (const int n : {20, 3}) {
    MatrixXd J = RandomMatrix(6, n, 5);
    J.bottomRows(3) = -J.topRows(3);
    EXPECT_EQ(NoiseScale(J, VectorXd::Ones(6), 6), kInfinity);
  }
}

TEST(GradientNoiseScale, OneSampleSaysNothingAboutNoise) {
  for (const int n : {20, 3}) {
    const MatrixXd J = RandomMatrix(6, n, 6);
    EXPECT_EQ(NoiseScale(J, RandomMatrix(6, 1, 7), 1), kInfinity);
    EXPECT_EQ(NoiseScale(J, VectorXd::Zero(6), 1), kInfinity);
  }
}

// Few of the samples may agree better with all than all among themselves.
TEST(GradientNoiseScale, IsNeverNegative) {
  LeaveOneOutScore score;
  score.g_c = 10.0;
  score.g_fitted = 11.0;
  EXPECT_NEAR(GradientNoiseScale(score, 100), 99.0 * 1.1 - 100.0, 1e-12);
  score.g_fitted = 10.0;
  EXPECT_EQ(GradientNoiseScale(score, 100), 0.0);
}

TEST(GradientNoiseScaleDeathTest, TheNumberOfSamplesIsChecked) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  EXPECT_DEATH(GradientNoiseScale(LeaveOneOutScore(), 0), "num_samples");
}

}  // namespace gradient_noise_test
}  // namespace invgrad
