#include "invgrad/methods/method.h"

#include <algorithm>
#include <utility>

#include "glog/logging.h"

namespace invgrad {

namespace {

bool HasOption(const std::vector<OptionSet::Row>& options,
               const std::string& name) {
  return std::any_of(
      options.begin(), options.end(), [&](const OptionSet::Row& row) {
        return row.name == name;
      });
}

std::vector<std::string> AllMethodNames() {
  std::vector<std::string> names;
  for (const RuleRow& row : Rules()) names.push_back(row.name);
  for (const ChainMethodRow& row : ChainMethods()) names.push_back(row.name);
  for (const CeresMethodRow& row : CeresMethods()) names.push_back(row.name);
  return names;
}

bool FindRuleRow(const std::string& name, Method* method, std::string* error) {
  method->rule = FindRule(name);
  if (method->rule != nullptr) return true;
  std::vector<std::string> names;
  for (const RuleRow& row : Rules()) names.push_back(row.name);
  *error = UnknownNameMessage("rule", name, names);
  return false;
}

// "loss/simulator/rule"
bool FindWays(const std::string& name, Method* method, std::string* error) {
  const size_t first = name.find('/');
  const size_t second = name.find('/', first + 1);
  if (second == std::string::npos ||
      name.find('/', second + 1) != std::string::npos) {
    *error = "'" + name + "': wanted LOSS/SIMULATOR/RULE";
    return false;
  }
  return method->pull_back.emplace().SetWays(
             name.substr(0, first),
             name.substr(first + 1, second - first - 1),
             error) &&
         FindRuleRow(name.substr(second + 1), method, error);
}

// Finds the rows that "rule", "loss/simulator/rule", "ceres" or "ceres+rule"
// names.
bool FindRows(const std::string& name, Method* method, std::string* error) {
  const ChainMethodRow* chain = FindChainMethod(name);
  if (chain != nullptr) {
    return method->pull_back.emplace().SetWays(
               chain->loss, chain->simulator, error) &&
           FindRuleRow(chain->rule, method, error);
  }
  if (name.find('/') != std::string::npos) return FindWays(name, method, error);
  const size_t plus = name.find('+');
  if (plus == std::string::npos) {
    method->rule = FindRule(name);
    method->ceres = FindCeresMethod(name);
    if (method->rule == nullptr && method->ceres == nullptr) {
      *error = UnknownNameMessage("rule", name, AllMethodNames());
      return false;
    }
    return true;
  }
  const std::string ceres_name = name.substr(0, plus);
  const std::string rule_name = name.substr(plus + 1);
  method->ceres = FindCeresMethod(ceres_name);
  if (method->ceres == nullptr || !method->ceres->is_trust_region) {
    *error = "'" + name + "': steps can be proposed to ceres_lm and " +
             "ceres_dogleg, not to '" + ceres_name + "'";
    return false;
  }
  return FindRuleRow(rule_name, method, error);
}

bool IsOwn(const std::string& name) {
  return name == "batch_size" || name == "epochs" || name == "steps";
}

// The settings that belong to the method itself.
bool SetOwn(const Settings& settings, Method* method, std::string* error) {
  constexpr double kMax = 1e9;
  int batch_size = 0;
  int num_epochs = 1;
  int num_steps = 1;
  OptionSet set;
  set.Add("batch_size", &batch_size, {0, kMax}, "samples a step; 0: all");
  set.Add("epochs", &num_epochs, {1, kMax}, "share of a phase");
  set.Add("steps", &num_steps, {1, kMax}, "share of a phase");
  if (!set.SetAll(settings, error)) return false;
  for (const auto& [name, ignored] : settings) {
    if (name == "batch_size") method->batch_size = batch_size;
    if (name == "epochs") method->num_epochs = num_epochs;
    if (name == "steps") method->num_steps = num_steps;
  }
  return true;
}

// Those that are not set.
void AddDefaults(const Settings& defaults, Settings* settings) {
  const Settings given = *settings;
  for (const auto& setting : defaults) {
    if (std::none_of(given.begin(), given.end(), [&](const auto& other) {
          return other.first == setting.first;
        })) {
      settings->push_back(setting);
    }
  }
}

// Every setting is an option of the ways; if not, the message suggests the
// rule's options too.
bool CheckOptionNames(const Method& method,
                      const OptionSet& ways,
                      const Settings& settings,
                      std::string* error) {
  std::vector<std::string> names = {"batch_size", "epochs", "steps"};
  for (const OptionSet::Row& row : ways.rows()) names.push_back(row.name);
  for (const OptionSet::Row& row : method.rule->options()) {
    names.push_back(row.name);
  }
  for (const auto& setting : settings) {
    if (std::find(names.begin(), names.end(), setting.first) == names.end()) {
      *error = UnknownNameMessage("option", setting.first, names);
      return false;
    }
  }
  return true;
}

bool ParsePhase(const Specification& specification,
                Method* method,
                std::string* error) {
  method->label = specification.text;
  if (!FindRows(specification.name, method, error)) return false;
  const ChainMethodRow* chain = FindChainMethod(specification.name);
  Settings settings = specification.settings;
  if (chain != nullptr) AddDefaults(chain->defaults, &settings);
  Settings own_settings;
  Settings pull_back_settings;
  std::string why;
  for (const auto& setting : settings) {
    if (IsOwn(setting.first)) {
      own_settings.push_back(setting);
    } else if (method->rule != nullptr &&
               (HasOption(method->rule->options(), setting.first) ||
                (method->ceres == nullptr && !method->pull_back.has_value()))) {
      method->rule_settings.push_back(setting);
    } else if (method->pull_back.has_value()) {
      pull_back_settings.push_back(setting);
    } else {
      method->ceres_settings.push_back(setting);
    }
  }
  if (!SetOwn(own_settings, method, &why)) {
    *error = specification.name + ": " + why;
    return false;
  }
  if (method->pull_back.has_value()) {
    OptionSet set;
    method->pull_back->Describe(&set);
    if (!CheckOptionNames(*method, set, pull_back_settings, &why) ||
        !set.SetAll(pull_back_settings, &why)) {
      *error = specification.name + ": " + why;
      return false;
    }
  }
  ceres::Solver::Options options;
  ceres::GradientProblemSolver::Options gradient_options;
  if ((method->rule != nullptr &&
       method->rule->create(method->rule_settings, &why) == nullptr) ||
      (method->ceres != nullptr &&
       !method->ceres->configure(
           method->ceres_settings, &options, &gradient_options, &why))) {
    *error = specification.name + ": " + why;
    return false;
  }
  return true;
}

// False if the phase, with another one after it or not, has no share of the run
// or one that it may not have.
bool CheckShare(const Method& phase, bool is_last, std::string* error) {
  const bool has_share = phase.num_epochs > 0 || phase.num_steps > 0;
  if (is_last && has_share) {
    *error = "'" + phase.label +
             "': epochs and steps are the share of a phase that another one "
             "follows, as in adam:epochs=5>half_inverse; the last one takes "
             "what is left of the run's budget";
    return false;
  }
  if (!is_last && !has_share) {
    *error = "'" + phase.label +
             "' needs epochs=N or steps=N, its share of the run: another phase "
             "follows it";
    return false;
  }
  if (!is_last && phase.ceres != nullptr) {
    *error = "'" + phase.label +
             "': a minimizer of Ceres can only be the last phase";
    return false;
  }
  return true;
}

// "phase>phase>phase"
bool ParseMethod(const std::string& text, Method* method, std::string* error) {
  std::vector<Method> phases;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find('>', begin), text.size());
    std::vector<Specification> specifications;
    Method phase;
    if (!ParseSpecifications(
            text.substr(begin, end - begin), &specifications, error) ||
        !ParsePhase(specifications[0], &phase, error) ||
        !CheckShare(phase, end == text.size(), error)) {
      return false;
    }
    phases.push_back(std::move(phase));
    begin = end + 1;
  }
  *method = std::move(phases.back());
  phases.pop_back();
  method->earlier = std::move(phases);
  method->label = text;
  return true;
}

}  // namespace

