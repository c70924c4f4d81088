#include "bin/support/sweep_plan.h"

#include <algorithm>
#include <map>

#include "bin/support/learning_comparison.h"
#include "bin/support/parse_list.h"
#include "bin/support/run_directory.h"
#include "glog/logging.h"
#include "problems/problems.h"

namespace invgrad {

namespace {

std::vector<std::string> Names(const std::vector<OptionSet::Row>& options) {
  std::vector<std::string> names;
  names.reserve(options.size());
  for (const OptionSet::Row& row : options) names.push_back(row.name);
  return names;
}

bool Contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::vector<std::string> OptionsOf(const Phase& phase) {
  std::vector<std::string> names;
  const auto add = [&names](const std::vector<OptionSet::Row>& options) {
    for (const std::string& name : Names(options)) names.push_back(name);
  };
  if (phase.rule != nullptr) add(phase.rule->options());
  if (phase.ceres != nullptr) add(phase.ceres->options());
  if (phase.pull_back.has_value()) {
    PullBackMethod ways = *phase.pull_back;
    OptionSet set;
    ways.Describe(&set);
    add(set.rows());
  }
  return names;
}

class Planner {
 public:
  Planner(const SweepBase& base, SweepPlan* plan, std::string* error)
      : base_(base), plan_(plan), error_(error) {}

  bool Plan() {
    if (!ReadRules() || !ReadSeeds() || !ReadBatchSizes() || !SortAxes()) {
      return false;
    }
    std::vector<int> at(plan_->grid.axes.size(), 0);
    do {
      if (!AddPoints(at)) return false;
    } while (Advance(&at));
    return true;
  }

 private:
  enum class Kind { kRule, kSeed, kBatchSize, kNetwork, kProblem, kRuleOption };

  const std::vector<GridAxis>& axes() const { return plan_->grid.axes; }

  bool Refuse(size_t position, const std::string& message) {
    *error_ = GridMessage(plan_->grid.text, position, message);
    return false;
  }

  bool ReadRules() {
    const GridAxis* rules = plan_->grid.Find("rule");
    if (rules == nullptr) {
      return Refuse(plan_->grid.text.size(),
                    "expected the axis rule=method,method, found the end");
    }
    plan_->rule_axis = static_cast<int>(rules - axes().data());
    for (const GridValue& value : rules->values) {
      plan_->alternatives.push_back(ExpandRule(value.text));
      for (const RuleAlternative& rule : plan_->alternatives.back()) {
        Method method;
        std::string why;
        if (!ParseMethod(rule.specification, &method, &why)) {
          return Refuse(value.position, why);
        }
      }
    }
    return true;
  }

  bool ReadSeeds() {
    if (plan_->grid.Find("seed") == nullptr) {
      plan_->grid.axes.push_back(
          {"seed", plan_->grid.text.size(), {{"1", plan_->grid.text.size()}}});
    }
    const GridAxis* axis = plan_->grid.Find("seed");
    plan_->seed_axis = static_cast<int>(axis - axes().data());
    for (const GridValue& value : axis->values) {
      std::vector<int> seed;
      std::string why;
      if (!ParseSeeds(value.text, &seed, &why)) {
        return Refuse(value.position, why);
      }
      seeds_.push_back(seed[0]);
    }
    return true;
  }

  bool ReadBatchSizes() {
    const GridAxis* axis = plan_->grid.Find("batch_size");
    if (axis == nullptr) return true;
    for (const GridValue& value : axis->values) {
      int batch_size = 0;
      OptionSet set;
      set.Add("batch_size", &batch_size, {0, 1e9}, "");
      std::string why;
      if (!set.Set("batch_size", value.text, &why)) {
        return Refuse(value.position, why);
      }
      batch_sizes_.push_back(batch_size);
    }
    return true;
  }

  // Finds out what each axis is, and which rules have the options of rules.
  bool SortAxes() {
    PhysicsProblem problem;
    std::vector<Specification> parsed;
    if (!CreateProblem(base_.problem, nullptr, &problem, error_) ||
        !ParseSpecifications(base_.problem, &parsed, error_)) {
      return false;
    }
    if (!problem.learning.has_value()) {
      *error_ = "--problem=" + base_.problem +
                " has no network to train; compare and trajectories show "
                "point problems";
      return false;
    }
    problems_[base_.problem] =
        std::make_shared<LearningProblem>(*std::move(problem.learning));
    LearningProblem with_network = *problems_[base_.problem];
    if (!SetNetwork(base_.network, &with_network, error_)) {
      *error_ = "--" + *error_;
      return false;
    }
    const std::vector<std::string> problem_options =
        Names(FindProblem(parsed[0].name)->options());
    for (const GridAxis& axis : axes()) {
      if (axis.name == "rule") {
        kinds_.push_back(Kind::kRule);
      } else if (axis.name == "seed") {
        kinds_.push_back(Kind::kSeed);
      } else if (axis.name == "batch_size") {
        kinds_.push_back(Kind::kBatchSize);
      } else if (Contains(NetworkSettings::Names(), axis.name)) {
        kinds_.push_back(Kind::kNetwork);
      } else if (Contains(problem_options, axis.name)) {
        kinds_.push_back(Kind::kProblem);
      } else if (IsRuleOption(axis)) {
        kinds_.push_back(Kind::kRuleOption);
      } else {
        return RefuseAxis(axis, problem_options);
      }
    }
    return true;
  }

