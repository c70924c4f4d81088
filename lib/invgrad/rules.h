// Makes update rules by their names, and adds rules to the table of names. Use
// MakeRule to get a rule for UpdateCallback (update_callback.h), Minimize
// (minimize.h) or a TrainingRun (train.h). docs/rules.md lists the rules and
// their settings.
//
//   std::unique_ptr<UpdateRule> rule =
//       MakeRule("half_inverse:step_size=auto:rho=1");
//
// A user's rule is a class with Needs and ComputeStep (update_rule.h). One call
// adds it to the table by name:
//
//   RegisterRule<Mine>("mine", "step = -eta sign(gradient)");
//
// Settings are the fields of a nested struct Options with a method Describe
// (option_set.h); the constructor takes this struct.
#ifndef INVGRAD_RULES_H_
#define INVGRAD_RULES_H_

#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "invgrad/option_set.h"
#include "invgrad/update_rule.h"

namespace invgrad {

// The rule of a specification such as "adam:step_size=1e-3". CHECKs that the
// specification is valid; the message names the nearest rules, or the allowed
// values.
std::unique_ptr<UpdateRule> MakeRule(const std::string& text);

// The same for text from the user of a program: null, with *error, if the
// specification is invalid.
std::unique_ptr<UpdateRule> MakeRule(const std::string& text,
                                     std::string* error);
std::unique_ptr<UpdateRule> MakeRule(const Specification& specification,
                                     std::string* error);

struct RuleRow {
  std::string name;     // "half_inverse"
  std::string formula;  // "step = -eta V S^(-1/2) U^T g, s > tau s_max"
  std::function<std::vector<OptionSet::Row>()> options;
  // Null, with *error, if a setting is unknown or out of range.
  std::function<std::unique_ptr<UpdateRule>(const Settings& settings,
                                            std::string* error)>
      create;
  // Whether training races the batch size (batch_size=auto of method.h), unless
  // the method sets one.
  bool races_batch_size = false;
};

// All rows, the registered ones last. RegisterRule invalidates iterators.
const std::deque<RuleRow>& Rules();

// The row with this name, or null. The row is valid until the program ends.
const RuleRow* FindRule(const std::string& name);

// Adds a row. Call it before other threads use the table, for example at the
// beginning of main. CHECKs that the name is new and not empty, and has no
// space and none of the characters ":=,/+>", which specifications use.
void RegisterRule(RuleRow row);

// Options of a rule without settings.
struct NoOptions {
  void Describe(OptionSet*) {}
};

template <typename Rule, typename = void>
struct RuleOptions {
  using Type = NoOptions;
};
template <typename Rule>
struct RuleOptions<Rule, std::void_t<typename Rule::Options>> {
  using Type = typename Rule::Options;
};

// A row whose settings default to `defaults`.
template <typename Rule, typename Options = typename RuleOptions<Rule>::Type>
RuleRow MakeRuleRow(const std::string& name,
                    const std::string& formula,
                    const Options& defaults = Options()) {
  RuleRow row;
  row.name = name;
  row.formula = formula;
  row.options = [defaults]() {
    Options options = defaults;
    OptionSet set;
    options.Describe(&set);
    return set.rows();
  };
  row.create = [name, defaults](
                   const Settings& settings,
                   std::string* error) -> std::unique_ptr<UpdateRule> {
    Options options = defaults;
    OptionSet set;
    options.Describe(&set);
    if (!set.SetAll(settings, error)) {
      *error = name + ": " + *error;
      return nullptr;
    }
    if constexpr (std::is_same_v<Options, NoOptions>) {
      return std::make_unique<Rule>();
    } else {
      return std::make_unique<Rule>(options);
    }
  };
  return row;
}

template <typename Rule, typename Options = typename RuleOptions<Rule>::Type>
void RegisterRule(const std::string& name,
                  const std::string& formula,
                  const Options& defaults = Options()) {
  RegisterRule(MakeRuleRow<Rule>(name, formula, defaults));
}

}  // namespace invgrad

#endif  // INVGRAD_RULES_H_