void Method::AddCeresDefaults(const Settings& defaults) {
  if (ceres == nullptr) return;
  for (const auto& setting : defaults) {
    if (HasOption(ceres->options(), setting.first)) {
      AddDefaults({setting}, &ceres_settings);
    }
  }
}

std::unique_ptr<UpdateRule> Method::MakeRule() const {
  if (rule == nullptr) return nullptr;
  std::string error;
  std::unique_ptr<UpdateRule> made = rule->create(rule_settings, &error);
  CHECK(made != nullptr) << error;
  return made;
}

std::vector<const Method*> Method::Phases() const {
  std::vector<const Method*> phases;
  for (const Method& phase : earlier) phases.push_back(&phase);
  phases.push_back(this);
  return phases;
}

bool ParseMethods(const std::string& text,
                  std::vector<Method>* methods,
                  std::string* error) {
  std::vector<Specification> specifications;
  if (!ParseSpecifications(text, &specifications, error)) return false;
  methods->clear();
  for (const Specification& specification : specifications) {
    Method method;
    if (!ParseMethod(specification.text, &method, error)) return false;
    for (const Method& other : *methods) {
      if (other.label == method.label) {
        *error = "'" + method.label + "' is listed twice";
        return false;
      }
    }
    methods->push_back(std::move(method));
  }
  return true;
}

}  // namespace invgrad
