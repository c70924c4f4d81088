// Races of batch sizes: what the race decides, and runs with it.

#include "invgrad/train/batch_race.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "ceres/iteration_callback.h"
#include "gtest/gtest.h"
#include "invgrad/random.h"
#include "invgrad/rules.h"
#include "invgrad/train.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/train_options.h"
#include "tests/train/parabola.h"
#include "tests/train/regression.h"

namespace invgrad {
namespace batch_race_test {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Steps that cost as much as they have samples.
BatchRace::Costs Linear() {
  BatchRace::Costs costs;
  costs.of_step = [](int batch_size) { return 1.0 * batch_size; };
  costs.fits = [](int, std::string*) { return true; };
  return costs;
}

// Takes steps until the next race is over; `loss` of a slice by its batch size.
// Returns the sizes of the slices.
template <typename Loss>
std::vector<int> RunRace(const Loss& loss, BatchRace* race) {
  while (!(race->IsDue() && race->Begin(1.0))) race->CountStep();
  std::vector<int> sizes;
  std::vector<double> losses;
  do {
    sizes.push_back(race->batch_size());
    while (!race->IsSliceOver()) race->CountStep();
    losses.push_back(loss(sizes.back()));
  } while (race->BeginNextSlice());
  race->End(losses);
  return sizes;
}

double SmallerIsBetter(int size) { return 1e-3 * size; }
double LargerIsBetter(int size) { return 1.0 / size; }

TEST(BatchRace, TheSizeFollowsTheLowestLoss) {
  BatchRace race(8, 100000, Linear());
  EXPECT_EQ(race.batch_size(), 8);
  for (int k = 0; k < 3; ++k) {
    const int before = race.batch_size();
    for (const int size : RunRace(LargerIsBetter, &race)) EXPECT_GE(size, 8);
    EXPECT_GE(race.batch_size(), 2 * before);
    EXPECT_LE(race.batch_size(), 4 * before);
  }
  for (int k = 0; k < 25; ++k) {
    const int before = race.batch_size();
    for (const int size : RunRace(SmallerIsBetter, &race)) EXPECT_GE(size, 8);
    // A smaller size is tried when the work has grown fourfold.
    EXPECT_TRUE(race.batch_size() == before || 4 * race.batch_size() == before);
  }
  EXPECT_LE(race.batch_size(), 16);
  EXPECT_EQ(race.Report().find("batch size 8, 16, "), 0u) << race.Report();
}

// Where four steps with four times as many samples are too dear, with twice as
// many.
TEST(BatchRace, TriesTwiceTheSizeFirstWhereFourTimesIsTooDear) {
  BatchRace::Costs costs = Linear();
  costs.of_step = [](int batch_size) { return 1.0 * batch_size * batch_size; };
  BatchRace race(8, 1000, costs);
  EXPECT_EQ(RunRace(LargerIsBetter, &race), (std::vector<int>{8, 16}));
}

TEST(BatchRace, AllSamplesAreTheLargestBatch) {
  BatchRace race(8, 20, Linear());
  RunRace(LargerIsBetter, &race);
  EXPECT_EQ(RunRace(LargerIsBetter, &race), (std::vector<int>{16, 20}));
  EXPECT_EQ(race.batch_size(), 20);
}

TEST(BatchRace, ASliceWithoutALossLoses) {
  BatchRace race(8, 1000, Linear());
  while (!(race.IsDue() && race.Begin(1.0))) race.CountStep();
  EXPECT_EQ(race.End({kInfinity, 0.5}), 1);
  EXPECT_GE(race.batch_size(), 16);
}

TEST(BatchRace, GoesBackFromTenTimesTheLowestLoss) {
  using Verdict = BatchRace::Verdict;
  BatchRace race(8, 1000, Linear());
  // The new samples are as hard as all others.
  const auto of_lowest = [&race]() { return race.lowest_loss(); };
  // There is nothing to go back to.
  EXPECT_EQ(race.Decide(kInfinity, of_lowest), Verdict::kGoesOn);
  EXPECT_EQ(race.Decide(2.0, of_lowest), Verdict::kIsLowest);
  EXPECT_EQ(race.Decide(2.0, of_lowest), Verdict::kGoesOn);
  EXPECT_EQ(race.Decide(1.0, of_lowest), Verdict::kIsLowest);
  EXPECT_EQ(race.Decide(10.0, of_lowest), Verdict::kGoesOn);
  EXPECT_EQ(race.lowest_loss(), 1.0);
  EXPECT_EQ(race.Report(), "batch size 8");
  EXPECT_EQ(race.Decide(10.1, of_lowest), Verdict::kGoesBack);
  EXPECT_EQ(race.Report(), "batch size 8; went back 1 time");
  EXPECT_EQ(race.Decide(kInfinity, of_lowest), Verdict::kGoesBack);
  EXPECT_EQ(race.lowest_loss(), 1.0);
  EXPECT_EQ(race.Report(), "batch size 8; went back 2 times");
  // Not from a loss of zero to itself.
  EXPECT_EQ(race.Decide(0.0, of_lowest), Verdict::kIsLowest);
  EXPECT_EQ(race.Decide(0.0, of_lowest), Verdict::kGoesOn);
  // A loss may be negative.
  EXPECT_EQ(race.Decide(-2.0, of_lowest), Verdict::kIsLowest);
  EXPECT_EQ(race.Decide(-1.0, of_lowest), Verdict::kGoesOn);
  EXPECT_EQ(race.Decide(15.0, of_lowest), Verdict::kGoesOn);
  EXPECT_EQ(race.Decide(17.0, of_lowest), Verdict::kGoesBack);
}

// A loss far above the lowest one is no reason to go back if the weights that had
// this have it, too, on the same samples.
TEST(BatchRace, GoesOnWhereTheNewSamplesAreHarder) {
  using Verdict = BatchRace::Verdict;
  BatchRace race(8, 1000, Linear());
  const auto never = []() {
    ADD_FAILURE() << "evaluated without need";
    return 0.0;
  };
  const auto of_lowest = [](double loss) { return [=]() { return loss; }; };
  EXPECT_EQ(race.Decide(1.0, never), Verdict::kIsLowest);
  EXPECT_EQ(race.Decide(9.0, never), Verdict::kGoesOn);
  EXPECT_EQ(race.Decide(50.0, of_lowest(20.0)), Verdict::kGoesOn);
  EXPECT_EQ(race.Decide(300.0, of_lowest(400.0)), Verdict::kGoesOn);
  EXPECT_EQ(race.lowest_loss(), 1.0);
  EXPECT_EQ(race.Decide(3100.0, of_lowest(301.0)), Verdict::kGoesBack);
  EXPECT_EQ(race.Decide(50.0, of_lowest(0.5)), Verdict::kGoesBack);
  EXPECT_EQ(race.Decide(kInfinity, never), Verdict::kGoesBack);
  EXPECT_EQ(race.lowest_loss(), 1.0);
}

TEST(BatchRace, LargerBatchesMustFit) {
  BatchRace::Costs costs = Linear();
  costs.fits = [](int batch_size, std::string* why) {
    if (batch_size <= 32) return true;
    *why = "too little memory";
    return false;
  };
  BatchRace race(8, 1000, costs);
  for (int k = 0; k < 3; ++k) RunRace(LargerIsBetter, &race);
  EXPECT_EQ(race.batch_size(), 32);
  EXPECT_EQ(race.Report(),
            "batch size 8, 16, 32, no larger: too little memory");
}

// Where a step costs the third power of its size, four steps with twice as many
// samples cost 32 steps, a tenth of 320.
TEST(BatchRace, LargerBatchesMustBeAffordable) {
  BatchRace::Costs costs = Linear();
  costs.of_step = [](int batch_size) {
    return 1.0 * batch_size * batch_size * batch_size;
  };
  BatchRace race(8, 1000, costs);
  long num_steps = 0;
  while (!(race.IsDue() && race.Begin(1.0))) {
    race.CountStep();
    ++num_steps;
  }
  EXPECT_GE(num_steps, 320);
  EXPECT_LE(num_steps, 500);
}

// The loss has two factors: what is left, which falls by the same share with
// each step, so that small batches are faster, and noise, 1 + 8 / B, which falls
// at once with a larger batch, and only once.
class OneTimeGain {
 public:
  double left = 1.0;

