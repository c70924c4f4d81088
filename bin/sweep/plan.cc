#include "bin/sweep/plan.h"

#include <algorithm>
#include <map>

#include "bin/support/parse_list.h"
#include "bin/support/run_directory.h"
#include "bin/support/training.h"
#include "fmt/format.h"
#include "problems/problems.h"

namespace invgrad {
namespace {

bool Contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// The target of an axis' value.
enum class Kind { kRule, kSeed, kBatchSize, kNetwork, kProblem, kRuleOption };

// The setting of one axis at a point.
struct Setting {
  Kind kind;
  std::string name;
  std::string value;

  std::string Text() const { return name + "=" + value; }
};

class Planner {
 public:
  Planner(const SweepBase& base, SweepPlan* plan, std::string* error)
      : base_(base), plan_(plan), error_(error) {}

  bool Plan() {
    if (!CheckBase() || !ReadSeeds() || !ReadRules() || !SortAxes()) {
      return false;
    }
    std::vector<int> at(axes().size(), 0);
    do {
      if (!AddPoints(at)) return false;
    } while (Advance(&at));
    return true;
  }

 private:
  std::vector<GridAxis>& axes() { return plan_->grid.axes; }

  bool Refuse(const std::string& message) {
    *error_ = "--grid: " + message;
    return false;
  }

  bool CheckBase() {
    std::shared_ptr<const LearningProblem> problem;
    if (!FindProblem(base_.problem, {}, &problem, error_)) return false;
    if (FindProblem(base_.problem, base_.network, &problem, error_))
      return true;
    *error_ = "--" + *error_;
    return false;
  }

  bool ReadSeeds() {
    if (plan_->grid.Find("seed") < 0) axes().push_back({"seed", {"1"}});
    plan_->seed_axis = plan_->grid.Find("seed");
    std::vector<std::string>& values = axes()[plan_->seed_axis].values;
    std::vector<int> seeds;
    std::string why;
    if (!ParseSeeds(fmt::format("{}", fmt::join(values, ",")), &seeds, &why)) {
      return Refuse(why);
    }
    values.clear();
    for (const int seed : seeds) values.push_back(std::to_string(seed));
    return true;
  }

  bool ReadRules() {
    plan_->rule_axis = plan_->grid.Find("rule");
    if (plan_->rule_axis < 0) {
      return Refuse("expected an axis with the rules, rule=method,method");
    }
    for (const std::string& value : axes()[plan_->rule_axis].values) {
      plan_->alternatives.push_back(ExpandRule(value));
      for (const RuleAlternative& rule : plan_->alternatives.back()) {
        Method method;
        std::string why;
        if (!ParseMethod(rule.specification, &method, &why)) {
          return Refuse(fmt::format("rule={}: {}", value, why));
        }
      }
    }
    return true;
  }

  // Determines the kind of each axis, and which rules have its option.
  bool SortAxes() {
    const std::string name = base_.problem.substr(0, base_.problem.find(':'));
    std::vector<std::string> options;
    for (const auto& row : invgrad::FindProblem(name)->options()) {
      options.push_back(row.name);
    }
    for (const GridAxis& axis : axes()) {
      if (axis.name == "rule") {
        kinds_.push_back(Kind::kRule);
      } else if (axis.name == "seed") {
        kinds_.push_back(Kind::kSeed);
      } else if (axis.name == "batch_size") {
        kinds_.push_back(Kind::kBatchSize);
      } else if (Contains(NetworkSettings::Names(), axis.name)) {
        kinds_.push_back(Kind::kNetwork);
      } else if (Contains(options, axis.name)) {
        kinds_.push_back(Kind::kProblem);
      } else if (IsRuleOption(axis)) {
        kinds_.push_back(Kind::kRuleOption);
      } else {
        return RefuseAxis(axis, options);
      }
    }
    return true;
  }

  static bool Takes(const RuleAlternative& rule,
                    const GridAxis& axis,
                    const std::string& value,
                    std::string* why) {
    Method method;
    return ParseMethod(
        fmt::format("{}:{}={}", rule.specification, axis.name, value),
        &method,
        why);
  }

  // A rule has an option if it accepts at least one of the values.
  bool IsRuleOption(const GridAxis& axis) {
    std::vector<bool>& takers = takers_[axis.name];
    for (const std::vector<RuleAlternative>& rule : plan_->alternatives) {
      std::string ignored;
      takers.push_back(std::any_of(axis.values.begin(),
                                   axis.values.end(),
                                   [&](const std::string& value) {
                                     return Takes(
                                         rule[0], axis, value, &ignored);
                                   }));
    }
    return std::find(takers.begin(), takers.end(), true) != takers.end();
  }

  // The reason, for each rule, why the axis does not apply.
  bool RefuseAxis(const GridAxis& axis, std::vector<std::string> names) {
    names.insert(names.end(), {"rule", "seed", "batch_size"});
    const std::vector<std::string>& network = NetworkSettings::Names();
    names.insert(names.end(), network.begin(), network.end());
    std::string message =
        fmt::format("{}\n  allowed: {}",
                    UnknownNameMessage("axis", axis.name, names),
                    fmt::join(names, ", "));
    for (const std::vector<RuleAlternative>& rule : plan_->alternatives) {
      std::string why;
      Takes(rule[0], axis, axis.values[0], &why);
      message += "\n  and no option of a rule: " + why;
    }
    return Refuse(message);
  }

