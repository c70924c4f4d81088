// The table of update rules: name -> one line -> factory.
//
// A new rule is one pair of files and one row in rules.cc; the flags, the
// listing, the conformance tests and docs/rules.md are made from the table.
#ifndef INVGRAD_RULES_RULES_H_
#define INVGRAD_RULES_RULES_H_

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "invgrad/core/option_set.h"
#include "invgrad/core/update_rule.h"

namespace invgrad {

using Settings = std::vector<std::pair<std::string, std::string>>;

struct RuleRow {
  std::string name;     // "half_inverse"
  std::string formula;  // "step = -eta V S^(-1/2) U^T g, s > tau s_max"
  std::function<std::vector<OptionSet::Row>()> options;
  // Null, with *error set, if a setting is unknown or out of range.
  std::function<std::unique_ptr<UpdateRule>(const Settings& settings,
                                            std::string* error)>
      create;
};

const std::vector<RuleRow>& Rules();

// The row of that name or null.
const RuleRow* FindRule(const std::string& name);

// The rule that `specification` describes, or null with *error set.
std::unique_ptr<UpdateRule> CreateRule(const Specification& specification,
                                       std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_RULES_RULES_H_