  double Loss(int batch_size) const { return left * (1.0 + 8.0 / batch_size); }
  void Step(double fall, BatchRace* race) {
    left /= fall;
    race->CountStep();
  }
};

// Returns the batch size after so many steps.
int SizeAfter(int num_steps, double fall) {
  BatchRace race(8, 1000, Linear());
  OneTimeGain run;
  std::vector<OneTimeGain> slices;
  std::vector<double> losses;
  OneTimeGain start;
  for (int k = 0; k < num_steps; ++k) {
    if (race.IsDue() && race.Begin(run.Loss(race.batch_size()))) start = run;
    const int size = race.batch_size();
    run.Step(fall, &race);
    if (!race.IsSliceOver()) continue;
    slices.push_back(run);
    losses.push_back(run.Loss(size));
    run = start;
    if (race.BeginNextSlice()) continue;
    run = slices[race.End(losses)];
    slices.clear();
    losses.clear();
  }
  return race.batch_size();
}

TEST(BatchRace, AOneTimeGainIsTakenAtAStallOnly) {
  EXPECT_EQ(SizeAfter(3000, 1.02), 8);
  EXPECT_GT(SizeAfter(3000, 1.0), 100);
}

// More than noise can fall: the larger batch has the better rate.
TEST(BatchRace, AGainAboveTheRatioOfTheSizesIsARate) {
  for (const double share : {0.9, 1.1}) {
    BatchRace race(8, 1000, Linear());
    RunRace([](int) { return 1.0; }, &race);
    while (!(race.IsDue() && race.Begin(1e-3))) race.CountStep();
    race.BeginNextSlice();
    const int larger = race.batch_size();
    ASSERT_GT(larger, 8);
    race.End({1e-3, 1e-3 / (share * larger / 8)});
    EXPECT_EQ(race.batch_size(), share < 1.0 ? 8 : larger);
  }
}

TEST(BatchRace, TakesAFifthOfTheWork) {
  BatchRace::Costs costs = Linear();
  costs.of_judgement = 3.0;
  BatchRace race(8, 1 << 20, costs);
  NumpyRandom random(1);
  double work = 0.0, in_races = 0.0;
  int num_races = 0;
  while (num_races < 30) {
    while (!(race.IsDue() && race.Begin(1.0))) {
      work += race.batch_size();
      race.CountStep();
    }
    EXPECT_LE(in_races, 0.201 * work) << num_races;
    std::vector<double> losses;
    double of_race = costs.of_judgement;
    do {
      while (!race.IsSliceOver()) {
        of_race += race.batch_size();
        race.CountStep();
      }
      losses.push_back(random.Rand(1, 1)(0, 0));
      of_race += costs.of_judgement;
    } while (race.BeginNextSlice());
    race.End(losses);
    work += of_race;
    in_races += of_race;
    ++num_races;
  }
}

// --- Runs ---

constexpr char kRaced[] =
    "gauss_newton:control=gain:step_size=auto:batch_size=auto";

std::set<double> BatchSizes(const TrainResult& result) {
  std::set<double> sizes;
  for (const HistoryRow& row : result.history) sizes.insert(row.batch_size);
  return sizes;
}

TrainResult TrainRaced(const std::string& method, TrainOptions options) {
  const Regression problem;
  options.initial_weights = problem.weights;
  options.shuffle = true;
  return Train(problem.model, {problem.train, problem.test}, method, options);
}

TEST(RacedTraining, AnyRuleTrainsWithARacedBatchSize) {
  for (const std::string rule : {"half_inverse:step_size=auto",
                                 "geodesic",
                                 "adam:step_size=1e-2",
                                 "gauss_newton:control=gain:step_size=auto",
                                 "krylov"}) {
    SCOPED_TRACE(rule);
    const TrainResult result =
        TrainRaced(rule + ":batch_size=auto", Epochs(60, 3));
    EXPECT_EQ(result.error, "");
    EXPECT_NE(result.summary.message.find("; batch size 3"), std::string::npos)
        << result.summary.message;
    EXPECT_LT(result.history.back().train_loss,
              0.5 * result.history.front().train_loss);
    EXPECT_NEAR(result.history.back().epoch, 60.0, 1.0);
    for (const double size : BatchSizes(result)) {
      EXPECT_GE(size, 3.0);
      EXPECT_LE(size, 24.0);
    }
  }
}

TEST(RacedTraining, AdaptiveRacesUnlessABatchSizeIsSet) {
  EXPECT_GT(BatchSizes(TrainRaced("adaptive", Epochs(60, 3))).size(), 1u);
  EXPECT_EQ(BatchSizes(TrainRaced("adaptive:batch_size=3", Epochs(60, 3))),
            std::set<double>{3.0});
  const TrainResult raced = TrainRaced("adaptive", Epochs(20, 3));
  const TrainResult spelled = TrainRaced(
      "geodesic:max_relative_step=0.1:batch_size=auto", Epochs(20, 3));
  ExpectSameRun(raced, spelled);
}

// A Jacobian of 128 samples would have 8,192 rows; 32 samples have 2,048.
TEST(RacedTraining, BeginsWithNoMoreRowsThanAFewTenthsOfASecondAllow) {
  const Model model(DenseNetwork({2, 32, 64}, Activation::kTanh),
                    std::make_shared<IdentitySimulator>(64),
                    std::make_shared<SquaredNormLoss>(64, 1.0),
                    Reduction::kMean);
  NumpyRandom random(5);
  DataSet data;
  data.inputs = random.Rand(2, 200);
  data.contexts.resize(0, 200);
  data.targets = random.Rand(64, 200);
  TrainOptions options = Epochs(1000, 128);
  options.max_num_steps = 1;
  const auto sizes = [&](const std::string& method) {
    return BatchSizes(Train(model, {data, data}, method, options));
  };
  EXPECT_EQ(sizes("adaptive"), std::set<double>{32});
  EXPECT_EQ(sizes("adaptive:batch_size=16"), std::set<double>{16});
  EXPECT_EQ(sizes("geodesic"), std::set<double>{128});
  EXPECT_EQ(sizes("adam:batch_size=auto"), std::set<double>{128});
}

// All samples in each step: nothing to race.
TEST(RacedTraining, AllSamplesInEachStepAreTheRuleAlone) {
  const TrainResult raced =
      TrainRaced("geodesic:batch_size=auto", Epochs(10, 0));
  ExpectSameRun(raced, TrainRaced("geodesic", Epochs(10, 0)));
  EXPECT_EQ(raced.summary.message,
            "epochs done; batch size 24, not raced: all samples are in each "
            "step");
}

TEST(RacedTraining, ReportsTheLowestTrainLossThatWasEvaluated) {
  const Regression problem;
  int num_kept = 0;
  for (const std::string method : {"adaptive", "adam:step_size=0.3"}) {
    TrainOptions options = Epochs(60, 3);
    Eigen::VectorXd reported;
    options.on_evaluation = [&](const Eigen::VectorXd& weights,
                                const std::vector<HistoryRow>& history) {
      const double loss = history.back().train_loss;
      EXPECT_EQ(MeanLoss(problem.model, weights, problem.train), loss);
      EXPECT_EQ(MeanLoss(problem.model, weights, problem.test),
                history.back().test_loss);
      if (history.size() > 1) {
        const double before = history[history.size() - 2].train_loss;
        EXPECT_LE(loss, before);
        EXPECT_EQ(loss == before, weights == reported);
        if (loss == before) ++num_kept;
      }
      reported = weights;
    };
    const TrainResult result = TrainRaced(method + ":batch_size=auto", options);
    EXPECT_EQ(result.weights, reported);
  }
  EXPECT_GT(num_kept, 5);
}

// A gradient step, which knows the number of outputs: 6 of 3 samples.
class StepForSamples : public UpdateRule {
 public:
  LinearizationParts Needs() const override {
    LinearizationParts parts = LinearizationParts::Jacobian();
    parts.gradient = true;
    return parts;
  }
};

// None for 3 samples.
class StillForThreeSamples final : public StepForSamples {
 public:
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* /*error*/) override {
    *step = -0.1 * at_x.gradient;
    if (at_x.loss_gradient.size() == 6) step->setZero();
    return true;
  }
};

// A slice with a lower loss counts when it has won, not before.
TEST(RacedTraining, EndsInARaceWithTheWeightsOfTheRunItself) {
  RegisterRule<StillForThreeSamples>("still_for_three_samples",
                                     "step = -gradient / 10, or 0");
  const Regression problem;
  int num_within = 0;
  for (long steps = 80; steps < 400; ++steps) {
    TrainOptions options = Epochs(1000000, 3);
    options.max_num_steps = steps;
    const TrainResult result =
        TrainRaced("still_for_three_samples:batch_size=auto", options);
    if (result.summary.message != "steps done; batch size 3") break;
    EXPECT_EQ(result.weights, problem.weights);
    if (result.history.back().batch_size > 3.0) ++num_within;
  }
  EXPECT_GT(num_within, 1);
}

// At every step, within races too.
TEST(RacedTraining, ResumesBitForBit) {
  for (const std::string& method :
       {std::string("adaptive"), std::string(kRaced)}) {
    TrainOptions options = Epochs(1000000, 3);
    options.max_num_steps = 500;
    const TrainResult whole = TrainRaced(method, options);
    ASSERT_NE(whole.summary.message.find("batch size 3, "), std::string::npos)
        << whole.summary.message;
    for (long stop = 5; stop < 500; stop += 37) {
      SCOPED_TRACE(stop);
      const TemporaryFolder folder;
      TrainOptions part = options;
      part.checkpoint_path = folder / "checkpoint";
      part.max_num_steps = stop;
      ASSERT_EQ(TrainRaced(method, part).error, "");
      part.max_num_steps = 500;
      const TrainResult resumed = TrainRaced(method, part);
      ASSERT_EQ(resumed.error, "");
      EXPECT_EQ(resumed.weights, whole.weights);
      EXPECT_EQ(resumed.summary.message, whole.summary.message);
    }
  }
}

// A gradient step; but the step `jump` of the process leads far away.
class Jumping final : public UpdateRule {
 public:
  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* /*error*/) override {
    *step = -0.01 * at_x.gradient;
    if (++num_steps == jump) step->setConstant(10.0);
    return true;
  }
  static long num_steps;
  static long jump;
};
long Jumping::num_steps = 0;
long Jumping::jump = 0;

