// Training on the ranks against training in one process.

#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/distributed/distributed_jacobian.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/methods/pull_back_method.h"
#include "invgrad/rules.h"
#include "invgrad/stored_jacobian.h"
#include "invgrad/train.h"
#include "problems/problems.h"
#include "tests/distributed/ranks.h"
#include "tests/support/random_matrix.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace distributed_training_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Case {
  std::string problem;
  std::string method;
  int batch_size = 13;  // divides by no number of ranks but one
  int num_steps = 4;
};

LearningProblem MakeProblem(const std::string& specification) {
  PhysicsProblem problem;
  std::string error;
  EXPECT_TRUE(CreateProblem(specification, nullptr, &problem, &error)) << error;
  return *problem.learning;
}

struct Losses {
  std::string error;
  std::vector<double> batch_losses;
  VectorXd weights;
  History history;
  std::string message;
};

Losses Train(const LearningProblem& problem,
             const Case& of,
             const std::shared_ptr<const Communicator>& ranks) {
  TrainOptions options;
  options.batch_size = of.batch_size;
  options.max_num_steps = of.num_steps;
  options.seed = 1;
  options.inverse = problem.inverse;
  options.communicator = ranks;
  TrainingRun run(*problem.model,
                  {problem.train, problem.test, problem.source},
                  of.method,
                  options);
  Losses losses;
  while (run.Step()) losses.batch_losses.push_back(run.loss());
  losses.error = run.error();
  losses.weights = run.weights();
  losses.history = run.history();
  losses.message = run.summary().message;
  return losses;
}

constexpr double kTolerance = 1e-10;

void ExpectSameTraining(const Case& of, double tolerance = kTolerance) {
  SCOPED_TRACE(of.problem + " " + of.method);
  const LearningProblem problem = MakeProblem(of.problem);
  const Losses alone = Train(problem, of, nullptr);
  const Losses together = Train(problem, of, Ranks());
  const Losses again = Train(problem, of, Ranks());
  ASSERT_EQ(alone.error, "");
  ASSERT_EQ(together.error, "");
  EXPECT_EQ(together.message, alone.message);
  ASSERT_EQ(together.batch_losses.size(), alone.batch_losses.size());
  ASSERT_FALSE(alone.batch_losses.empty());
  for (std::size_t k = 0; k < alone.batch_losses.size(); ++k) {
    const double loss = alone.batch_losses[k];
    EXPECT_NEAR(together.batch_losses[k], loss, tolerance * std::abs(loss))
        << "step " << k;
  }
  EXPECT_NEAR(together.history.back().test_loss,
              alone.history.back().test_loss,
              tolerance * std::abs(alone.history.back().test_loss));
  // Bit for bit, in every run and on every rank.
  EXPECT_EQ(together.weights, again.weights);
  VectorXd of_first = together.weights;
  Ranks()->Broadcast(0, of_first.data(), of_first.size());
  EXPECT_EQ(together.weights, of_first);
  if (Ranks()->size() == 1) {
    EXPECT_EQ(together.weights, alone.weights);
  }
}

// Each rank counts those of its samples.
TEST(TrainingCalls, AreThoseOfAllRanks) {
  const LearningProblem problem = MakeProblem("regression_1d:num_samples=40");
  for (const std::string method :
       {"gradient_descent:step_size=1e-3", "half_inverse"}) {
    const Case of = {"regression_1d", method};
    const History alone = Train(problem, of, nullptr).history;
    const History together = Train(problem, of, Ranks()).history;
    ASSERT_EQ(together.size(), alone.size());
    for (std::size_t i = 0; i < alone.size(); ++i) {
      EXPECT_EQ(together[i].simulator_calls, alone[i].simulator_calls) << i;
    }
    EXPECT_GE(alone.back().simulator_calls, 2.0 * of.batch_size * of.num_steps);
  }
}

class EveryRule : public testing::TestWithParam<std::string> {};

TEST_P(EveryRule, TrainsAsInOneProcess) {
  // A network of some hundred weights, because newton has a dense Hessian.
  // Products with the Hessian by differences of gradients lose half of the
  // digits; a nearly singular Hessian or factor of a layer loses some.
  double tolerance = kTolerance;
  for (const auto& [rule, of_rule] : {std::pair("hessian_free", 1e-6),
                                      std::pair("saddle_free_newton", 1e-8),
                                      std::pair("kfac_half_inverse", 1e-8)}) {
    if (GetParam().rfind(rule, 0) == 0) tolerance = of_rule;
  }
  ExpectSameTraining({"regression_1d:num_samples=40", GetParam()}, tolerance);
}

