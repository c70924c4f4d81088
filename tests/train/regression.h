// A small regression and its training runs, for tests.
#ifndef INVGRAD_TESTS_TRAIN_REGRESSION_H_
#define INVGRAD_TESTS_TRAIN_REGRESSION_H_

#include <memory>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/random.h"
#include "invgrad/train.h"

namespace invgrad {

// A regression of y = (a0 a1, a0 - a1) that trains in milliseconds.
struct Regression {
  Model model;
  DataSet train;
  DataSet test;
  Eigen::VectorXd weights;

  explicit Regression(Reduction reduction = Reduction::kMean)
      : model(DenseNetwork({2, 5, 2}, Activation::kTanh),
              std::make_shared<IdentitySimulator>(2),
              std::make_shared<SquaredNormLoss>(2, 1.0),
              reduction) {
    NumpyRandom random(3);
    train = MakeData(24, &random);
    test = MakeData(10, &random);
    weights =
        model.network().InitialWeights(Initialization::kGlorotUniform, &random);
  }

  static DataSet MakeData(int num_samples, NumpyRandom* random) {
    DataSet data;
    data.inputs = random->Rand(2, num_samples);
    data.contexts.resize(0, num_samples);
    data.targets.resize(2, num_samples);
    data.targets.row(0) = data.inputs.row(0).cwiseProduct(data.inputs.row(1));
    data.targets.row(1) = data.inputs.row(0) - data.inputs.row(1);
    return data;
  }
};

// The caller keeps the rule.
inline std::shared_ptr<UpdateRule> Borrowed(UpdateRule* rule) {
  return {std::shared_ptr<void>(), rule};
}

inline TrainResult TrainRegression(const Regression& problem,
                                   TrainOptions options,
                                   UpdateRule* rule) {
  options.initial_weights = problem.weights;
  TrainResult result = Train(
      problem.model, {problem.train, problem.test}, Borrowed(rule), options);
  EXPECT_EQ(result.error, "");
  return result;
}

// Why the run is refused.
inline std::string Refusal(const Regression& problem,
                           TrainOptions options,
                           const std::string& method) {
  options.initial_weights = problem.weights;
  const TrainResult result =
      Train(problem.model, {problem.train, problem.test}, method, options);
  EXPECT_NE(result.error, "");
  EXPECT_EQ(result.weights, problem.weights);
  EXPECT_TRUE(result.history.empty());
  return result.error;
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_TRAIN_REGRESSION_H_
