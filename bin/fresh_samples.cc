/*
Predicts what a step does for samples that it is not computed from, by leaving
samples of its batch out (leave_one_out.h), and takes it to see.

Trains by a rule. At some steps it judges a grid of exponents and dampings, each
with the step size that is best for fresh samples over --grid_steps steps; at
every k-th step it judges the rule's own filter, with the step size that is best
for fresh samples by that batch, and with the rule's. Each step is
taken, its effect on the next batches is measured, and the weights go back: the
training is not disturbed.

Sample runs:

  fresh_samples --problem=oscillator_chain:noise=0.05 --at=10,100,1000 \
    --output=runs/fresh_chain
  fresh_samples --problem=random_polynomial:noise=0.3 --rule=half_inverse \
    --at=20,200 --every=5 --shuffle --output=runs/fresh_polynomial

  DIR/fresh_samples.csv, .txt, .md   a line for each step, exponent, damping;
                                     agreement, what the best ones give, and
                                     the noise scale of the batches
  DIR/fresh_samples.png              decrease against damping
  DIR/calibration.csv, .txt, .md     a line for every k-th step; agreement
  DIR/calibration.png                decrease of fresh samples, measured and by
                                     their own linear model, against predicted
*/

#include <algorithm>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "bin/fresh_samples/probe.h"
#include "bin/fresh_samples/results.h"
#include "bin/support/learning_run.h"
#include "bin/support/live_run.h"
#include "bin/support/program.h"
#include "bin/support/run_directory.h"
#include "bin/support/training_flags.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/rules/joint_rule.h"
#include "invgrad/rules/rules.h"
#include "invgrad/spectral/gradient_noise.h"
#include "report/interrupt.h"

DEFINE_string(problem, "oscillator_chain", "name[:key=value...]");
DEFINE_string(rule,
              "adaptive",
              "the rule of the training, with a spectral filter");
DEFINE_int32(seed, 0, "of the initial weights and of the batches");
DEFINE_string(at, "10,100,1000", "the first steps at which the grid is judged");
DEFINE_int32(grid_steps,
             20,
             "judge the grid at so many steps in a row, by their means");
DEFINE_string(dampings,
              "1e-12,1e-10,1e-8,1e-6,1e-4,1e-2,1",
              "lambda of the grid, in units of s_max^2");
DEFINE_int32(every, 1, "judge the rule's filter before every k-th step");
DEFINE_int32(fresh_batches, 4, "the next batches, on which steps are measured");

