// A learning problem by its specification, for tests.
#ifndef TESTS_CREATE_PROBLEM_H_
#define TESTS_CREATE_PROBLEM_H_

#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "problems/problems.h"

namespace invgrad {

inline LearningProblem CreateLearningProblem(
    const std::string& specification, const Eigen::MatrixXd* data = nullptr) {
  PhysicsProblem problem;
  std::string error;
  EXPECT_TRUE(CreateProblem(specification, data, &problem, &error)) << error;
  return problem.learning.value();
}

}  // namespace invgrad

#endif  // TESTS_CREATE_PROBLEM_H_
