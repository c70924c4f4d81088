#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "Eigen/Core"
#include "fmt/core.h"
#include "gtest/gtest.h"
#include "invgrad/equation.h"
#include "invgrad/train.h"
#include "invgrad/train/batch_sequence.h"
#include "invgrad/train/checkpoint.h"
#include "tests/equations/decay.h"
#include "tests/support/random_matrix.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace renewed_points_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kNumPoints = 48;  // of the equation

MatrixXd PointsOf(const DataSet& samples) {
  // Of an equation of two coordinates and a coefficient: the last three rows
  // before c.
  return samples.contexts.middleRows(samples.contexts.rows() - 3, 2);
}

TrainingData RenewedData(const Equation& equation,
                         const RenewedPoints::Options& options) {
  DataSet samples;
  std::string error;
  EXPECT_TRUE(EquationSamples(equation, &samples, &error)) << error;
  return TrainingData(
      samples,
      DataSet(),
      std::make_shared<RenewedPoints>(equation, kDecayBox, options));
}

TEST(RenewedPoints, ContinueTheSequence) {
  const Equation decay = DecayEquation(1.0);
  const Model model = EquationModel(decay);
  const RenewedPoints points(decay, kDecayBox, {10, false});
  const VectorXd weights = RandomMatrix(model.num_weights(), 1, 1);
  const auto at = [&](long step) {
    return PointsOf(points.Batch(step, kNumPoints, model, weights));
  };
  EXPECT_EQ(points.steps_per_set(), 10);
  EXPECT_EQ(at(0), SequencePoints(kDecayBox, kNumPoints, 0).points);
  EXPECT_EQ(at(9), at(0));
  EXPECT_EQ(at(25),
            SequencePoints(kDecayBox, kNumPoints, 2L * kNumPoints).points);
}

struct StepResidual {
  template <typename T, typename C>
  bool operator()(const T* u, const C* c, T* y) const {
    y[0] = c[0] + 0.0 * u[0];
    return true;
  }
};

// A residual that is 9 times as large where t > 1/2 has (1 + 9 / 5) / (1 + 1 /
// 5) = 7/3 times as many points there.
TEST(RenewedPoints, FollowTheResidual) {
  Equation step = DecayEquation(1.0);
  step.terms[0].residual =
      std::make_shared<AutoDiffSimulator<StepResidual, 3, 1, 1>>();
  step.terms[0].points = SequencePoints(kDecayBox, 1000, 0);
  step.terms[0].context = [](const VectorXd& point, Eigen::Index, auto c) {
    c[0] = point[0] > 0.5 ? 9.0 : 1.0;
  };
  const Model model = EquationModel(step);
  const RenewedPoints points(step, kDecayBox, {10, true});
  const DataSet samples =
      points.Batch(0, 1000, model, VectorXd::Zero(model.num_weights()));
  // The context ends with c.
  const auto late = (samples.contexts.bottomRows(1).array() == 9.0).count();
  EXPECT_NEAR(static_cast<double>(late), 700.0, 10.0);
}

TEST(RenewedPoints, RefuseSmallBatches) {
  const Equation decay = DecayEquation(1.0);
  const TrainingData data = RenewedData(decay, {10, false});
  TrainOptions options;
  options.batch_size = 16;
  EXPECT_EQ(Train(EquationModel(decay), data, "adam", options).error,
            "batch_size=16 is not allowed with points in [0, -1] to [1, 1], "
            "renewed every 10 steps: take 0, all 48 samples");
}

// With a finite distance only at t <= 1/2, where the first points are.
Equation DecayWithoutDistance() {
  Equation decay = DecayEquation(1.0);
  decay.trial.distance = [](const InputJet* a, InputJet* d) {
    d[0] = a[0].value() <= 0.5 ? a[0] : InputJet(INFINITY);
  };
  decay.terms[0].points = GaussPoints(
      {Eigen::Vector2d(0.0, -1.0), Eigen::Vector2d(0.5, 1.0)}, {6, 8});
  return decay;
}

