// The name `chordal` among the rules of `estimate`: ceres_lm+chordal starts from
// the poses of chordal relaxation (problems/estimation/chordal_relaxation.h) if
// they cost less than the start. It takes no steps.
#ifndef BIN_ESTIMATE_CHORDAL_RULE_H_
#define BIN_ESTIMATE_CHORDAL_RULE_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/linearization.h"
#include "invgrad/update_rule.h"

namespace invgrad {

class ChordalRule final : public UpdateRule {
 public:
  LinearizationParts Needs() const override {
    return LinearizationParts::Gradient();
  }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) override;
};

// Adds it to the table of rules, for ParseMethods.
void RegisterChordalRule();

}  // namespace invgrad

#endif  // BIN_ESTIMATE_CHORDAL_RULE_H_