TEST(RacedTraining, GoesBackToTheLowestLossFromFarAboveIt) {
  RegisterRule<Jumping>("jumping", "step = -gradient / 100, and one jump");
  TrainOptions options = Epochs(1000000, 3);
  options.max_num_steps = 600;
  const auto train = [&](long jump, const TrainOptions& with) {
    Jumping::jump = jump;
    return TrainRaced("jumping:batch_size=auto", with);
  };
  const auto went_back = [](const TrainResult& result) {
    return result.summary.message.find("went back 1 time") != std::string::npos;
  };
  Jumping::num_steps = 0;
  EXPECT_FALSE(went_back(train(0, options)));
  // Between races, and in the slices of several.
  int num_back = 0;
  for (long jump = 60; jump < 180; jump += 7) {
    SCOPED_TRACE(jump);
    Jumping::num_steps = 0;
    const TrainResult whole = train(jump, options);
    // Else the jump was a losing slice's, or gradients led back in time.
    if (went_back(whole)) {
      ++num_back;
      double before = 0.0;  // the jump
      for (const HistoryRow& row : whole.history) {
        if (row.step < jump) before = row.train_loss;
      }
      EXPECT_LT(whole.history.back().train_loss, before);
    }
    // Interrupted before it goes back.
    const TemporaryFolder folder;
    TrainOptions part = options;
    part.checkpoint_path = folder / "checkpoint";
    part.max_num_steps = jump;
    Jumping::num_steps = 0;
    train(jump, part);
    part.max_num_steps = options.max_num_steps;
    ExpectSameRun(train(jump, part), whole);
  }
  EXPECT_GT(num_back, 5);
}

