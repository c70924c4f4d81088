#include "invgrad/solve/method.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "glog/logging.h"
#include "invgrad/solve/model_cost.h"
#include "invgrad/solve/pull_back_objective.h"
#include "invgrad/solve/training_memory.h"
#include "invgrad/solve/update_callback.h"

namespace invgrad {

namespace {

constexpr char kNeedsLeastSquares[] =
    "a trust region needs a least-squares loss, c |y - y*|^2";

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

bool ParseBatchSize(const std::string& value,
                    int* batch_size,
                    std::string* error) {
  *batch_size = 0;
  OptionSet set;
  set.Add("batch_size", batch_size, {0, 1e9}, "samples a step; 0: all");
  return set.Set("batch_size", value, error);
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
  std::vector<std::string> names = {"batch_size"};
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

bool ParseMethod(const Specification& specification,
                 Method* method,
                 std::string* error) {
  method->label = specification.text;
  if (!FindRows(specification.name, method, error)) return false;
  const ChainMethodRow* chain = FindChainMethod(specification.name);
  Settings settings = specification.settings;
  if (chain != nullptr) AddDefaults(chain->defaults, &settings);
  Settings pull_back_settings;
  std::string why;
  for (const auto& setting : settings) {
    if (setting.first == "batch_size") {
      if (!ParseBatchSize(setting.second, &method->batch_size, &why)) {
        *error = specification.name + ": " + why;
        return false;
      }
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

// The settings were checked when the method was parsed.
void Configure(const Method& method,
               ceres::Solver::Options* options,
               ceres::GradientProblemSolver::Options* gradient_options) {
  std::string error;
  CHECK(method.ceres->configure(
      method.ceres_settings, options, gradient_options, &error))
      << error;
}

// Turns Ceres' iterations into a history, with its own clock, which stands
// while losses are looked at; and keeps the budget.
class TrainingRecorder final : public ceres::IterationCallback {
 public:
  TrainingRecorder(const TrainOptions& options,
                   const Model& model,
                   const DataSet& train,
                   const DataSet& test,
                   const Eigen::VectorXd& weights,
                   History* history,
                   TrainSummary* summary)
      : options_(options),
        model_(model),
        train_(train),
        test_(test),
        weights_(weights),
        history_(history),
        summary_(summary) {}

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& iteration) override {
    seconds_ += Seconds(Clock::now() - resumed_);
    summary_->num_steps = iteration.iteration;
    summary_->train_time_in_seconds = seconds_;
    step_norm_ = iteration.step_norm;
    // The weights are those of the lowest cost: a step that was rejected is not
    // in them, nor is one that was taken although the cost rose.
    if (iteration.iteration == 0 || iteration.step_is_successful) {
      const int num_samples = train_.num_samples();
      mean_loss_ = std::fmin(
          mean_loss_,
          iteration.cost / (model_.BatchScale(num_samples) * num_samples));
    }
    if (IsEvaluationEpoch(iteration.iteration)) Record();
    ceres::IterationSummary timed = iteration;
    timed.cumulative_time_in_seconds = seconds_;
    ceres::CallbackReturnType verdict = ceres::SOLVER_CONTINUE;
    for (ceres::IterationCallback* callback : options_.callbacks) {
      verdict = (*callback)(timed);
      if (verdict != ceres::SOLVER_CONTINUE) break;
    }
    if (verdict == ceres::SOLVER_ABORT) {
      Stop(ceres::USER_FAILURE, "aborted by a callback" + AtStep());
    } else if (verdict == ceres::SOLVER_TERMINATE_SUCCESSFULLY) {
      Stop(ceres::USER_SUCCESS, "stopped by a callback" + AtStep());
    } else if (IsDone()) {
      verdict = ceres::SOLVER_TERMINATE_SUCCESSFULLY;
    }
    resumed_ = Clock::now();
    // On SOLVER_ABORT Ceres puts the weights back to the start; they are kept.
    return verdict == ceres::SOLVER_CONTINUE
               ? verdict
               : ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }

  // The last state, unless it is in the history.
  void RecordEnd() {
    if (history_->empty() || history_->back().step != summary_->num_steps) {
      Record();
    }
  }

  // Whether budget, target, patience or a callback ended the run, and then with
  // the summary filled.
  bool has_stopped() const { return has_stopped_; }

 private:
  using Clock = std::chrono::steady_clock;
  static double Seconds(Clock::duration duration) {
    return std::chrono::duration<double>(duration).count();
  }

  void Record() {
    HistoryRow row;
    row.step = summary_->num_steps;
    row.epoch = static_cast<double>(row.step);
    row.seconds = seconds_;
    row.batch_loss = mean_loss_;
    row.train_loss = mean_loss_;
    if (test_.num_samples() > 0) {
      row.test_loss = MeanLoss(model_, weights_, test_);
    }
    row.step_norm = step_norm_;
    if (options_.metric) row.metric = options_.metric(weights_);
    history_->push_back(row);
    const double watched =
        test_.num_samples() > 0 ? row.test_loss : row.train_loss;
    evaluations_since_best_ =
        watched < best_loss_ ? 0 : evaluations_since_best_ + 1;
    best_loss_ = std::fmin(best_loss_, watched);
    if (options_.on_evaluation) options_.on_evaluation(*history_);
  }

  std::string AtStep() const {
    return " at step " + std::to_string(summary_->num_steps);
  }

  void Stop(ceres::TerminationType type, const std::string& message) {
    summary_->termination_type = type;
    summary_->message = message;
    has_stopped_ = true;
  }

  // True, with the summary filled, if the run has to end.
  bool IsDone() {
    const long step = summary_->num_steps;
    if (options_.target_loss > 0.0 && mean_loss_ <= options_.target_loss) {
      Stop(ceres::CONVERGENCE, "target loss reached" + AtStep());
    } else if (options_.patience > 0 &&
               evaluations_since_best_ >= options_.patience) {
      Stop(ceres::CONVERGENCE,
           "no improvement in " + std::to_string(options_.patience) +
               " evaluations");
    } else if (step >= options_.max_num_epochs) {
      Stop(ceres::NO_CONVERGENCE, "epochs done");
    } else if (step >= options_.max_num_steps) {
      Stop(ceres::NO_CONVERGENCE, "steps done");
    } else if (seconds_ >= options_.max_time_in_seconds) {
      Stop(ceres::NO_CONVERGENCE, "time used up");
    }
    return has_stopped_;
  }

  const TrainOptions& options_;
  const Model& model_;
  const DataSet& train_;
  const DataSet& test_;
  const Eigen::VectorXd& weights_;
  History* const history_;
  TrainSummary* const summary_;
  Clock::time_point resumed_ = Clock::now();
  double seconds_ = 0.0;
  double mean_loss_ = HistoryRow::kNone;
  double step_norm_ = HistoryRow::kNone;
  double best_loss_ = std::numeric_limits<double>::infinity();
  int evaluations_since_best_ = 0;
  bool has_stopped_ = false;
};

// False, with *error set, if the method has a rule that cannot propose its
// steps for this problem.
bool TakesProposals(const Method& method,
                    const ceres::Problem& problem,
                    std::string* error) {
  return method.rule == nullptr ||
         UpdateCallback::IsSupported(UpdateCallback::Options(), problem, error);
}

// What is added to a run's message; if all was left to Ceres, also why.
std::string ProposalsText(const UpdateCallback::Summary& summary) {
  std::string text = "; " + summary.BriefReport();
  if (summary.num_proposed == 0 && !summary.message.empty()) {
    text += " (" + summary.message + ")";
  }
  return text;
}

void AddReport(const PullBackCounts& counts, std::string* message) {
  const std::string report = counts.Report();
  if (!report.empty()) *message += "; " + report;
}

MinimizerOptions UnboundedOptions() {
  MinimizerOptions options;
  options.max_num_iterations = 1000000000;
  // The budget decides; these only end a run that cannot go on in double
  // precision.
  options.function_tolerance = 1e-16;
  options.gradient_tolerance = 1e-16;
  options.parameter_tolerance = 1e-16;
  return options;
}

bool TrainWithCeres(const Method& method,
                    const TrainOptions& options,
                    const Model& model,
                    const DataSet& train,
                    const DataSet& test,
                    Eigen::VectorXd* weights,
                    History* history,
                    TrainSummary* summary,
                    std::string* error) {
  if (method.ceres->is_trust_region &&
      !model.loss().SquaredNormFactor().has_value()) {
    *error = kNeedsLeastSquares;
    return false;
  }
  if (!CheckTrainingInput(options, model, train, test, *weights, error)) {
    return false;
  }
  ceres::Solver::Options solver_options;
  ceres::GradientProblemSolver::Options gradient_options;
  Configure(method, &solver_options, &gradient_options);
  if (!CeresFits(options,
                 method.ceres->is_trust_region
                     ? TrustRegionMemory(solver_options.linear_solver_type,
                                         model,
                                         train.num_samples())
                     : LineSearchMemory(model, train.num_samples()),
                 train,
                 test,
                 error)) {
    return false;
  }
  ceres::Problem problem;
  if (method.ceres->is_trust_region) {
    AddModelToProblem(&model, &train, weights, &problem);
    if (!TakesProposals(method, problem, error)) return false;
  }
  history->clear();
  *summary = TrainSummary();
  TrainingRecorder recorder(
      options, model, train, test, *weights, history, summary);
  MinimizerOptions minimizer_options = UnboundedOptions();
  minimizer_options.callbacks.push_back(&recorder);
  MinimizerSummary result;
  std::string proposals;
  if (method.ceres->is_trust_region) {
    if (method.rule == nullptr) {
      MinimizeWithCeres(minimizer_options, solver_options, &problem, &result);
    } else {
      const std::unique_ptr<UpdateRule> rule = method.MakeRule();
      UpdateCallback callback(UpdateCallback::Options(), rule.get(), &problem);
      minimizer_options.callbacks.insert(minimizer_options.callbacks.begin(),
                                         &callback);
      MinimizeWithCeres(minimizer_options, solver_options, &problem, &result);
      proposals = ProposalsText(callback.summary());
    }
  } else {
    MinimizeWithCeres(minimizer_options,
                      gradient_options,
                      new ModelFunction(&model, &train),
                      weights,
                      &result);
  }
  recorder.RecordEnd();
  if (!recorder.has_stopped()) {
    summary->termination_type = result.termination_type;
    summary->message = result.message;
  }
  summary->message += proposals;
  return true;
}

// False if the ways cannot train this model on these data.
bool CheckWays(const PullBackMethod& ways,
               const Model& model,
               const DataSet& train,
               std::string* error) {
  if (ways.updates() > 1 && model.feedback() != nullptr) {
    *error =
        "updates > 1: in a closed loop an update moves the inputs of the "
        "next one";
    return false;
  }
  if (ways.needs_solutions() && train.solutions.rows() == 0) {
    *error = "its data have no solutions x* to learn from";
    return false;
  }
  return true;
}

// False, with the summary and the path of the failure, if the cost is not
// finite at the start. Ceres itself only looks at residuals, whose squares may
// be infinite although they are not.
bool HasStart(const ChainObjective& objective,
              std::vector<Eigen::VectorXd>* path,
              MinimizerSummary* summary) {
  double cost = 0.0;
  std::string error;
  if (objective.Cost(&cost, &error)) return true;
  *summary = MinimizerSummary();
  summary->message = "no start: " + error;
  path->push_back(objective.State());
  return false;
}

// Collects the points that a minimization visits.
class PathRecorder final : public ceres::IterationCallback {
 public:
  PathRecorder(std::function<Eigen::VectorXd()> point,
               std::vector<Eigen::VectorXd>* path)
      : point_(std::move(point)), path_(path) {}
  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary&) override {
    path_->push_back(point_());
    return ceres::SOLVER_CONTINUE;
  }

 private:
  std::function<Eigen::VectorXd()> point_;
  std::vector<Eigen::VectorXd>* path_;
};

void MinimizeByRule(const Method& method,
                    const MinimizerOptions& options,
                    std::shared_ptr<const InverseSimulator> inverse,
                    ChainObjective* objective,
                    std::vector<Eigen::VectorXd>* path,
                    MinimizerSummary* summary) {
  const std::unique_ptr<UpdateRule> rule = method.MakeRule();
  // What the rule gets to see.
  Objective* seen = objective;
  std::optional<ChainObjective> joint;
  std::optional<PullBackObjective> pulled_back;
  if (method.pull_back.has_value()) {
    const PullBackMethod& ways = *method.pull_back;
    if (ways.is_joint()) {
      seen = &joint.emplace(objective->shared_simulator(),
                            ways.MakeLoss(objective->shared_loss()),
                            objective->target(),
                            objective->State());
    } else {
      seen = &pulled_back.emplace(
          objective,
          ways.MakeLossPullBack(objective->shared_loss()),
          ways.MakeSimulatorPullBack(objective->shared_simulator(),
                                     std::move(inverse)));
    }
  }
  MinimizerOptions recorded = options;
  PathRecorder recorder([seen]() { return seen->State(); }, path);
  recorded.callbacks.insert(recorded.callbacks.begin(), &recorder);
  Minimize(recorded, rule.get(), seen, summary);
  if (path->empty()) path->push_back(seen->State());
  objective->SetState(seen->State());
  if (pulled_back.has_value()) {
    AddReport(pulled_back->counts(), &summary->message);
  }
}

}  // namespace

std::unique_ptr<UpdateRule> Method::MakeRule() const {
  if (rule == nullptr) return nullptr;
  std::string error;
  std::unique_ptr<UpdateRule> made = rule->create(rule_settings, &error);
  CHECK(made != nullptr) << error;
  return made;
}

bool ParseMethods(const std::string& text,
                  std::vector<Method>* methods,
                  std::string* error) {
  std::vector<Specification> specifications;
  if (!ParseSpecifications(text, &specifications, error)) return false;
  methods->clear();
  for (const Specification& specification : specifications) {
    Method method;
    if (!ParseMethod(specification, &method, error)) return false;
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

bool TrainByMethod(const Method& method,
                   const TrainOptions& options,
                   const Model& model,
                   std::shared_ptr<const InverseSimulator> inverse,
                   const DataSet& train,
                   const DataSet& test,
                   Eigen::VectorXd* weights,
                   History* history,
                   TrainSummary* summary,
                   std::string* error) {
  if (method.ceres != nullptr) {
    return TrainWithCeres(
        method, options, model, train, test, weights, history, summary, error);
  }
  const std::unique_ptr<UpdateRule> rule = method.MakeRule();
  // What the rule gets to see.
  TrainOptions seen_options = options;
  const Model* seen = &model;
  std::optional<Model> joint;
  std::optional<ChainPullBack> pull_back;
  if (method.pull_back.has_value()) {
    const PullBackMethod& ways = *method.pull_back;
    if (!CheckWays(ways, model, train, error)) return false;
    if (ways.is_joint()) {
      seen = &joint.emplace(model.WithLoss(ways.MakeLoss(model.shared_loss()),
                                           model.reduction()));
    } else {
      seen_options.pull_back = &pull_back.emplace(
          &model,
          ways.FirstInverse(model.shared_simulator(), std::move(inverse)),
          ways.ChainOptions());
    }
  }
  if (!Train(seen_options,
             *seen,
             train,
             test,
             rule.get(),
             weights,
             history,
             summary,
             error)) {
    return false;
  }
  if (pull_back.has_value()) AddReport(pull_back->counts(), &summary->message);
  return true;
}

bool MinimizeByMethod(const Method& method,
                      const MinimizerOptions& options,
                      std::shared_ptr<const InverseSimulator> inverse,
                      ChainObjective* objective,
                      std::vector<Eigen::VectorXd>* path,
                      MinimizerSummary* summary,
                      std::string* error) {
  path->clear();
  if (method.pull_back.has_value() && method.pull_back->needs_solutions()) {
    *error = "a point has no data to learn from";
    return false;
  }
  if (method.pull_back.has_value() && method.pull_back->needs_batches()) {
    *error = "proxy, curvature_weight, updates and max_change need a network";
    return false;
  }
  if (method.ceres == nullptr) {
    MinimizeByRule(
        method, options, std::move(inverse), objective, path, summary);
    return true;
  }
  Eigen::VectorXd x = objective->State();
  MinimizerOptions recorded = options;
  PathRecorder recorder([&x]() { return x; }, path);
  recorded.callbacks.insert(recorded.callbacks.begin(), &recorder);
  ceres::Solver::Options solver_options;
  ceres::GradientProblemSolver::Options gradient_options;
  Configure(method, &solver_options, &gradient_options);
  if (!method.ceres->is_trust_region) {
    // A line search sees the gradient and no Jacobian, which may be large.
    if (!HasStart(*objective, path, summary)) return true;
    MinimizeWithCeres(
        recorded, gradient_options, new ChainFunction(objective), &x, summary);
  } else if (!objective->loss().SquaredNormFactor().has_value()) {
    *error = kNeedsLeastSquares;
    return false;
  } else if (!FitsInMemory(
                 "a trust region",
                 TrustRegionMemory(solver_options.linear_solver_type,
                                   objective->simulator().num_outputs(),
                                   objective->num_parameters()),
                 /*limit=*/0.0,
                 error)) {
    return false;
  } else {
    ceres::Problem problem;
    problem.AddResidualBlock(
        new ChainCostFunction(objective), nullptr, x.data());
    if (!TakesProposals(method, problem, error)) return false;
    if (!HasStart(*objective, path, summary)) return true;
    const std::unique_ptr<UpdateRule> rule = method.MakeRule();
    std::unique_ptr<UpdateCallback> callback;
    if (rule != nullptr) {
      callback = std::make_unique<UpdateCallback>(
          UpdateCallback::Options(), rule.get(), &problem);
      recorded.callbacks.push_back(callback.get());
    }
    MinimizeWithCeres(recorded, solver_options, &problem, summary);
    if (callback != nullptr) {
      summary->message += ProposalsText(callback->summary());
    }
  }
  objective->SetState(x);
  // Ceres ends a run on its tolerances without calling anyone back.
  if (path->empty() || path->back() != x) path->push_back(x);
  return true;
}

}  // namespace invgrad