  // A rule has an option if it takes at least one of the values.
  bool IsRuleOption(const GridAxis& axis) {
    std::vector<bool> takers;
    for (const std::vector<RuleAlternative>& rule : plan_->alternatives) {
      takers.push_back(std::any_of(
          axis.values.begin(), axis.values.end(), [&](const GridValue& value) {
            Method method;
            std::string ignored;
            return ParseMethod(
                WithOption(rule[0], axis, value), &method, &ignored);
          }));
    }
    takers_[axis.name] = takers;
    return std::find(takers.begin(), takers.end(), true) != takers.end();
  }

  static std::string WithOption(const RuleAlternative& rule,
                                const GridAxis& axis,
                                const GridValue& value) {
    return rule.specification + ":" + axis.name + "=" + value.text;
  }

  bool RefuseAxis(const GridAxis& axis, std::vector<std::string> names) {
    names.insert(names.end(), {"rule", "seed", "batch_size"});
    for (const std::string& name : NetworkSettings::Names()) {
      names.push_back(name);
    }
    for (const std::vector<RuleAlternative>& rule : plan_->alternatives) {
      Method method;
      std::string why;
      ParseMethod(rule[0].specification, &method, &why);
      for (const std::string& name : OptionsOf(method.last_phase())) {
        if (name == axis.name) {  // it is there: the values are not allowed
          ParseMethod(WithOption(rule[0], axis, axis.values[0]), &method, &why);
          return Refuse(axis.values[0].position, why);
        }
        if (!Contains(names, name)) names.push_back(name);
      }
    }
    return Refuse(axis.position,
                  UnknownNameMessage("axis", axis.name, names) +
                      "; expected rule, seed, batch_size, hidden, activation, "
                      "initialization, or an option of the problem or of a "
                      "rule of the grid");
  }

  // The next point of the grid, the last axis changing fastest.
  bool Advance(std::vector<int>* at) const {
    for (size_t k = at->size(); k-- > 0;) {
      const auto size = static_cast<int>(axes()[k].values.size());
      if (++(*at)[k] < size) return true;
      (*at)[k] = 0;
    }
    return false;
  }

  // A setting that a point makes.
  struct Setting {
    std::string text;  // ":name=value"
    size_t position = 0;
  };

  // Refuses the first of the settings that is not allowed by itself; or, if
  // they are not allowed only together, for `why_not_all`, the last one.
  // `is_allowed`: bool(const std::string& text, std::string* why).
  template <typename IsAllowed>
  bool RefuseOneOf(const std::vector<Setting>& settings,
                   const std::string& why_not_all,
                   const IsAllowed& is_allowed) {
    CHECK(!settings.empty());  // without them it was checked before
    for (const Setting& setting : settings) {
      std::string why;
      if (!is_allowed(setting.text, &why)) {
        return Refuse(setting.position, why);
      }
    }
    return Refuse(settings.back().position, why_not_all);
  }

  static std::string Joined(const std::vector<Setting>& settings) {
    std::string text;
    for (const Setting& setting : settings) text += setting.text;
    return text;
  }

  // The jobs of all alternatives at one point.
  bool AddPoints(const std::vector<int>& at) {
    const GridValue& rule_value =
        axes()[plan_->rule_axis].values[at[plan_->rule_axis]];
    std::vector<Setting> of_problem;
    std::vector<Setting> of_network;
    std::vector<Setting> of_rule;
    std::string directory;  // what distinguishes the job
    size_t batch_position = rule_value.position;
    LearningComparisonOptions run;
    run.batch_size = base_.batch_size;
    for (size_t k = 0; k < at.size(); ++k) {
      const GridAxis& axis = axes()[k];
      const GridValue& value = axis.values[at[k]];
      const Setting setting = {":" + axis.name + "=" + value.text,
                               value.position};
      if (kinds_[k] == Kind::kProblem) {
        of_problem.push_back(setting);
        directory += setting.text.substr(1) + "-";
      } else if (kinds_[k] == Kind::kNetwork) {
        of_network.push_back(setting);
        directory += setting.text.substr(1) + "-";
      } else if (kinds_[k] == Kind::kBatchSize) {
        run.batch_size = batch_sizes_[at[k]];
        batch_position = value.position;
      } else if (kinds_[k] == Kind::kRuleOption &&
                 takers_[axis.name][at[plan_->rule_axis]]) {
        of_rule.push_back(setting);
      }
    }
    std::shared_ptr<const LearningProblem> problem;
    if (!FindOrSetNetwork(of_problem, of_network, &problem)) return false;
    const std::vector<RuleAlternative>& rules =
        plan_->alternatives[at[plan_->rule_axis]];
    for (size_t i = 0; i < rules.size(); ++i) {
      SweepJob job;
      std::string why;
      const std::string& rule = rules[i].specification;
      if (!ParseMethod(rule + Joined(of_rule), &job.method, &why)) {
        return RefuseOneOf(
            of_rule, why, [&rule](const std::string& text, std::string* error) {
              Method method;
              return ParseMethod(rule + text, &method, error);
            });
      }
      if (!CheckLearningComparison(*problem, {job.method}, run, &why)) {
        return Refuse(batch_position, why);
      }
      job.problem = problem;
      job.batch_size = BatchSize(*problem, run);
      job.seed = seeds_[at[plan_->seed_axis]];
      job.name = directory + job.method.label + "-batch" +
                 BatchSizesText(*problem, job.method, run) + "-seed" +
                 std::to_string(job.seed);
      plan_->points.push_back({at, static_cast<int>(i), FindOrAddJob(job)});
    }
    return true;
  }

