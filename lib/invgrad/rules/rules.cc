#include "invgrad/rules.h"

#include <utility>

#include "fmt/core.h"
#include "invgrad/core/specification.h"
#include "invgrad/internal/logging.h"
#include "invgrad/rules/rule_rows.h"

namespace invgrad {
namespace {

std::deque<RuleRow>& Table() {
  static std::deque<RuleRow>& table = *[] {
    auto* rows = new std::deque<RuleRow>;
    for (const auto& rows_of_file : {FirstOrderRuleRows(),
                                     NewtonRuleRows(),
                                     SpectralRuleRows(),
                                     KfacRuleRows(),
                                     KrylovRuleRows(),
                                     HessianFreeRuleRows(),
                                     AdaHessianRuleRows(),
                                     GeodesicRuleRows(),
                                     DeterminedRuleRows(),
                                     SsBroydenRuleRows()}) {
      rows->insert(rows->end(), rows_of_file.begin(), rows_of_file.end());
    }
    return rows;
  }();
  return table;
}

}  // namespace

std::unique_ptr<UpdateRule> MakeRule(const std::string& text) {
  std::string error;
  std::unique_ptr<UpdateRule> rule = MakeRule(text, &error);
  CHECK(rule != nullptr) << error;
  return rule;
}

std::unique_ptr<UpdateRule> MakeRule(const std::string& text,
                                     std::string* error) {
  CHECK(error != nullptr);
  std::vector<Specification> specifications;
  if (!ParseSpecifications(text, &specifications, error)) return nullptr;
  if (specifications.size() != 1) {
    *error = fmt::format(
        "'{}' describes {} rules; expected one", text, specifications.size());
    return nullptr;
  }
  return MakeRule(specifications[0], error);
}

std::unique_ptr<UpdateRule> MakeRule(const Specification& specification,
                                     std::string* error) {
  CHECK(error != nullptr);
  const RuleRow* row = FindRule(specification.name);
  if (row != nullptr) return row->create(specification.settings, error);
  std::vector<std::string> names;
  for (const RuleRow& other : Rules()) names.push_back(other.name);
  *error = UnknownNameMessage("rule", specification.name, names);
  return nullptr;
}

const std::deque<RuleRow>& Rules() { return Table(); }

const RuleRow* FindRule(const std::string& name) {
  for (const RuleRow& row : Rules()) {
    if (row.name == name) return &row;
  }
  return nullptr;
}

void RegisterRule(RuleRow row) {
  CHECK(!row.name.empty() &&
        row.name.find_first_of(":=,/+> \t\n") == std::string::npos)
      << "'" << row.name << "' cannot be the name of a rule.";
  CHECK(FindRule(row.name) == nullptr)
      << "There is already a rule '" << row.name << "'.";
  CHECK(row.options != nullptr && row.create != nullptr)
      << "The row of rule '" << row.name << "' is incomplete.";
  Table().push_back(std::move(row));
}

}  // namespace invgrad
