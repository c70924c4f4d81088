#include "invgrad/method.h"

#include <algorithm>
#include <utility>

#include "fmt/core.h"
#include "invgrad/core/specification.h"
#include "invgrad/internal/logging.h"
#include "invgrad/methods/ceres_methods.h"
#include "invgrad/methods/pull_back_method.h"

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

bool FindRuleRow(const std::string& name, Phase* phase, std::string* error) {
  phase->rule = FindRule(name);
  if (phase->rule != nullptr) return true;
  std::vector<std::string> names;
  for (const RuleRow& row : Rules()) names.push_back(row.name);
  *error = UnknownNameMessage("rule", name, names);
  return false;
}

// Inside ceres::Solve the network is inverted, too: a first-order step would
// hardly move it, and undamped Gauss-Newton steps go too far.
const ChainMethodRow& SipProposal() {
  static const auto& row = *new ChainMethodRow{
      "sip",
      "",
      "newton/inverse/levenberg_marquardt",
      {{"updates", "3"}, {"step_size", "auto"}, {"control", "gain"}}};
  return row;
}

// The known combination with this name, alone or after "ceres_lm+"; or null.
const ChainMethodRow* FindCombination(const std::string& name) {
  const size_t plus = name.find('+');
  if (plus == std::string::npos) return FindChainMethod(name);
  const std::string proposal = name.substr(plus + 1);
  return proposal == "sip" ? &SipProposal() : FindChainMethod(proposal);
}

// Finds the table rows of "loss/simulator/rule" or a known combination.
bool FindPullBackRows(const std::string& name,
                      const ChainMethodRow* combination,
                      Phase* phase,
                      std::string* error) {
  std::string rule;
  phase->pull_back = std::make_shared<PullBackMethod>();
  return phase->pull_back->SetWays(
             combination != nullptr ? combination->ways : name, &rule, error) &&
         FindRuleRow(rule, phase, error);
}

// Finds the table rows of "rule", "loss/simulator/rule", "ceres",
// "ceres+rule" or "ceres+loss/simulator/rule".
bool FindRows(const std::string& name, Phase* phase, std::string* error) {
  const ChainMethodRow* combination = FindCombination(name);
  const size_t plus = name.find('+');
  const bool pulls_back =
      combination != nullptr || name.find('/') != std::string::npos;
  if (plus == std::string::npos) {
    if (pulls_back) return FindPullBackRows(name, combination, phase, error);
    phase->ceres = FindCeresMethod(name);
    phase->rule = FindRule(name);
    if (phase->rule != nullptr || phase->ceres != nullptr) return true;
    *error = UnknownNameMessage("rule", name, AllMethodNames());
    return false;
  }
  phase->ceres = FindCeresMethod(name.substr(0, plus));
  if (phase->ceres == nullptr || !phase->ceres->is_trust_region) {
    *error = fmt::format(
        "'{}': steps can be proposed to ceres_lm and ceres_dogleg, not to '{}'",
        name,
        name.substr(0, plus));
    return false;
  }
  const std::string proposal = name.substr(plus + 1);
  return pulls_back ? FindPullBackRows(proposal, combination, phase, error)
                    : FindRuleRow(proposal, phase, error);
}

const std::vector<std::string>& OwnNames() {
  static const auto* const names = new std::vector<std::string>{
      "batch_size", "epochs", "steps", "output_layer", "output_layer_period"};
  return *names;
}

bool IsOwn(const std::string& name) {
  return std::find(OwnNames().begin(), OwnNames().end(), name) !=
         OwnNames().end();
}

// Takes batch_size=auto away. Without a batch size the rule says whether it is
// auto, except where a layer is solved on all samples.
bool TakeRacing(Settings* settings, const Phase& phase) {
  const auto named = [&](const std::string& name) {
    return std::find_if(settings->begin(), settings->end(), [&](const auto& s) {
      return s.first == name;
    });
  };
  const auto size = named("batch_size");
  if (size == settings->end()) {
    const auto layer = named("output_layer");
    return phase.rule != nullptr && phase.rule->races_batch_size &&
           phase.ceres == nullptr &&
           (layer == settings->end() || layer->second == "trained");
  }
  if (size->second != "auto") return false;
  settings->erase(size);
  return true;
}

