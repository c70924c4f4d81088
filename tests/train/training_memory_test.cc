#include "invgrad/train/training_memory.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <new>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/method.h"
#include "invgrad/rules.h"
#include "invgrad/train.h"
#include "tests/support/function_rule.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace training_memory_test {

Model MakeModel(std::vector<int> widths) {
  const int num_outputs = widths.back();
  return Model(DenseNetwork(std::move(widths), Activation::kTanh),
               std::make_shared<IdentitySimulator>(num_outputs),
               std::make_shared<SquaredNormLoss>(num_outputs, 0.5),
               Reduction::kMean);
}

DataSet MakeData(const Model& model, int num_samples) {
  DataSet data;
  data.inputs =
      Eigen::MatrixXd::Constant(model.network().num_inputs(), num_samples, 0.5);
  data.contexts.resize(0, num_samples);
  data.targets = Eigen::MatrixXd::Zero(model.loss().size(), num_samples);
  return data;
}

double BytesOf(const std::vector<MemoryPart>& parts, const std::string& name) {
  double bytes = 0.0;
  for (const MemoryPart& part : parts) {
    if (part.name == name) bytes += part.bytes;
  }
  return bytes;
}

// 2-5-3: n = 3 * 5 + 6 * 3 = 33 weights, m = 3 B.
TEST(TrainingMemory, CountsTheMatricesOfAStep) {
  const Model model = MakeModel({2, 5, 3});
  constexpr char kGram[] = "Gram matrix and its factorization";
  constexpr char kHessian[] = "Hessian and its factorization";
  const auto bytes =
      [&](const std::string& rule, const std::string& part, int batch_size) {
        return BytesOf(
            TrainingMemory(model, MakeRule(rule)->Needs(), false, batch_size),
            part);
      };
  EXPECT_EQ(bytes("newton", kHessian, 10), 4.0 * 8.0 * 33 * 33);
  EXPECT_EQ(bytes("ssbroyden", "matrices of the rule", 10), 8.0 * 33 * 33);
  // J^T J also where m < n.
  EXPECT_EQ(bytes("determined", kGram, 10), 2.0 * 8.0 * 33 * 33);
  EXPECT_EQ(bytes("determined", "matrices of the rule", 10),
            4.0 * 8.0 * 33 * 33);
  for (const char* rule : {"half_inverse", "geodesic"}) {
    EXPECT_EQ(bytes(rule, "factors of J", 10), 8.0 * 30 * 5) << rule;
    EXPECT_EQ(bytes(rule, kGram, 10), 2.0 * 8.0 * 30 * 30) << rule;
    EXPECT_EQ(bytes(rule, "J", 10), 0.0) << rule;
    EXPECT_EQ(bytes(rule, kGram, 12), 2.0 * 8.0 * 33 * 33) << rule;
    EXPECT_EQ(bytes(rule, "J", 12), 8.0 * 36 * 33) << rule;
  }
  for (const char* rule : {"adam", "gradient_descent"}) {
    EXPECT_EQ(bytes(rule, "derivatives of the samples", 10), 0.0) << rule;
    EXPECT_EQ(bytes(rule, "factors of J", 10), 0.0) << rule;
  }
  EXPECT_EQ(bytes("krylov", "factors of J", 10), 0.0);
  EXPECT_EQ(bytes("krylov", kGram, 10), 0.0);
}

TEST(TrainingMemory, GrowsWithTheSquareOfTheRowsForAGramMatrixAlone) {
  const Model model = MakeModel({100, 300, 10});
  const auto total = [&](const std::string& rule, int batch_size) {
    return TotalBytes(
        TrainingMemory(model, MakeRule(rule)->Needs(), false, batch_size));
  };
  EXPECT_NEAR(
      total("half_inverse", 2000) / total("half_inverse", 1000), 4.0, 0.6);
  EXPECT_LT(total("adam", 2000) / total("adam", 1000), 2.0);
  EXPECT_LT(total("krylov", 2000) / total("krylov", 1000), 2.1);
}

// Sizes whose products leave the range of int and of long.
TEST(TrainingMemory, HoldsForAnySize) {
  const Model model = MakeModel({1000, 2000, 1000});
  const int largest = std::numeric_limits<int>::max();
  for (const RuleRow& row : Rules()) {
    for (const bool through_pull_back : {false, true}) {
      for (const MemoryPart& part : TrainingMemory(model,
                                                   MakeRule(row.name)->Needs(),
                                                   through_pull_back,
                                                   largest)) {
        EXPECT_GE(part.bytes, 0.0) << row.name << ": " << part.name;
      }
    }
  }
  EXPECT_GT(TotalBytes(TrainingMemory(
                model, MakeRule("half_inverse")->Needs(), false, largest)),
            8e12);
}