namespace invgrad {
namespace {

// So that each step counts the same.
LeaveOneOutScore Relative(LeaveOneOutScore score) {
  const double g_g = score.g_g > 0.0 ? score.g_g : 1.0;
  for (double* sum :
       {&score.g_c, &score.c_c, &score.c_H_c, &score.g_fitted, &score.g_g}) {
    *sum /= g_g;
  }
  return score;
}

// `weights`: at the steps `from`, from + 1, ..
bool JudgeGrid(int from,
               const std::vector<Eigen::VectorXd>& weights,
               const std::vector<double>& dampings,
               FreshProbe* probe,
               std::vector<FreshGridPoint>* results,
               std::string* error) {
  std::vector<FreshGridPoint> points;
  std::vector<SpectralFilter> filters;
  for (const double kappa : kFreshKappas) {
    for (const double damping : dampings) {
      FreshGridPoint& point = points.emplace_back();
      point.from = from;
      point.kappa = kappa;
      point.damping = damping;
      filters.push_back(SpectralFilter::Power(kappa, 0.0));
      filters.back().relative_damping = damping;
    }
  }
  const auto num_steps = static_cast<int>(weights.size());
  std::vector<std::vector<LeaveOneOutSummary>> summaries(num_steps);
  std::vector<LeaveOneOutScore> sums(filters.size());
  for (int k = 0; k < num_steps; ++k) {
    if (!probe->Begin(from + k, weights[k], error) ||
        !probe->Score(filters, &summaries[k], error)) {
      return false;
    }
    for (size_t i = 0; i < filters.size(); ++i) {
      sums[i] += Relative(summaries[k][i].score);
    }
  }
  // The first filter is gradient descent.
  const double noise_scale = GradientNoiseScale(sums[0], probe->batch_size());
  for (int k = 0; k < num_steps; ++k) {
    if (!probe->Begin(from + k, weights[k], error)) return false;
    for (size_t i = 0; i < filters.size(); ++i) {
      FreshGridPoint& point = points[i];
      point.step = from + k;
      point.judged = summaries[k][i].damping;
      point.generalization = sums[i].Generalization();
      point.noise_scale = noise_scale;
      if (!probe->Measure(filters[i],
                          summaries[k][i],
                          sums[i].StepSize(),
                          &point.decrease,
                          error)) {
        return false;
      }
    }
    results->insert(results->end(), points.begin(), points.end());
  }
  return true;
}

bool JudgeRule(const JointRule& rule,
               FreshRulePoint* point,
               FreshProbe* probe,
               std::string* error) {
  point->filter = rule.last_filter();
  std::vector<LeaveOneOutSummary> summaries;
  if (!probe->Score({point->filter}, &summaries, error)) return false;
  const LeaveOneOutScore& score = summaries[0].score;
  point->generalization = score.Generalization();
  return probe->Measure(point->filter,
                        summaries[0],
                        score.StepSize(),
                        &point->best_step,
                        error) &&
         probe->Measure(point->filter,
                        summaries[0],
                        rule.last_step_size(),
                        &point->rules_step,
                        error);
}

// A failure to judge a step is a warning.
FreshResults Train(const std::vector<int>& at,
                   const std::vector<double>& dampings,
                   const JointRule& rule,
                   FreshProbe* probe,
                   TrainingRun* run) {
  FreshResults results;
  Progress progress;
  ProgressState state;
  state.label = FLAGS_rule;
  const auto warn_if_failed = [&progress](long step, const std::string& error) {
    if (error.empty()) return;
    progress.Clear();
    Warn(fmt::format("step {} is not judged: {}", step, error));
  };
  std::vector<std::vector<Eigen::VectorXd>> weights(at.size());
  bool goes_on = true;
  while (goes_on) {
    const long step = run->step();
    for (size_t i = 0; i < at.size(); ++i) {
      if (step >= at[i] && step < at[i] + FLAGS_grid_steps) {
        weights[i].push_back(run->weights());
      }
    }
    std::string error;
    const bool has_begun =
        step % FLAGS_every == 0 && probe->Begin(step, run->weights(), &error);
    goes_on = run->Step();
    if (goes_on && has_begun) {
      FreshRulePoint point;
      point.step = step;
      point.loss = run->loss();
      if (JudgeRule(rule, &point, probe, &error)) {
        results.rule.push_back(point);
      }
    }
    warn_if_failed(step, error);
    state.step = run->step();
    state.loss = run->loss();
    state.fraction = run->progress();
    if (goes_on && !ShowProgress(state, &progress)) run->Stop();
  }
  for (size_t i = 0; i < at.size() && !Interrupt::IsRequested(); ++i) {
    std::string error;
    if (weights[i].empty()) {
      error = fmt::format("--at={}: the run has {} steps", at[i], run->step());
    } else {
      JudgeGrid(at[i], weights[i], dampings, probe, &results.grid, &error);
    }
    warn_if_failed(at[i], error);
  }
  return results;
}

bool Run(RunCounts* counts, std::string* error) {
  LearningProblem problem;
  std::vector<int> at;
  std::vector<double> dampings;
  const std::shared_ptr<UpdateRule> rule = MakeRule(FLAGS_rule, error);
  if (!NameFlag("rule", rule != nullptr, error) || !CheckTrainingFlags(error) ||
      !CheckFlags({{"seed", {0.0}},
                   {"grid_steps", {1.0, 1e6}},
                   {"every", {1.0}},
                   {"fresh_batches", {1.0}}},
                  error) ||
      !ParseFlag("at", ParseSeeds, &at, error) ||
      !ParseFlag("dampings", ParseNumbers, &dampings, error) ||
      !NameFlag("problem",
                CreateLearningProblem(FLAGS_problem, &problem, error),
                error) ||
      !SetNetwork(NetworkOfFlags(), &problem, error) ||
      !CheckBatches(problem, {}, FLAGS_batch_size, error)) {
    return false;
  }
  const auto* const joint_rule = dynamic_cast<const JointRule*>(rule.get());
  if (joint_rule == nullptr) {
    *error = fmt::format(
        "--rule={} has no filter of the singular values; power, half_inverse "
        "and adaptive have one",
        FLAGS_rule);
    return false;
  }
  if (dampings.empty()) {
    *error = "--dampings: expected a number";
    return false;
  }
  std::sort(at.begin(), at.end());
  if (FLAGS_steps == 0 && FLAGS_epochs == 0 && FLAGS_seconds == 0.0) {
    FLAGS_steps = std::max(at.back() + FLAGS_grid_steps - 1, 1);
  }
  const int batch_size = BatchSize(problem, FLAGS_batch_size);
  TrainOptions options = TrainOptionsOfFlags(batch_size, FLAGS_seed);
  FreshProbe probe(
      problem, batch_size, FLAGS_fresh_batches, options.shuffle, FLAGS_seed);
  if (!NameFlag("fresh_batches", probe.IsValid(error), error)) return false;
  options.initial_weights = InitialWeights(problem, FLAGS_seed);
  options.inverse = problem.inverse;
  TrainingRun run(*problem.model,
                  {problem.train, problem.test, probe.batches()},
                  rule,
                  options);
  *error = run.error();
  if (!error->empty() ||
      !PrepareRunDirectory(ExistingDirectory::kRefuse, error)) {
    return false;
  }
  const Interrupt interrupt;
  const FreshResults results = Train(at, dampings, *joint_rule, &probe, &run);
  std::cout << FLAGS_rule << ": " << run.summary().message << "\n\n";
  counts->Add(run.summary().termination_type != ceres::FAILURE);
  return WriteFreshResults(FLAGS_output + "/", at, results, error);
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgram(
      argc,
      argv,
      "predicts what steps do for samples that they are not computed from, and "
      "takes them to see",
      invgrad::Run);
}
