// Trains a problem by a method from the initial weights of seed 1, for tests.
#ifndef INVGRAD_TESTS_SUPPORT_TRAIN_PROBLEM_H_
#define INVGRAD_TESTS_SUPPORT_TRAIN_PROBLEM_H_

#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/compare/problem.h"
#include "invgrad/random.h"
#include "invgrad/train.h"

namespace invgrad {

inline Eigen::VectorXd InitialWeights(const LearningProblem& problem,
                                      std::uint32_t seed = 1) {
  NumpyRandom random(seed);
  return problem.model->network().InitialWeights(problem.initialization,
                                                 &random);
}

// With the initial weights of the options, if they have some.
inline TrainResult TrainProblem(const LearningProblem& problem,
                                const std::string& method,
                                TrainOptions options) {
  if (options.initial_weights.size() == 0) {
    options.initial_weights = InitialWeights(problem);
  }
  options.inverse = problem.inverse;
  TrainResult result = Train(*problem.model,
                             {problem.train, problem.test, problem.source},
                             method,
                             options);
  EXPECT_EQ(result.error, "");
  return result;
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SUPPORT_TRAIN_PROBLEM_H_