// Every rule with settings that do not amplify rounding errors: short steps, and
// no small singular values.
std::vector<std::string> WellConditionedRules() {
  const Settings settings = {{"step_size", "1e-3"},
                             {"truncation", "1e-2"},
                             {"damping", "1"},
                             {"iterations", "5"}};
  std::vector<std::string> rules;
  for (const RuleRow& row : Rules()) {
    std::string& rule = rules.emplace_back(row.name);
    for (const OptionSet::Row& option : row.options()) {
      for (const auto& [name, value] : settings) {
        if (option.name == name) rule += ":" + name + "=" + value;
      }
    }
  }
  return rules;
}

INSTANTIATE_TEST_SUITE_P(Distributed,
                         EveryRule,
                         testing::ValuesIn(WellConditionedRules()),
                         [](const auto& info) {
                           return info.param.substr(0, info.param.find(':'));
                         });

TEST(DistributedTraining, PullsBackAsInOneProcess) {
  const std::string chain = "oscillator_chain:num_samples=80";
  ExpectSameTraining({chain, "sip:step_size=1e-3"});
  ExpectSameTraining({chain, "newton/inverse/half_inverse:truncation=1e-3"});
  ExpectSameTraining({chain, "sip:proxy=l1:curvature_weight=0.5"});
  ExpectSameTraining({chain, "newton/inverse_gradient/adam:updates=3"});
  ExpectSameTraining({chain, "newton/joint/half_inverse:truncation=1e-3"});
  ExpectSameTraining({"multimodal:num_samples=60:wrong_inverse=true",
                      "newton/inverse/adam:step_size=1e-3"});
}

// Infidelity has a Hessian of its own; roll-outs call the network at every step;
// a differential equation takes jets.
TEST(DistributedTraining, OtherChainsTrainAsInOneProcess) {
  ExpectSameTraining({"quantum_dipole:num_samples=40:num_steps=8",
                      "half_inverse:truncation=1e-3"});
  ExpectSameTraining({"quantum_dipole:num_samples=40:num_steps=8",
                      "krylov:step_size=1e-2:iterations=5"});
  // Steps by the loss on the great circles of the states; short ones, because
  // long ones amplify rounding errors.
  ExpectSameTraining({"quantum_dipole:num_samples=40:num_steps=8",
                      "half_inverse:step_size=auto:rho=0.01:truncation=1e-2"});
  ExpectSameTraining(
      {"quantum_dipole:num_samples=40:num_steps=8",
       "power:step_size=auto:control=gain:rho=0.01:truncation=1e-2"});
  ExpectSameTraining(
      {"oscillator_tracking:num_samples=40", "half_inverse:truncation=1e-3"});
  ExpectSameTraining({"poisson_pinn", "half_inverse:truncation=1e-3", 64});
}

// A race of batch sizes, which all ranks decide in the same way.
TEST(DistributedTraining, RacesBatchSizesAsInOneProcess) {
  const std::string method =
      "half_inverse:step_size=0.1:truncation=1e-2:batch_size=auto";
  ExpectSameTraining(
      {"regression_1d:num_samples=400", method, /*batch_size=*/7, /*steps=*/60},
      1e-8);
}

// Batches whose Gram matrix the ranks share (spectral/routes/gram_route.cc).
TEST(DistributedTraining, SharesLargeGramMatrices) {
  // J J^T with m = 1012; J^T J with n = 1444, m = 1924.
  for (const int batch_size : {253, 481}) {
    ExpectSameTraining({"oscillator_chain:num_samples=1200",
                        "half_inverse:truncation=1e-2",
                        batch_size,
                        /*steps=*/1});
  }
}

TEST(DistributedJacobian, StripsAreThoseOfTheGramMatrices) {
  constexpr int kNumSamples = 101, kRowsPerSample = 5, kCols = 700;
  constexpr int kRows = kNumSamples * kRowsPerSample;
  const MatrixXd J = RandomMatrix(kRows, kCols, 1);
  const Share share = Ranks()->OwnShare(kNumSamples);
  const DistributedJacobian distributed(
      std::make_shared<DenseJacobian>(MatrixXd(J.middleRows(
          kRowsPerSample * share.first, kRowsPerSample * share.count))),
      Ranks(),
      kNumSamples);
  const auto expect_columns = [](const MatrixXd& gram,
                                 const ColumnStrips& strips,
                                 const MatrixXd& own) {
    ASSERT_EQ(own.rows(), gram.rows());
    ASSERT_EQ(own.cols(), strips.num_local());
    for (int j = 0; j < gram.cols(); ++j) {
      if (!strips.Owns(j)) continue;
      const int below = static_cast<int>(gram.rows()) - j;
      EXPECT_LE((own.col(strips.Local(j)) - gram.col(j)).tail(below).norm(),
                1e-13 * gram.norm());
    }
  };
  MatrixXd own;
  const ColumnStrips of_rows(kRows, Ranks().get());
  distributed.GramStrips(of_rows, &own);
  expect_columns(J * J.transpose(), of_rows, own);
  const ColumnStrips of_columns(kCols, Ranks().get());
  distributed.ParameterGramStrips(of_columns, &own);
  expect_columns(J.transpose() * J, of_columns, own);
}