  // "256+32": of all phases.
  static std::string BatchSizesText(const LearningProblem& problem,
                                    const Method& method,
                                    const LearningComparisonOptions& run) {
    std::string text;
    for (const Phase& phase : method.phases) {
      text += (text.empty() ? "" : "+") +
              std::to_string(BatchSize(problem, phase, run));
    }
    return text;
  }

  // With its own network.
  bool FindOrCreateProblem(const std::vector<Setting>& settings,
                           std::shared_ptr<const LearningProblem>* problem) {
    const std::string specification = base_.problem + Joined(settings);
    std::shared_ptr<const LearningProblem>& known = problems_[specification];
    if (known == nullptr) {
      PhysicsProblem created;
      std::string why;
      if (!CreateProblem(specification, nullptr, &created, &why)) {
        return RefuseOneOf(
            settings, why, [this](const std::string& text, std::string* error) {
              PhysicsProblem ignored;
              return CreateProblem(
                  base_.problem + text, nullptr, &ignored, error);
            });
      }
      known = std::make_shared<LearningProblem>(*std::move(created.learning));
    }
    *problem = known;
    return true;
  }

  // With the network that the command line and the point make.
  bool FindOrSetNetwork(const std::vector<Setting>& of_problem,
                        const std::vector<Setting>& of_network,
                        std::shared_ptr<const LearningProblem>* problem) {
    if (!FindOrCreateProblem(of_problem, problem)) return false;
    std::shared_ptr<const LearningProblem>& known =
        with_networks_[Joined(of_problem) + Joined(of_network)];
    if (known == nullptr) {
      LearningProblem changed = **problem;
      std::string why;
      if (!SetNetwork(NetworkOf(of_network), &changed, &why)) {
        // The command line's network fits no longer, at other options.
        if (of_network.empty()) return Refuse(of_problem.back().position, why);
        return RefuseOneOf(
            of_network, why, [&](const std::string& text, std::string* error) {
              return SetNetwork(NetworkOf({{text}}), &changed, error);
            });
      }
      known = std::make_shared<LearningProblem>(std::move(changed));
    }
    *problem = known;
    return true;
  }

  // That of the command line, but for these settings.
  NetworkSettings NetworkOf(const std::vector<Setting>& settings) const {
    NetworkSettings network = base_.network;
    for (const Setting& setting : settings) {
      const size_t equals = setting.text.find('=');
      *network.Find(setting.text.substr(1, equals - 1)) =
          setting.text.substr(equals + 1);
    }
    return network;
  }

  // Two points with the same settings share a job.
  int FindOrAddJob(SweepJob job) {
    const auto [it, is_new] =
        job_numbers_.emplace(job.name, static_cast<int>(plan_->jobs.size()));
    if (is_new) {
      // The number keeps apart what special characters or length would not.
      constexpr size_t kMaxLength = 150;
      job.name = std::to_string(it->second) + "-" +
                 FileName(job.name).substr(0, kMaxLength);
      plan_->jobs.push_back(std::move(job));
    }
    return it->second;
  }

  const SweepBase& base_;
  SweepPlan* plan_;
  std::string* error_;

  std::vector<Kind> kinds_;  // of the axes
  std::vector<int> seeds_;
  std::vector<int> batch_sizes_;
  std::map<std::string, std::vector<bool>> takers_;  // of an option, by rule
  // By their settings; the first ones have their own network.
  std::map<std::string, std::shared_ptr<const LearningProblem>> problems_;
  std::map<std::string, std::shared_ptr<const LearningProblem>> with_networks_;
  std::map<std::string, int> job_numbers_;
};

}  // namespace

bool MakeSweepPlan(const SweepBase& base,
                   const Grid& grid,
                   SweepPlan* plan,
                   std::string* error) {
  *plan = SweepPlan();
  plan->grid = grid;
  return Planner(base, plan, error).Plan();
}

}  // namespace invgrad
