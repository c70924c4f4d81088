#include "invgrad/train/training_memory.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/methods/method.h"
#include "invgrad/rules/rules.h"
#include "invgrad/spectral/spectral_step.h"
#include "invgrad/train/train.h"

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

// 2-5-3: 3 * 5 + 6 * 3 = 33 weights, m = 3 B.
TEST(TrainingMemory, CountsTheMatricesOfAStep) {
  const Model model = MakeModel({2, 5, 3});
  const int batch_size = 10;
  const auto parts = [&](const std::string& rule) {
    return TrainingMemory(model, *MakeRule(rule), false, batch_size);
  };
  EXPECT_EQ(BytesOf(parts("newton"), "Hessian"), 8.0 * 33 * 33);
  EXPECT_EQ(BytesOf(parts("newton"), "factorization of the Hessian"),
            3.0 * 8.0 * 33 * 33);
  EXPECT_EQ(BytesOf(parts("half_inverse"), "factors of J"), 8.0 * 30 * 5);
  EXPECT_EQ(BytesOf(parts("half_inverse"), "at least route gram"),
            SpectralStepBytes(SpectralRoute::kGram, 30, 33));
  EXPECT_EQ(BytesOf(TrainingMemory(model, *MakeRule("half_inverse"), false, 12),
                    "at least route gram"),
            SpectralStepBytes(SpectralRoute::kGram, 36, 33));
  // Of the layer with 18 weights the Gram matrix is larger.
  EXPECT_EQ(BytesOf(parts("layer_half_inverse"), "at least route gram"),
            SpectralStepBytes(SpectralRoute::kGram, 30, 18));
  for (const char* rule : {"adam", "gradient_descent"}) {
    EXPECT_EQ(BytesOf(parts(rule), "Jacobians of the simulator"), 0.0) << rule;
    EXPECT_EQ(BytesOf(parts(rule), "factors of J"), 0.0) << rule;
  }
  EXPECT_EQ(BytesOf(parts("krylov"), "factors of J"), 0.0);
}

TEST(TrainingMemory, GrowsWithTheSquareOfTheRowsForAGramMatrixAlone) {
  const Model model = MakeModel({100, 300, 10});
  const auto total = [&](const std::string& rule, int batch_size) {
    return TotalBytes(
        TrainingMemory(model, *MakeRule(rule), false, batch_size));
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
      for (const MemoryPart& part : TrainingMemory(
               model, *MakeRule(row.name), through_pull_back, largest)) {
        EXPECT_GE(part.bytes, 0.0) << row.name << ": " << part.name;
      }
    }
  }
  EXPECT_GT(TotalBytes(TrainingMemory(
                model, *MakeRule("half_inverse"), false, largest)),
            8e12);
}

// A run of the first batch size of `batch_size` or none.
std::string TrainError(const std::string& method,
                       int batch_size,
                       double memory_limit) {
  const Model model = MakeModel({20, 40, 10});
  const DataSet train = MakeData(model, 400);
  TrainOptions options;
  options.batch_size = batch_size;
  options.max_num_steps = 1;
  options.memory_limit = memory_limit;
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
  EXPECT_NE(error.find("(route gram "), std::string::npos) << error;
  EXPECT_NE(error.find("; the limit is 20 MB"), std::string::npos) << error;
  // All samples are the same batch.
  EXPECT_EQ(TrainError("half_inverse:route=gram", 0, 20e6), error);
  // Smaller batches and first-order rules do fit.
  EXPECT_EQ(TrainError("half_inverse:route=gram", 40, 20e6), "");
  EXPECT_EQ(TrainError("adam", 400, 20e6), "");
  EXPECT_EQ(TrainError("adam", 400, 0.0), "");
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

}  // namespace training_memory_test
}  // namespace invgrad