// Only for 3 samples.
class ForThreeSamples final : public StepForSamples {
 public:
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) override {
    *error = "too many samples";
    *step = -0.01 * at_x.gradient;
    return at_x.loss_gradient.size() == 6;
  }
};

// Ends the run at a cost of zero.
class StopAtZero final : public ceres::IterationCallback {
 public:
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    return iteration.cost == 0.0 ? ceres::SOLVER_TERMINATE_SUCCESSFULLY
                                 : ceres::SOLVER_CONTINUE;
  }
};

TEST(RacedTraining, ASliceThatFailsLoses) {
  RegisterRule<ForThreeSamples>("for_three_samples", "step = -gradient / 100");
  StopAtZero callback;  // its failing step has the cost of the batch
  TrainOptions options = Epochs(100, 3);
  options.callbacks = {&callback};
  const TrainResult result =
      TrainRaced("for_three_samples:batch_size=auto", options);
  EXPECT_EQ(result.summary.message, "epochs done; batch size 3");
  EXPECT_LT(result.history.back().train_loss,
            result.history.front().train_loss);
  // Slices have run: the epochs count their samples.
  const TrainResult alone = TrainRaced("for_three_samples", Epochs(100, 3));
  EXPECT_LT(result.summary.num_steps, alone.summary.num_steps);
  EXPECT_NE(result.weights, alone.weights);
}

TEST(RacedTraining, IsAPhase) {
  const TrainResult result = TrainRaced(
      "adaptive:epochs=5>adam:step_size=1e-3:batch_size=8", Epochs(10, 3));
  EXPECT_EQ(result.error, "");
  EXPECT_NEAR(result.history.back().epoch, 10.0, 1.0);
  EXPECT_EQ(result.history.back().batch_size, 8.0);
}

TEST(RacedTraining, WhatTakesAllSamplesIsRefused) {
  const Regression problem;
  EXPECT_EQ(
      Refusal(problem, Epochs(1, 3), "ceres_lm:batch_size=auto"),
      "ceres_lm: batch_size=auto: a minimizer of Ceres takes all samples: "
      "leave it out");
  EXPECT_EQ(
      Refusal(problem, Epochs(1, 3), "adam:output_layer=exact:batch_size=auto"),
      "adam: batch_size=auto: the output layer is solved on all samples: leave "
      "it out");
  // A solved layer keeps the batch size of the run.
  EXPECT_EQ(BatchSizes(TrainRaced("adaptive:output_layer=exact", Epochs(5, 3))),
            std::set<double>{3.0});
}

}  // namespace batch_race_test
}  // namespace invgrad