// A run of the first batch size of `batch_size` or none.
std::string TrainError(const std::string& method,
                       int batch_size,
                       double memory_limit,
                       const std::string& checkpoint_path = "") {
  const Model model = MakeModel({20, 40, 10});
  const DataSet train = MakeData(model, 400);
  TrainOptions options;
  options.batch_size = batch_size;
  options.max_num_steps = 1;
  options.memory_limit = memory_limit;
  options.checkpoint_path = checkpoint_path;
  options.initial_weights =
      Eigen::VectorXd::Constant(model.num_weights(), 0.01);
  const TrainResult result = Train(model, train, method, options);
  EXPECT_EQ(result.history.empty(), !result.error.empty());
  return result.error;
}

TEST(TrainingFits, RefusesABatchBeforeTheFirstStep) {
  // The Gram matrix of 4000 rows takes 128 MB, that of n = 1250 12.5 MB.
  EXPECT_EQ(TrainError("half_inverse", 400, 200e6), "");
  const std::string error = TrainError("half_inverse:route=gram", 400, 20e6);
  EXPECT_EQ(error.rfind("batch_size=400 needs ", 0), 0u) << error;
  EXPECT_NE(error.find("(J 40 MB, Gram matrix and its factorization 25 MB, "),
            std::string::npos)
      << error;
  EXPECT_NE(error.find("; the limit is 20 MB"), std::string::npos) << error;
  // All samples are the same batch.
  EXPECT_EQ(TrainError("half_inverse:route=gram", 0, 20e6), error);
  // Smaller batches and first-order rules do fit.
  EXPECT_EQ(TrainError("half_inverse:route=gram", 40, 20e6), "");
  EXPECT_EQ(TrainError("adam", 400, 20e6), "");
  EXPECT_EQ(TrainError("adam", 400, 0.0), "");
}

// n^2 numbers take 12.5 MB, and as much in a checkpoint.
TEST(TrainingFits, CountsWhatARuleKeeps) {
  EXPECT_NE(TrainError("ssbroyden", 0, 10e6).find("matrices of the rule 12"),
            std::string::npos);
  EXPECT_EQ(TrainError("ssbroyden", 0, 20e6), "");
  const TemporaryFolder folder;
  EXPECT_NE(TrainError("ssbroyden", 0, 20e6, folder / "checkpoint")
                .find("checkpoint 12"),
            std::string::npos);
}

// A race of batch sizes keeps the rule's state five times.
TEST(TrainingFits, CountsTheStatesOfARace) {
  const std::string raced = "ssbroyden:batch_size=auto";
  EXPECT_NE(TrainError(raced, 40, 70e6).find("states of a race 62"),
            std::string::npos);
  EXPECT_EQ(TrainError(raced, 40, 100e6), "");
  const TemporaryFolder folder;
  EXPECT_NE(
      TrainError(raced, 40, 100e6, folder / "checkpoint").find("checkpoint 75"),
      std::string::npos);
  // All samples: there is no race.
  EXPECT_EQ(TrainError(raced, 0, 20e6), "");
}

TEST(TrainingFits, HoldsForPullBacksAndCeresToo) {
  for (const char* method : {"newton/adjoint/half_inverse",
                             "newton",
                             "ceres_lm",
                             "ceres_lm:linear_solver=cgnr"}) {
    const std::string error = TrainError(method, 400, 2e6);
    EXPECT_NE(error.find("; the limit is 2 MB"), std::string::npos)
        << method << ": " << error;
  }
  EXPECT_NE(TrainError("ceres_lbfgs", 400, 1e5).find("; the limit is 100 kB"),
            std::string::npos);
  EXPECT_EQ(TrainError("ceres_lbfgs", 400, 20e6), "");
}

// What no estimate foresees ends the run, and the message says what a step needs.
TEST(TrainingFits, AFailingAllocationEndsTheRun) {
  const Model model = MakeModel({20, 40, 10});
  const DataSet train = MakeData(model, 400);
  TrainOptions options;
  options.batch_size = 100;
  options.max_num_steps = 3;
  options.initial_weights =
      Eigen::VectorXd::Constant(model.num_weights(), 0.01);
  int num_steps = 0;
  const auto rule = std::make_shared<FunctionRule>(
      [&num_steps](const auto& at_x, auto* step, std::string*) {
        if (++num_steps == 2) throw std::bad_alloc();
        *step = -1e-3 * at_x.gradient;
        return true;
      });
  TrainingRun run(model, {train, DataSet()}, rule, options);
  ASSERT_EQ(run.error(), "");
  while (run.Step()) {
  }
  EXPECT_EQ(run.summary().termination_type, ceres::FAILURE);
  EXPECT_EQ(run.summary().message.rfind(
                "out of memory at step 2: batch_size=100 needs ", 0),
            0u)
      << run.summary().message;
  EXPECT_EQ(run.step(), 1);
}

}  // namespace training_memory_test
}  // namespace invgrad
