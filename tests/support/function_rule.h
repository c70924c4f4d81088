// A rule made of a function of the linearization, for tests.
#ifndef INVGRAD_TESTS_SUPPORT_FUNCTION_RULE_H_
#define INVGRAD_TESTS_SUPPORT_FUNCTION_RULE_H_

#include <functional>
#include <string>
#include <utility>

#include "Eigen/Core"
#include "invgrad/update_rule.h"

namespace invgrad {

class FunctionRule final : public UpdateRule {
 public:
  using Function = std::function<bool(
      const Linearization& at_x, Eigen::VectorXd* step, std::string* error)>;
  // Needs the gradient.
  explicit FunctionRule(Function function)
      : FunctionRule(LinearizationParts::Gradient(), std::move(function)) {}
  FunctionRule(LinearizationParts needs, Function function)
      : needs_(needs), function_(std::move(function)) {}
  LinearizationParts Needs() const override { return needs_; }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) override {
    return function_(at_x, step, error);
  }

 private:
  LinearizationParts needs_;
  Function function_;
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SUPPORT_FUNCTION_RULE_H_