// The settings of the method itself.
bool SetOwn(Settings settings, Phase* phase, std::string* error) {
  const bool races_batch_size = TakeRacing(&settings, *phase);
  constexpr double kMax = 1e9;
  int batch_size = 0;
  int num_epochs = 1;
  int num_steps = 1;
  OptionSet set;
  set.Add("batch_size",
          &batch_size,
          {0, kMax},
          "samples a step; 0: all; auto: raced, from the run's batch size on");
  set.Add("epochs", &num_epochs, {1, kMax}, "share of a phase");
  set.Add("steps", &num_steps, {1, kMax}, "share of a phase");
  std::string output_layer = "trained";
  set.Add("output_layer",
          &output_layer,
          {"trained", "exact", "auto"},
          "exact: the network's last layer is solved by least squares; auto: "
          "while that pays");
  set.Add("output_layer_period",
          &phase->output_layer_period,
          {0, kMax},
          "steps between two solutions; 0: so that these take half as long as "
          "the steps");
  if (!set.SetAll(settings, error)) return false;
  using OutputLayer = Phase::OutputLayer;
  phase->output_layer = output_layer == "exact"  ? OutputLayer::kExact
                        : output_layer == "auto" ? OutputLayer::kAuto
                                                 : OutputLayer::kTrained;
  if (phase->output_layer_period > 0 && !phase->solves_output_layer()) {
    *error = "output_layer_period needs output_layer=exact or auto";
    return false;
  }
  if (races_batch_size &&
      (phase->ceres != nullptr || phase->solves_output_layer())) {
    *error =
        fmt::format("batch_size=auto: {} all samples: leave it out",
                    phase->ceres != nullptr ? "a minimizer of Ceres takes"
                                            : "the output layer is solved on");
    return false;
  }
  if (phase->solves_output_layer() && phase->ceres != nullptr) {
    *error = fmt::format(
        "output_layer={}: Ceres would train the layer with all others: choose "
        "an update rule, such as geodesic or levenberg_marquardt",
        output_layer);
    return false;
  }
  phase->races_batch_size = races_batch_size;
  for (const auto& [name, ignored] : settings) {
    if (name == "batch_size") phase->batch_size = batch_size;
    if (name == "epochs") phase->num_epochs = num_epochs;
    if (name == "steps") phase->num_steps = num_steps;
  }
  return true;
}

// Adds the settings that are not set.
void AddDefaults(const Settings& defaults, Settings* settings) {
  for (const auto& setting : defaults) {
    if (std::none_of(
            settings->begin(), settings->end(), [&](const auto& other) {
              return other.first == setting.first;
            })) {
      settings->push_back(setting);
    }
  }
}

// The message for an unknown setting also suggests options of the phase and of
// its rule.
bool SetPullBack(const Settings& settings, Phase* phase, std::string* error) {
  OptionSet set;
  phase->pull_back->Describe(&set);
  std::vector<std::string> names = OwnNames();
  for (const OptionSet::Row& row : set.rows()) names.push_back(row.name);
  for (const OptionSet::Row& row : phase->rule->options()) {
    names.push_back(row.name);
  }
  if (phase->ceres != nullptr) {
    for (const OptionSet::Row& row : phase->ceres->options()) {
      names.push_back(row.name);
    }
  }
  for (const auto& setting : settings) {
    if (std::find(names.begin(), names.end(), setting.first) == names.end()) {
      *error = UnknownNameMessage("option", setting.first, names);
      return false;
    }
  }
  return set.SetAll(settings, error);
}