// The numbers that a step sends, with batches of this size.
double NumSent(const LearningProblem& problem,
               const std::string& method,
               int batch_size) {
  TrainOptions options;
  options.batch_size = batch_size;  // evaluations are at other steps
  options.max_num_steps = 3;
  options.communicator = Ranks();
  TrainingRun run(*problem.model, {problem.train}, method, options);
  run.Step();
  const double before = Ranks()->num_sent();
  run.Step();
  EXPECT_EQ(run.error(), "");
  return Ranks()->num_sent() - before;
}

// What docs/results/speed.md counts.
TEST(DistributedTraining, AFirstOrderStepSendsItsGradient) {
  const LearningProblem problem =
      MakeProblem("oscillator_chain:num_samples=80");
  // Cost and gradient; that no rank has failed; the clock, whether a checkpoint
  // is due, the calls of the simulator, and what callbacks say.
  const double num_sums = 1.0 + problem.model->num_weights() + 1.0 + 5.0;
  EXPECT_EQ(NumSent(problem, "adam", 8),
            Ranks()->size() == 1 ? 0.0 : 2.0 * num_sums);
}

// Of the samples, rows of g, J d and H_L J d travel, not the layers' factors.
TEST(DistributedTraining, KfacSendsSumsOverTheSamples) {
  const LearningProblem problem =
      MakeProblem("oscillator_chain:num_samples=80");
  constexpr int kNumRowsOfASample = 4;
  const int size = Ranks()->size();
  for (const std::string method : {"kfac", "kfac_half_inverse"}) {
    SCOPED_TRACE(method);
    const double of_more =
        NumSent(problem, method, 4 * size) - NumSent(problem, method, 2 * size);
    const double num_vectors = method == "kfac" ? 3.0 : 1.0;
    EXPECT_EQ(of_more, num_vectors * 2 * kNumRowsOfASample * (size - 1));
  }
}

// The clocks of the ranks differ: here the checkpoints are due on one rank alone.
// After one, K-FAC decomposes its factors again, which all ranks share.
TEST(DistributedTraining, AllRanksMakeACheckpointOrNone) {
  const LearningProblem problem =
      MakeProblem("oscillator_chain:num_samples=80");
  TrainOptions options;
  options.batch_size = 13;
  options.max_num_steps = 12;
  options.communicator = Ranks();
  const auto train = [&] {
    return invgrad::Train(
        *problem.model, problem.train, "kfac:interval=5", options);
  };
  const VectorXd expected = train().weights;
  for (const int rank : {0, Ranks()->size() - 1}) {
    const TemporaryFolder folder;
    options.checkpoint_path = folder / "checkpoint";
    options.checkpoint_interval_in_seconds =
        Ranks()->rank() == rank ? 0.0 : 1e9;
    const TrainResult result = train();
    EXPECT_EQ(result.error, "");
    EXPECT_LE((result.weights - expected).norm(), 1e-9 * expected.norm());
  }
}

TEST(DistributedTraining, PhasesFollowEachOther) {
  ExpectSameTraining({"oscillator_chain:num_samples=80",
                      "adam:steps=2>half_inverse:truncation=1e-3"});
}

TEST(DistributedTraining, RefusesMoreRanksThanSamples) {
  if (Ranks()->size() == 1) GTEST_SKIP() << "one rank";
  const Losses losses = Train(MakeProblem("oscillator_chain:num_samples=80"),
                              {"", "adam", Ranks()->size() - 1},
                              Ranks());
  EXPECT_EQ(losses.error,
            "batch_size=" + std::to_string(Ranks()->size() - 1) +
                " is less than the " + std::to_string(Ranks()->size()) +
                " ranks, of which each has at least one sample: choose a "
                "larger batch or fewer ranks");
}

