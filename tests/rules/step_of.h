// The step of a rule, for tests.
#ifndef INVGRAD_TESTS_RULES_STEP_OF_H_
#define INVGRAD_TESTS_RULES_STEP_OF_H_

#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/rules.h"

namespace invgrad {

inline Eigen::VectorXd StepOf(UpdateRule* rule, const Linearization& at_x) {
  Eigen::VectorXd step;
  std::string error;
  EXPECT_TRUE(rule->ComputeStep(at_x, &step, &error)) << error;
  if (at_x.jacobian != nullptr) {
    EXPECT_EQ(step.size(), at_x.jacobian->cols());
  }
  return step;
}

inline Eigen::VectorXd StepOf(const std::string& text,
                              const Linearization& at_x) {
  return StepOf(MakeRule(text).get(), at_x);
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_RULES_STEP_OF_H_
