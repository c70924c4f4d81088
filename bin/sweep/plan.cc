#include "bin/sweep/plan.h"

#include <algorithm>
#include <map>

#include "bin/support/learning_run.h"
#include "bin/support/program.h"
#include "bin/support/run_output.h"
#include "fmt/ranges.h"
#include "invgrad/compare/compare.h"
#include "invgrad/core/specification.h"
#include "invgrad/method.h"

namespace invgrad {
namespace {

bool Contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

class Planner {
 public:
  Planner(const SweepBase& base, SweepPlan* plan, std::string* error)
      : base_(base), plan_(plan), error_(error) {}

  bool Plan() { return CheckBase() && NameFlag("grid", PlanGrid(), error_); }

 private:
  std::vector<GridAxis>& axes() { return plan_->grid.axes; }

  bool PlanGrid() {
    if (!ReadSeeds() || !ReadRules() || !CheckAxes()) return false;
    std::vector<int> at(axes().size(), 0);
    do {
      if (!AddPoints(at)) return false;
    } while (Advance(&at));
    return true;
  }

  bool CheckBase() {
    std::shared_ptr<const PhysicsProblem> problem;
    if (!NameFlag(
            "problem", FindProblem(base_.problem, {}, &problem), error_)) {
      return false;
    }
    const std::string name = base_.problem.substr(0, base_.problem.find(':'));
    for (const auto& row : invgrad::FindProblem(name)->options()) {
      problem_options_.push_back(row.name);
    }
    is_training_ = problem->learning.has_value();
    if (FindProblem(base_.problem, base_.network, &problem)) return true;
    *error_ = "--" + *error_;
    return false;
  }

  bool ReadSeeds() {
    if (plan_->grid.Find("seed") < 0) axes().push_back({"seed", {"1"}});
    plan_->seed_axis = plan_->grid.Find("seed");
    std::vector<std::string>& values = axes()[plan_->seed_axis].values;
    std::vector<int> seeds;
    if (!ParseSeeds(
            fmt::format("{}", fmt::join(values, ",")), &seeds, error_)) {
      return false;
    }
    values.clear();
    for (const int seed : seeds) values.push_back(std::to_string(seed));
    return true;
  }

  bool ReadRules() {
    plan_->rule_axis = plan_->grid.Find("rule");
    if (plan_->rule_axis < 0) {
      *error_ = "expected an axis with the rules, rule=method,method";
      return false;
    }
    for (const std::string& value : axes()[plan_->rule_axis].values) {
      plan_->alternatives.push_back(ExpandRule(value));
      for (const RuleAlternative& rule : plan_->alternatives.back()) {
        Method method;
        if (!ParseMethod(rule.specification, &method, error_)) {
          *error_ = fmt::format("rule={}: {}", value, *error_);
          return false;
        }
      }
    }
    return true;
  }

  // Determines which rules have the option of an axis: those that accept at
  // least one of its values.
  bool CheckAxes() {
    std::vector<std::string> names = problem_options_;
    names.insert(names.end(), {"rule", "seed"});
    if (is_training_) {
      const std::vector<std::string>& network = NetworkSettings::Names();
      names.insert(names.end(), network.begin(), network.end());
      names.emplace_back("batch_size");
    }
    for (const GridAxis& axis : axes()) {
      if (Contains(names, axis.name)) continue;
      std::string reasons;  // of each rule, why the axis does not apply
      std::vector<bool>& takers = takers_[axis.name];
      for (const std::vector<RuleAlternative>& rule : plan_->alternatives) {
        std::string why;
        const auto takes = [&](const std::string& value) {
          Method method;
          return ParseMethod(
              fmt::format("{}:{}={}", rule[0].specification, axis.name, value),
              &method,
              &why);
        };
        takers.push_back(
            std::any_of(axis.values.begin(), axis.values.end(), takes));
        reasons += "\n  and no option of a rule: " + why;
      }
      if (std::count(takers.begin(), takers.end(), true) > 0) continue;
      *error_ = fmt::format("{}\n  allowed: {}{}",
                            UnknownNameMessage("axis", axis.name, names),
                            fmt::join(names, ", "),
                            reasons);
      return false;
    }
    return true;
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
    const std::vector<RuleAlternative>& rules =
        plan_->alternatives[at[plan_->rule_axis]];
    for (size_t i = 0; i < rules.size(); ++i) {
      SweepJob job;
      if (!MakeJob(rules[i].specification, at, &job)) return false;
      plan_->points.push_back({at, static_cast<int>(i), FindOrAddJob(job)});
    }
    return true;
  }

