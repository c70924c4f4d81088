// A parabola to learn, and comparisons of training runs, for tests.
#ifndef INVGRAD_TESTS_TRAIN_PARABOLA_H_
#define INVGRAD_TESTS_TRAIN_PARABOLA_H_

#include <cmath>
#include <memory>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/random.h"
#include "invgrad/train.h"

namespace invgrad {

// y = a^2 to be learnt by 1-3-1 from 12 samples, without solutions.
struct Parabola {
  Model model;
  DataSet train;
  DataSet test;
  Eigen::VectorXd weights;

  explicit Parabola(int num_hidden = 3)
      : model(DenseNetwork({1, num_hidden, 1}, Activation::kTanh),
              std::make_shared<IdentitySimulator>(1),
              std::make_shared<SquaredNormLoss>(1, 1.0),
              Reduction::kMean) {
    NumpyRandom random(5);
    train.inputs = random.Rand(1, 12);
    train.contexts.resize(0, 12);
    train.targets = train.inputs.array().square();
    test = train.Range(0, 4);
    weights =
        model.network().InitialWeights(Initialization::kGlorotUniform, &random);
  }
};

inline TrainResult TrainBy(const std::string& method,
                           TrainOptions options,
                           const Parabola& problem,
                           const Eigen::VectorXd& weights) {
  options.initial_weights = weights;
  return Train(problem.model, {problem.train, problem.test}, method, options);
}

inline TrainResult TrainBy(const std::string& method,
                           const TrainOptions& options) {
  const Parabola problem;
  return TrainBy(method, options, problem, problem.weights);
}

inline bool IsSame(double a, double b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

// But for the seconds.
inline void ExpectSameRow(const HistoryRow& row, const HistoryRow& expected) {
  EXPECT_EQ(row.step, expected.step);
  EXPECT_EQ(row.epoch, expected.epoch);
  EXPECT_TRUE(IsSame(row.batch_loss, expected.batch_loss));
  EXPECT_EQ(row.train_loss, expected.train_loss);
  EXPECT_EQ(row.test_loss, expected.test_loss);
  EXPECT_TRUE(IsSame(row.step_norm, expected.step_norm));
  EXPECT_TRUE(IsSame(row.by_inverse, expected.by_inverse));
}

inline void ExpectSameRun(const TrainResult& result,
                          const TrainResult& expected) {
  ASSERT_EQ(result.error, "");
  EXPECT_EQ(result.weights, expected.weights);
  EXPECT_EQ(result.summary.num_steps, expected.summary.num_steps);
  ASSERT_EQ(result.history.size(), expected.history.size());
  for (size_t i = 0; i < expected.history.size(); ++i) {
    SCOPED_TRACE(i);
    ExpectSameRow(result.history[i], expected.history[i]);
  }
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_TRAIN_PARABOLA_H_