TEST(DistributedTraining, RefusesMinimizersOfCeres) {
  if (Ranks()->size() == 1) GTEST_SKIP() << "one rank";
  const Losses losses = Train(MakeProblem("oscillator_chain:num_samples=80"),
                              {"", "ceres_lm"},
                              Ranks());
  EXPECT_NE(losses.error.find("a minimizer of Ceres works in one process"),
            std::string::npos)
      << losses.error;
}

TEST(DistributedTraining, RefusesRanksOfOtherRuns) {
  if (Ranks()->size() == 1) GTEST_SKIP() << "one rank";
  LearningProblem problem = MakeProblem("oscillator_chain:num_samples=80");
  if (Ranks()->rank() == 1) problem.train.targets(0, 0) += 1e-12;
  const Losses losses = Train(problem, {"", "adam"}, Ranks());
  EXPECT_EQ(
      losses.error.rfind("rank 1 differs from rank 0: training data: ", 0), 0u)
      << losses.error;
}

// Each rank has a folder of its own, and only rank 0 writes.
TEST(DistributedTraining, RefusesACheckpointThatNotAllRanksHave) {
  if (Ranks()->size() == 1) GTEST_SKIP() << "one rank";
  const LearningProblem problem =
      MakeProblem("oscillator_chain:num_samples=80");
  const TemporaryFolder folder;
  TrainOptions options;
  options.batch_size = 13;
  options.max_num_steps = 3;
  options.communicator = Ranks();
  options.checkpoint_path = folder / "checkpoint";
  const auto train = [&] {
    return invgrad::Train(
        *problem.model, {problem.train, problem.test}, "adam", options);
  };
  EXPECT_EQ(train().error, "");
  options.max_num_steps = 5;
  const TrainResult result = train();
  EXPECT_NE(result.error.find("begins afresh, rank 0 at step 3"),
            std::string::npos)
      << result.error;
}

// A simulator of one rank's samples fails: the message names the sample of the
// whole batch, as in one process.
TEST(DistributedTraining, NamesTheSampleThatFails) {
  LearningProblem problem = MakeProblem("exponential:num_samples=200");
  // exp overflows for one sample, by an input that moves x.
  problem.train.inputs(0, 12) = 1e300;
  const Case of{"", "gradient_descent:step_size=1e-3"};
  const Losses alone = Train(problem, of, nullptr);
  const Losses together = Train(problem, of, Ranks());
  EXPECT_EQ(together.error, alone.error);
  EXPECT_EQ(together.message, alone.message);
}

// Of a run on the ranks, by one process, and the other way round.
TEST(DistributedTraining, ResumesWithAnotherNumberOfRanks) {
  const LearningProblem problem =
      MakeProblem("oscillator_chain:num_samples=80");
  for (const std::string method :
       {"adam", "half_inverse:truncation=1e-3", "kfac"}) {
    SCOPED_TRACE(method);
    const auto train = [&](int num_steps,
                           const std::string& checkpoint,
                           const std::shared_ptr<const Communicator>& ranks) {
      TrainOptions options;
      options.batch_size = 13;
      options.max_num_steps = num_steps;
      options.communicator = ranks;
      options.checkpoint_path = checkpoint;
      const TrainResult result =
          Train(*problem.model, {problem.train, problem.test}, method, options);
      EXPECT_EQ(result.error, "");
      EXPECT_EQ(result.summary.num_steps, num_steps);
      return result.weights;
    };
    const std::string path =
        (std::filesystem::temp_directory_path() /
         ("invgrad_ranks_" + std::to_string(Ranks()->size()) + "_" + method))
            .string();
    const std::string own = path + "_" + std::to_string(Ranks()->rank());
    for (const std::string& file : {path, own}) std::filesystem::remove(file);
    const VectorXd whole = train(8, "", nullptr);
    double zero = 0.0;
    Ranks()->Sum(&zero, 1);  // all files are removed
    train(5, path, Ranks());
    Ranks()->Sum(&zero, 1);  // the checkpoint is written
    std::filesystem::copy_file(path, own);
    const VectorXd resumed_alone = train(8, own, nullptr);
    const VectorXd resumed_together = train(8, path, Ranks());
    EXPECT_LE((resumed_alone - whole).norm(), kTolerance * whole.norm());
    EXPECT_LE((resumed_together - whole).norm(), kTolerance * whole.norm());
    Ranks()->Sum(&zero, 1);
    for (const std::string& file : {path, own}) std::filesystem::remove(file);
  }
}

}  // namespace distributed_training_test
}  // namespace invgrad