  bool MakeJob(const std::string& rule,
               const std::vector<int>& at,
               SweepJob* job) {
    std::string problem = base_.problem;
    std::string method = rule;
    std::string directory;  // identifies the job
    NetworkSettings network = base_.network;
    int batch_size = base_.batch_size;
    for (size_t k = 0; k < at.size(); ++k) {
      const std::string& name = axes()[k].name;
      const std::string& value = axes()[k].values[at[k]];
      const std::string setting = name + "=" + value;
      if (name == "rule") continue;
      if (name == "seed") {
        job->seed = std::stoi(value);
      } else if (is_training_ && name == "batch_size") {
        batch_size = 0;
        OptionSet set;
        set.Add(name, &batch_size, {0, 1e9}, "");
        if (!set.Set(name, value, error_)) return false;
      } else if (is_training_ && network.Find(name) != nullptr) {
        *network.Find(name) = value;
        directory += setting + "-";
      } else if (Contains(problem_options_, name)) {
        problem += ":" + setting;
        directory += setting + "-";
      } else if (takers_[name][at[plan_->rule_axis]]) {
        method += ":" + setting;
      }
    }
    if (!FindProblem(problem, network, &job->problem) ||
        !ParseMethod(method, &job->method, error_)) {
      return false;
    }
    std::string batches;
    if (is_training_ && !SetBatches(batch_size, job, &batches)) return false;
    job->name = fmt::format(
        "{}{}{}-seed{}", directory, job->method.label, batches, job->seed);
    return true;
  }

  // *text: "-batch256+32", of all phases.
  bool SetBatches(int batch_size, SweepJob* job, std::string* text) {
    if (!CheckBatches(job->learning(), {job->method}, batch_size, error_)) {
      return false;
    }
    job->batch_size = BatchSize(job->learning(), batch_size);
    for (const Phase& phase : job->method.phases) {
      *text +=
          fmt::format("{}{}",
                      text->empty() ? "-batch" : "+",
                      phase.BatchSize(job->batch_size,
                                      job->learning().train.num_samples()));
    }
    return true;
  }

  // Makes each problem once, and each of its networks.
  bool FindProblem(const std::string& specification,
                   NetworkSettings network,
                   std::shared_ptr<const PhysicsProblem>* problem) {
    std::shared_ptr<const PhysicsProblem>& own = problems_[specification];
    if (own == nullptr) {
      auto created = std::make_shared<PhysicsProblem>();
      if (!CreateProblem(specification, nullptr, created.get(), error_)) {
        return false;
      }
      own = created;
    }
    *problem = own;
    if (!own->learning.has_value()) return true;
    std::string key = specification;
    for (const std::string& name : NetworkSettings::Names()) {
      key += ';' + *network.Find(name);
    }
    std::shared_ptr<const PhysicsProblem>& known = problems_[key];
    if (known == nullptr) {
      auto changed = std::make_shared<PhysicsProblem>(*own);
      if (!SetNetwork(network, &*changed->learning, error_)) return false;
      known = changed;
    }
    *problem = known;
    return true;
  }

  // Two points with the same settings share a job.
  int FindOrAddJob(SweepJob job) {
    const auto [it, is_new] =
        job_numbers_.emplace(job.name, static_cast<int>(plan_->jobs.size()));
    if (is_new) {
      // The number makes names unique that differ only in special characters.
      job.name = fmt::format("{}-{}", it->second, FileName(job.name));
      plan_->jobs.push_back(std::move(job));
    }
    return it->second;
  }

  const SweepBase& base_;
  SweepPlan* plan_;
  std::string* error_;

  bool is_training_ = false;  // whether the problem has a network
  std::vector<std::string> problem_options_;
  // For an option of rules, which rules have it.
  std::map<std::string, std::vector<bool>> takers_;
  std::map<std::string, std::shared_ptr<const PhysicsProblem>> problems_;
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
