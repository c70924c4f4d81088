// Steps of a rule over the batches of a problem, without a training loop.
#ifndef TESTS_SUPPORT_TAKE_STEPS_H_
#define TESTS_SUPPORT_TAKE_STEPS_H_

#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/rules.h"
#include "problems/problems.h"

namespace invgrad {

// The batches follow each other in the order of the samples, again and again.
inline void TakeSteps(const LearningProblem& problem,
                      const std::string& rule_name,
                      int batch_size,
                      int num_steps,
                      Eigen::VectorXd* weights) {
  const auto rule = MakeRule(rule_name);
  const int num_batches = problem.train.num_samples() / batch_size;
  std::string error;
  Eigen::VectorXd step;
  for (int k = 0; k < num_steps; ++k) {
    const auto batch =
        problem.train.Range(batch_size * (k % num_batches), batch_size);
    Linearization at;
    ASSERT_TRUE(
        problem.model->Linearize(*weights, batch, rule->Needs(), &at, &error))
        << error;
    ASSERT_TRUE(rule->ComputeStep(at, &step, &error)) << error;
    *weights += step;
  }
}

}  // namespace invgrad

#endif  // TESTS_SUPPORT_TAKE_STEPS_H_