  // The next point of the grid, the last axis changing fastest.
  bool Advance(std::vector<int>* at) {
    for (size_t k = at->size(); k-- > 0;) {
      const auto size = static_cast<int>(axes()[k].values.size());
      if (++(*at)[k] < size) return true;
      (*at)[k] = 0;
    }
    return false;
  }

  // The jobs of all alternatives at one point.
  bool AddPoints(const std::vector<int>& at) {
    const int rule_number = at[plan_->rule_axis];
    std::vector<Setting> settings;
    for (size_t k = 0; k < at.size(); ++k) {
      const GridAxis& axis = axes()[k];
      if (kinds_[k] == Kind::kRule || (kinds_[k] == Kind::kRuleOption &&
                                       !takers_[axis.name][rule_number])) {
        continue;
      }
      settings.push_back({kinds_[k], axis.name, axis.values[at[k]]});
    }
    const std::vector<RuleAlternative>& rules =
        plan_->alternatives[rule_number];
    for (size_t i = 0; i < rules.size(); ++i) {
      SweepJob job;
      std::string why;
      if (!MakeJob(rules[i].specification, settings, &job, &why)) {
        return Refuse(why);
      }
      plan_->points.push_back({at, static_cast<int>(i), FindOrAddJob(job)});
    }
    return true;
  }

  bool MakeJob(const std::string& rule,
               const std::vector<Setting>& settings,
               SweepJob* job,
               std::string* error) {
    std::string problem = base_.problem;
    std::string method = rule;
    std::string directory;  // identifies the job
    NetworkSettings network = base_.network;
    int batch_size = base_.batch_size;
    for (const Setting& setting : settings) {
      switch (setting.kind) {
        case Kind::kRule:
          break;
        case Kind::kSeed:
          job->seed = std::stoi(setting.value);
          break;
        case Kind::kBatchSize: {
          int size = 0;
          OptionSet set;
          set.Add("batch_size", &size, {0, 1e9}, "");
          if (!set.Set("batch_size", setting.value, error)) return false;
          batch_size = size;
          break;
        }
        case Kind::kNetwork:
          *network.Find(setting.name) = setting.value;
          directory += setting.Text() + "-";
          break;
        case Kind::kProblem:
          problem += ":" + setting.Text();
          directory += setting.Text() + "-";
          break;
        case Kind::kRuleOption:
          method += ":" + setting.Text();
          break;
      }
    }
    if (!FindProblem(problem, network, &job->problem, error) ||
        !ParseMethod(method, &job->method, error) ||
        !CheckBatches(*job->problem, {job->method}, batch_size, error)) {
      return false;
    }
    job->batch_size = BatchSize(*job->problem, batch_size);
    std::string sizes;  // "256+32": of all phases
    for (const Phase& phase : job->method.phases) {
      sizes += fmt::format("{}{}",
                           sizes.empty() ? "" : "+",
                           BatchSize(*job->problem, phase, batch_size));
    }
    job->name = fmt::format(
        "{}{}-batch{}-seed{}", directory, job->method.label, sizes, job->seed);
    return true;
  }

  // Makes each problem once, and each of its networks.
  bool FindProblem(const std::string& specification,
                   const NetworkSettings& network,
                   std::shared_ptr<const LearningProblem>* problem,
                   std::string* error) {
    std::shared_ptr<const LearningProblem>& own = problems_[specification];
    if (own == nullptr) {
      PhysicsProblem created;
      if (!CreateProblem(specification, nullptr, &created, error)) return false;
      if (!created.learning.has_value()) {
        *error = fmt::format(
            "--problem={} has no network to train; compare and trajectories "
            "show point problems",
            specification);
        return false;
      }
      own = std::make_shared<LearningProblem>(*std::move(created.learning));
    }
    std::shared_ptr<const LearningProblem>& known =
        problems_[fmt::format("{};{};{};{}",
                              specification,
                              network.hidden,
                              network.activation,
                              network.initialization)];
    if (known == nullptr) {
      LearningProblem changed = *own;
      if (!SetNetwork(network, &changed, error)) return false;
      known = std::make_shared<LearningProblem>(std::move(changed));
    }
    *problem = known;
    return true;
  }

  // Two points with the same settings share a job.
  int FindOrAddJob(SweepJob job) {
    const auto [it, is_new] =
        job_numbers_.emplace(job.name, static_cast<int>(plan_->jobs.size()));
    if (is_new) {
      // The number makes names unique that differ only in special characters or
      // after truncation.
      constexpr size_t kMaxLength = 150;
      job.name = fmt::format(
          "{}-{}", it->second, FileName(job.name).substr(0, kMaxLength));
      plan_->jobs.push_back(std::move(job));
    }
    return it->second;
  }

  const SweepBase& base_;
  SweepPlan* plan_;
  std::string* error_;

  std::vector<Kind> kinds_;                          // of the axes
  std::map<std::string, std::vector<bool>> takers_;  // of an option, by rule
  std::map<std::string, std::shared_ptr<const LearningProblem>> problems_;
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
