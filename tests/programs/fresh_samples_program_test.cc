// The program fresh_samples, run as a user runs it, and its parts.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "bin/fresh_samples/agreement.h"
#include "bin/fresh_samples/probe.h"
#include "bin/support/learning_run.h"
#include "gtest/gtest.h"
#include "invgrad/io/format.h"
#include "invgrad/train/train.h"
#include "tests/programs/csv_lines.h"
#include "tests/support/program_runner.h"

namespace invgrad {
namespace fresh_samples_program_test {

namespace fs = std::filesystem;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

class FreshSamplesProgram : public ProgramRunner {
 protected:
  FreshSamplesProgram() : ProgramRunner("fresh_samples") {}

  static std::vector<std::string> Small(
      const std::vector<std::string>& arguments) {
    std::vector<std::string> all = {
        "--problem=random_polynomial:num_samples=48:noise=0.1",
        "--batch_size=8",
        "--shuffle",
        "--dampings=1e-6,1e-2",
        "--grid_steps=1",
        "--progress=false"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return all;
  }

  CsvLines Read(const std::string& file) const {
    return ReadCsv(ReadAll(Path(file)));
  }
};

double Number(const CsvLines& rows, size_t i, const std::string& name) {
  return std::stod(rows.at(i).at(name));
}

TEST_F(FreshSamplesProgram, WritesAllFilesAndSensibleNumbers) {
  const Output output = Run(Small({"--at=3,0", "--output=" + Path("run")}));
  ASSERT_EQ(output.exit_code, 0) << output.text;
  for (const char* name : {"fresh_samples.csv",
                           "fresh_samples.md",
                           "fresh_samples.png",
                           "calibration.csv",
                           "calibration.md",
                           "calibration.png",
                           "flags.txt"}) {
    EXPECT_TRUE(fs::exists(Path("run") + "/" + name)) << name;
  }
  const CsvLines grid = Read("run/fresh_samples.csv");
  ASSERT_EQ(grid.size(), 2u * 5u * 2u);  // steps, exponents, dampings
  for (size_t i = 0; i < grid.size(); ++i) {
    // A share of the loss, by Cauchy and Schwarz; the loss is not negative.
    EXPECT_GE(Number(grid, i, "predicted"), 0.0) << i;
    EXPECT_LE(Number(grid, i, "predicted"), 1.0) << i;
    EXPECT_LE(Number(grid, i, "measured"), 1.0) << i;
    EXPECT_LE(Number(grid, i, "measured_test"), 1.0) << i;
  }
  // Gradient descent has no damping.
  EXPECT_EQ(Number(grid, 0, "kappa"), -1.0);
  EXPECT_EQ(grid[0].at("predicted"), grid[1].at("predicted"));
  EXPECT_EQ(grid[0].at("measured"), grid[1].at("measured"));
  const CsvLines rule = Read("run/calibration.csv");
  ASSERT_EQ(rule.size(), 3u);
  EXPECT_EQ(Number(rule, 2, "step"), 2.0);
}

TEST_F(FreshSamplesProgram, JudgingDoesNotDisturbTheTraining) {
  ASSERT_EQ(Run(Small({"--at=1..7", "--output=" + Path("often")})).exit_code,
            0);
  ASSERT_EQ(Run(Small({"--at=7", "--every=3", "--output=" + Path("seldom")}))
                .exit_code,
            0);
  const CsvLines often = Read("often/fresh_samples.csv");
  const CsvLines seldom = Read("seldom/fresh_samples.csv");
  ASSERT_EQ(seldom.size(), 10u);
  EXPECT_EQ(CsvLines(often.end() - 10, often.end()), seldom);
  const CsvLines all = Read("often/calibration.csv");
  const CsvLines third = Read("seldom/calibration.csv");
  ASSERT_EQ(all.size(), 7u);
  ASSERT_EQ(third.size(), 3u);
  for (size_t i = 0; i < 3; ++i) EXPECT_EQ(all[3 * i], third[i]);
}

TEST_F(FreshSamplesProgram, TheGridShowsMeansOverSteps) {
  const Output output = Run(Small({"--at=2",
                                   "--grid_steps=3",
                                   "--dampings=1e-2",
                                   "--plots=false",
                                   "--output=" + Path("run")}));
  ASSERT_EQ(output.exit_code, 0) << output.text;
  const CsvLines grid = Read("run/fresh_samples.csv");
  ASSERT_EQ(grid.size(), 3u * 5u);
  double highest = 0.0;
  for (size_t i = 0; i < 5; ++i) {
    double sum = 0.0;
    for (size_t k = 0; k < 3; ++k) {
      sum += Number(grid, 5 * k + i, "predicted");
      EXPECT_EQ(grid[5 * k + i].at("step_size"), grid[i].at("step_size"));
    }
    highest = std::max(highest, sum / 3.0);
  }
  ExpectSays(output, {" " + FormatNumber(highest) + " "});
}

// Of the same sums as gradient descent's gamma: (B - 1) / gamma - B.
TEST_F(FreshSamplesProgram, TheNoiseScaleIsThatOfAllStepsOfAGrid) {
  const Output output = Run(Small({"--at=2,5",
                                   "--grid_steps=3",
                                   "--dampings=1e-2",
                                   "--plots=false",
                                   "--output=" + Path("run")}));
  ASSERT_EQ(output.exit_code, 0) << output.text;
  const CsvLines grid = Read("run/fresh_samples.csv");
  ASSERT_EQ(grid.size(), 2u * 3u * 5u);
  const auto gamma = [&grid](size_t i) {
    EXPECT_EQ(Number(grid, i, "kappa"), -1.0);
    return Number(grid, i, "gamma");
  };
  // One that cannot be told from noise, and one that can.
  ASSERT_LT(gamma(0), 0.0);
  ASSERT_GT(gamma(15), 0.0);
  for (size_t i = 0; i < 15; ++i) {
    EXPECT_EQ(Number(grid, i, "noise_scale"), kInfinity) << i;
  }
  const double noise_scale = Number(grid, 15, "noise_scale");
  EXPECT_NEAR(noise_scale, 7.0 / gamma(15) - 8.0, 1e-14 * 7.0 / gamma(15));
  for (size_t i = 15; i < 30; ++i) {
    EXPECT_EQ(Number(grid, i, "noise_scale"), noise_scale) << i;
  }
  ExpectSays(output,
             {"noise scale", " inf ", " " + FormatNumber(noise_scale) + " "});
}

TEST_F(FreshSamplesProgram, RefusesBadInput) {
  ExpectRefused({"--rule=adam"}, {"--rule=adam", "no filter", "half_inverse"});
  ExpectRefused({"--rule=adaptve"}, {"--rule", "adaptve", "adaptive"});
  ExpectRefused({"--problem=squared_component"}, {"squared_component"});
  ExpectRefused({"--at=ten"}, {"--at", "ten"});
  ExpectRefused({"--dampings="}, {"--dampings"});
  ExpectRefused({"--dampings=-1"}, {"--dampings", "-1"});
  ExpectRefused({"--grid_steps=0"}, {"--grid_steps=0", "allowed"});
  ExpectRefused({"--every=0"}, {"--every=0", "allowed"});
  ExpectRefused({"--fresh_batches=0"}, {"--fresh_batches=0", "allowed"});
  ExpectRefused({"--batch_size=0"}, {"--fresh_batches", "4096"});
}

TEST_F(FreshSamplesProgram, AStepThatIsNotReachedIsSaid) {
  const Output output = Run(Small(
      {"--steps=2", "--at=0,5", "--plots=false", "--output=" + Path("run")}));
  EXPECT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output, {"--at=5", "2 steps"});
  EXPECT_EQ(Read("run/fresh_samples.csv").size(), 10u);
}

LearningProblem Polynomial(const std::string& options) {
  LearningProblem problem;
  std::string error;
  EXPECT_TRUE(
      CreateLearningProblem("random_polynomial" + options, &problem, &error))
      << error;
  return problem;
}

TEST(FreshProbe, BatchesAreThoseOfARun) {
  const LearningProblem problem = Polynomial(":num_samples=50");
  TrainOptions options;
  options.batch_size = 8;
  options.max_num_steps = 14;  // in the third epoch
  options.seed = 3;
  options.initial_weights = InitialWeights(problem, 3);
  for (const bool shuffles : {false, true}) {
    options.shuffle = shuffles;
    const FreshProbe probe(problem, 8, 1, shuffles, 3);
    const TrainResult own =
        Train(*problem.model, problem.train, "half_inverse", options);
    const TrainResult same =
        Train(*problem.model,
              TrainingData(problem.train, DataSet(), probe.batches()),
              "half_inverse",
              options);
    ASSERT_EQ(own.summary.num_steps, 14);
    EXPECT_EQ(own.weights, same.weights);
  }
}

// A model that is linear in its weights, and independent samples: nothing but
// chance keeps prediction and measurement apart. Both are means over B samples,
// whose squared errors have a relative standard deviation of about two.
TEST(FreshProbe, PredictionsHoldForALinearModelAndIndependentSamples) {
  LearningProblem problem = Polynomial(":num_samples=6000:noise=1");
  problem.model = std::make_shared<Model>(
      problem.model->WithNetwork(DenseNetwork({6, 1}, Activation::kTanh)));
  constexpr int kBatch = 1000;
  FreshProbe probe(problem, kBatch, 4, false, 0);
  std::string error;
  Eigen::VectorXd weights(7);
  weights << 1.0, -1.0, 0.5, 2.0, -0.5, 1.0, 3.0;
  ASSERT_TRUE(probe.Begin(0, weights, &error)) << error;
  for (const double kappa : {-1.0, 0.0, 0.5, 1.0}) {
    SCOPED_TRACE(kappa);
    const SpectralFilter filter = SpectralFilter::Power(kappa, 0.0);
    std::vector<LeaveOneOutSummary> summaries;
    ASSERT_TRUE(probe.Score({filter}, &summaries, &error)) << error;
    const LeaveOneOutScore& score = summaries[0].score;
    FreshDecrease decrease;
    ASSERT_TRUE(probe.Measure(
        filter, summaries[0], score.StepSize(), &decrease, &error))
        << error;
    EXPECT_NEAR(decrease.predicted, score.RelativeDecrease(), 1e-10);
    EXPECT_NEAR(
        decrease.measured, decrease.predicted, 3.0 * 2.0 / std::sqrt(kBatch));
    EXPECT_GT(decrease.predicted, 0.2);
    // Up to rounding, the linear model is the loss.
    EXPECT_NEAR(decrease.linear, decrease.measured, 1e-12);
    // No step changes nothing, and twice the best one gains nothing.
    ASSERT_TRUE(probe.Measure(filter, summaries[0], 0.0, &decrease, &error));
    EXPECT_EQ(decrease.predicted, 0.0);
    EXPECT_EQ(decrease.linear, 0.0);
    EXPECT_EQ(decrease.measured, 0.0);
    ASSERT_TRUE(probe.Measure(
        filter, summaries[0], 2.0 * score.StepSize(), &decrease, &error));
    EXPECT_NEAR(decrease.predicted, 0.0, 1e-10);
  }
}

// A Wiener filter of a = 1 at kappa = 1 is damping: l^-1 l / (l + noise).
TEST(FreshProbe, NoiseCountsAsDamping) {
  const LearningProblem problem = Polynomial(":num_samples=64");
  FreshProbe probe(problem, 8, 1, false, 0);
  std::string error;
  ASSERT_TRUE(probe.Begin(0, InitialWeights(problem, 0), &error)) << error;
  SpectralFilter wiener = SpectralFilter::Power(1.0, 0.0);
  wiener.noise = 1e-3;
  std::vector<LeaveOneOutSummary> summaries;
  ASSERT_TRUE(
      probe.Score({wiener, SpectralFilter::LevenbergMarquardt(0.0, 1e-3)},
                  &summaries,
                  &error))
      << error;
  EXPECT_EQ(summaries[0].damping, summaries[1].damping);
  EXPECT_EQ(summaries[0].score.g_c, summaries[1].score.g_c);
}

TEST(FreshProbe, NeedsBatchesThatTheStepHasNotSeen) {
  const LearningProblem problem = Polynomial(":num_samples=64");
  std::string error;
  EXPECT_TRUE(FreshProbe(problem, 8, 7, false, 0).IsValid(&error));
  EXPECT_FALSE(FreshProbe(problem, 8, 8, false, 0).IsValid(&error));
  EXPECT_NE(error.find("has 7 others"), std::string::npos) << error;
}

TEST(Agreement, OfRanksAndRatios) {
  const Agreement same({1.0, 2.0, 3.0}, {2.0, 6.0, 27.0});
  EXPECT_EQ(same.num_pairs, 3);
  EXPECT_NEAR(same.rank_correlation, 1.0, 1e-15);
  EXPECT_EQ(same.median_ratio, 3.0);
  EXPECT_NEAR(Agreement({1.0, 2.0, 3.0}, {3.0, 2.0, 1.0}).rank_correlation,
              -1.0,
              1e-15);
  // Ties: ranks 1.5, 1.5, 3 against 1, 2, 3.
  EXPECT_NEAR(Agreement({1.0, 1.0, 2.0}, {1.0, 2.0, 3.0}).rank_correlation,
              std::sqrt(0.75),
              1e-15);
  const Agreement gaps({1.0, kNaN, 0.0, 2.0}, {1.0, 5.0, -1.0, kNaN});
  EXPECT_EQ(gaps.num_pairs, 2);
  EXPECT_EQ(gaps.median_ratio, 1.0);
  const Agreement none({}, {});
  EXPECT_EQ(none.num_pairs, 0);
  EXPECT_TRUE(std::isnan(none.rank_correlation));
  EXPECT_TRUE(std::isnan(none.median_ratio));
}

}  // namespace fresh_samples_program_test
}  // namespace invgrad