TEST(RenewedPoints, ABatchThatCannotBeMadeHasItsSizes) {
  const Equation decay = DecayWithoutDistance();
  const Model model = EquationModel(decay);
  const RenewedPoints points(decay, kDecayBox, {10, false});
  const DataSet samples =
      points.Batch(0, kNumPoints, model, VectorXd::Zero(model.num_weights()));
  EXPECT_EQ(samples.inputs.rows(), model.num_inputs());
  EXPECT_EQ(samples.inputs.cols(), kNumPoints);
  EXPECT_TRUE(samples.inputs.array().isNaN().all());
  EXPECT_EQ(samples.contexts.cols(), kNumPoints);
  EXPECT_TRUE(samples.contexts.isZero(0.0));
  EXPECT_EQ(samples.targets.cols(), kNumPoints);
}

TEST(RenewedPoints, PointsWithoutAFiniteDistanceEndTheRun) {
  const Equation decay = DecayWithoutDistance();
  for (const bool by_residual : {false, true}) {
    // geodesic leaves a batch out before it gives up.
    for (const auto& [rule, step] : {std::pair("adam", 1), {"geodesic", 2}}) {
      const TrainingData data = RenewedData(decay, {10, by_residual});
      TrainOptions options;
      options.batch_size = 0;
      options.max_num_steps = 3;
      const TrainResult result =
          Train(EquationModel(decay), data, rule, options);
      EXPECT_EQ(result.error, "");
      EXPECT_EQ(result.summary.termination_type, ceres::FAILURE) << rule;
      EXPECT_EQ(result.summary.message.rfind(
                    fmt::format("diverged at step {}: ", step), 0),
                0u)
          << result.summary.message;
    }
  }
}

// A step may be repeated, from other weights, after the run has gone back.
TEST(RenewedPoints, ARepeatedStepHasTheSamePointsAlsoAfterResuming) {
  const Equation decay = DecayEquation(1.0);
  const Model model = EquationModel(decay);
  const TrainingData data = RenewedData(decay, {10, true});
  const VectorXd first = VectorXd::Constant(model.num_weights(), 0.1);
  const VectorXd second = VectorXd::LinSpaced(model.num_weights(), -1.0, 2.0);
  BatchSequence sequence({}, &model, &data);
  const Eigen::MatrixXd points = sequence.Next(10, kNumPoints, first).inputs;
  EXPECT_EQ(sequence.Next(10, kNumPoints, second).inputs, points);
  EXPECT_NE(
      BatchSequence({}, &model, &data).Next(10, kNumPoints, second).inputs,
      points);
  const TemporaryFolder folder;
  const std::string path = folder / "checkpoint";
  StateArchive written;
  sequence.VisitState(11, &written);
  std::string error;
  ASSERT_TRUE(written.Write(path, RunIdentity(), &error)) << error;
  StateArchive read = StateArchive::Read(path, RunIdentity());
  BatchSequence resumed({}, &model, &data);
  resumed.VisitState(11, &read);
  EXPECT_EQ(read.error(), "");
  EXPECT_EQ(resumed.Next(11, kNumPoints, second).inputs, points);
}

// Also in the middle of a set, whose points depend on earlier weights.
TEST(RenewedPoints, AResumedRunHasTheSameBits) {
  const Equation decay = DecayEquation(1.0);
  const Model model = EquationModel(decay);
  const TrainingData data = RenewedData(decay, {10, true});
  const TemporaryFolder folder;
  TrainOptions options;
  options.batch_size = 0;
  options.max_num_steps = 35;
  const VectorXd whole = Train(model, data, "geodesic", options).weights;
  options.checkpoint_path = folder / "checkpoint";
  options.max_num_steps = 17;
  Train(model, data, "geodesic", options);
  options.max_num_steps = 35;
  const TrainResult resumed = Train(model, data, "geodesic", options);
  EXPECT_EQ(resumed.error, "");
  EXPECT_EQ(resumed.weights, whole);
}

}  // namespace renewed_points_test
}  // namespace invgrad
