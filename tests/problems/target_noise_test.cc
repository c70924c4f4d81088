// The option `noise` of problems (sample_data.h).
#include <cmath>
#include <string>

#include "gtest/gtest.h"
#include "tests/support/create_problem.h"

namespace invgrad {
namespace target_noise_test {

class TargetNoise : public testing::TestWithParam<std::string> {};

TEST_P(TargetNoise, IsInTheTrainingTargetsAlone) {
  const LearningProblem clean = CreateLearningProblem(GetParam());
  const LearningProblem noisy =
      CreateLearningProblem(GetParam() + ":noise=0.5");
  EXPECT_EQ(noisy.train.inputs, clean.train.inputs);
  EXPECT_EQ(noisy.train.contexts, clean.train.contexts);
  EXPECT_EQ(noisy.train.solutions, clean.train.solutions);
  EXPECT_EQ(noisy.test.inputs, clean.test.inputs);
  EXPECT_EQ(noisy.test.targets, clean.test.targets);
  EXPECT_NE(noisy.train.targets, clean.train.targets);
}

// Of N normal numbers the mean square deviates from its expectation by
// sqrt(2 / N), the mean by 1 / sqrt(N), and so does the mean product with what
// they are added to; N is at least 1000, the bound five deviations.
TEST_P(TargetNoise, HasItsSizeAndIsIndependentOfTheTargets) {
  const Eigen::MatrixXd clean = CreateLearningProblem(GetParam()).train.targets;
  const Eigen::MatrixXd noisy =
      CreateLearningProblem(GetParam() + ":noise=0.5").train.targets;
  const double count = static_cast<double>(clean.size());
  ASSERT_GE(count, 1000.0);
  const double rms = std::sqrt(clean.squaredNorm() / count);
  const Eigen::MatrixXd z = (noisy - clean) / (0.5 * rms);
  EXPECT_NEAR(z.squaredNorm() / count, 1.0, 5.0 * std::sqrt(2.0 / count));
  EXPECT_NEAR(z.mean(), 0.0, 5.0 / std::sqrt(count));
  EXPECT_NEAR(
      z.cwiseProduct(clean).sum() / (count * rms), 0.0, 5.0 / std::sqrt(count));
}

TEST_P(TargetNoise, IsProportionalToItsSettingAndRepeats) {
  const Eigen::MatrixXd clean = CreateLearningProblem(GetParam()).train.targets;
  const Eigen::MatrixXd once =
      CreateLearningProblem(GetParam() + ":noise=0.01").train.targets;
  const Eigen::MatrixXd twice =
      CreateLearningProblem(GetParam() + ":noise=0.02").train.targets;
  EXPECT_EQ(once,
            CreateLearningProblem(GetParam() + ":noise=0.01").train.targets);
  EXPECT_LT((twice - clean - 2.0 * (once - clean)).cwiseAbs().maxCoeff(),
            1e-14 * clean.cwiseAbs().maxCoeff());
}

INSTANTIATE_TEST_SUITE_P(Problems,
                         TargetNoise,
                         testing::Values("oscillator_chain:num_samples=500",
                                         "poisson:num_samples=100",
                                         "regression_1d:num_samples=1001",
                                         "random_polynomial:num_samples=1001"));

}  // namespace target_noise_test
}  // namespace invgrad