bool ParsePhase(const Specification& specification,
                Phase* phase,
                std::string* error) {
  phase->label = specification.text;
  if (!FindRows(specification.name, phase, error)) return false;
  const ChainMethodRow* combination = FindCombination(specification.name);
  Settings settings = specification.settings;
  if (combination != nullptr) AddDefaults(combination->defaults, &settings);
  Settings own_settings;
  Settings pull_back_settings;
  for (const auto& setting : settings) {
    if (IsOwn(setting.first)) {
      own_settings.push_back(setting);
    } else if (phase->rule != nullptr &&
               (HasOption(phase->rule->options(), setting.first) ||
                (phase->ceres == nullptr && phase->pull_back == nullptr))) {
      phase->rule_settings.push_back(setting);
    } else if (phase->pull_back != nullptr &&
               (phase->ceres == nullptr ||
                !HasOption(phase->ceres->options(), setting.first))) {
      pull_back_settings.push_back(setting);
    } else {
      phase->ceres_settings.push_back(setting);
    }
  }
  std::string why;
  ceres::Solver::Options options;
  if (SetOwn(own_settings, phase, &why) &&
      (phase->pull_back == nullptr ||
       SetPullBack(pull_back_settings, phase, &why)) &&
      (phase->rule == nullptr ||
       phase->rule->create(phase->rule_settings, &why) != nullptr) &&
      (phase->ceres == nullptr ||
       phase->ceres->configure(phase->ceres_settings, &options, &why))) {
    return true;
  }
  const std::string name = specification.name + ": ";
  *error = why.rfind(name, 0) == 0 ? why : name + why;
  return false;
}

// Returns false if a phase before the last one has no share of the run, or if
// the phase has a share that is not allowed.
bool CheckShare(const Phase& phase, bool is_last, std::string* error) {
  const bool has_share = phase.num_epochs > 0 || phase.num_steps > 0;
  if (is_last && has_share) {
    *error = fmt::format(
        "'{}': epochs and steps are the share of a phase that another one "
        "follows, as in adam:epochs=5>half_inverse; the last one takes what is "
        "left of the run's budget",
        phase.label);
  } else if (!is_last && !has_share) {
    *error = fmt::format(
        "'{}' needs epochs=N or steps=N, its share of the run: another phase "
        "follows it",
        phase.label);
  } else if (!is_last && phase.ceres != nullptr) {
    *error = fmt::format(
        "'{}': a minimizer of Ceres can only be the last phase", phase.label);
  } else {
    return true;
  }
  return false;
}

}  // namespace

std::unique_ptr<UpdateRule> Phase::MakeRule() const {
  if (rule == nullptr) return nullptr;
  std::string error;
  std::unique_ptr<UpdateRule> made = rule->create(rule_settings, &error);
  CHECK(made != nullptr) << error;
  return made;
}

ceres::Solver::Options Phase::CeresOptions() const {
  CHECK(ceres != nullptr) << label << " has no minimizer of Ceres";
  ceres::Solver::Options options;
  std::string error;
  CHECK(ceres->configure(ceres_settings, &options, &error)) << error;
  return options;
}

int Phase::BatchSize(int batch_size_of_run, int num_samples) const {
  const int size = batch_size >= 0 ? batch_size : batch_size_of_run;
  return size == 0 || ceres != nullptr ? num_samples : size;
}

bool Method::ReadsProgress() const {
  return std::any_of(phases.begin(), phases.end(), [](const Phase& phase) {
    const std::unique_ptr<UpdateRule> rule = phase.MakeRule();
    return (rule != nullptr && rule->Needs().progress) ||
           phase.output_layer == Phase::OutputLayer::kAuto;
  });
}

void Method::AddCeresDefaults(const Settings& defaults) {
  Phase& last = phases.back();
  if (last.ceres == nullptr) return;
  for (const auto& setting : defaults) {
    if (HasOption(last.ceres->options(), setting.first)) {
      AddDefaults({setting}, &last.ceres_settings);
    }
  }
}

// "phase>phase>phase"
bool ParseMethod(const std::string& text, Method* method, std::string* error) {
  method->label = text;
  method->phases.clear();
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find('>', begin), text.size());
    std::vector<Specification> specifications;
    Phase phase;
    if (!ParseSpecifications(
            text.substr(begin, end - begin), &specifications, error)) {
      return false;
    }
    if (specifications.size() != 1) {
      *error = fmt::format(
          "'{}': a comma separates methods; one is allowed here", text);
      return false;
    }
    if (!ParsePhase(specifications[0], &phase, error) ||
        !CheckShare(phase, end == text.size(), error)) {
      return false;
    }
    method->phases.push_back(std::move(phase));
    begin = end + 1;
  }
  return true;
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
        *error = fmt::format("'{}' is listed twice", method.label);
        return false;
      }
    }
    methods->push_back(std::move(method));
  }
  return true;
}

}  // namespace invgrad
