/*
Compares methods on one problem: same start, same data, same budget. A method
is an update rule; LOSS/SIMULATOR/RULE, a rule with pull-backs through loss
and simulator (sip is newton/inverse/adam); a minimizer of Ceres; or a sequence
of phases, separated by ">": lib/invgrad/methods/method.h.

Sample runs:

  compare --list
  compare --problem=squared_component --steps=10 --overwrite \
    --rules=gradient_descent:step_size=0.01,newton:step_size=0.3333
  compare --problem=oscillator_chain --epochs=5 --overwrite \
    --rules=half_inverse:truncation=1e-10,adam:step_size=1e-3:batch_size=256
  compare --problem=oscillator_chain:coupling=cubic --seconds=20 --seeds=1..3 \
    --rules=half_inverse,gauss_newton,adam:step_size=3e-4:batch_size=512 \
    --output=runs/cubic
  compare --problem=sine:xi=32:phi=45 --seconds=10 --output=runs/sine \
    --rules=sip,dp_adam,newton/numerical/adam,newton/inverse/half_inverse
  compare --problem=toy_network:lambda=0.01 --seconds=10 --output=runs/toy \
    --rules=half_inverse:step_size=auto,adam:step_size=1e-2,ceres_lm
  compare --problem=quantum_dipole --seconds=20 --output=runs/quantum \
    --rules=half_inverse:step_size=0.5:truncation=1e-5,adam:step_size=5e-4
  compare --problem=oscillator_chain --hidden=40-40 --activation=gelu \
    --initialization=he --seconds=5 --output=runs/gelu
  compare --problem=oscillator_chain --epochs=25 --output=runs/phases \
    --rules="half_inverse,adam:batch_size=256:epochs=5>half_inverse"
  compare --flagfile=runs/phases/flags.txt --output=runs/again

The run directory holds the flags that repeat the run, versions, histories
(CSV), weights (.npy), the table and the pictures (PNG). Ctrl-C ends the
current method, skips the others, and keeps the results so far.
*/

#include <iostream>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "bin/compare/dump_step.h"
#include "bin/compare/learning_comparison.h"
#include "bin/compare/point_comparison.h"
#include "bin/support/listing.h"
#include "bin/support/parse_list.h"
#include "bin/support/program.h"
#include "bin/support/run_directory.h"
#include "bin/support/training.h"
#include "bin/support/training_flags.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/core/blas.h"
#include "invgrad/core/finite.h"
#include "invgrad/io/npy.h"
#include "problems/problems.h"

DEFINE_bool(list, false, "print the problems and methods with their options");
DEFINE_string(list_markdown,
              "",
              "print docs/rules.md or docs/problems.md: rules, problems");
DEFINE_string(problem,
              "oscillator_chain",
              "name[:key=value...]; --list shows all");
DEFINE_string(rules,
              "adam:step_size=1e-3:batch_size=256,half_inverse",
              "methods to compare, name[:key=value...],...: a rule, "
              "LOSS/SIMULATOR/RULE or a name for one, such as sip, or a "
              "minimizer of Ceres; --list shows all. batch_size is an option "
              "of each. In phases: \"adam:epochs=5>half_inverse\"");
DEFINE_string(seeds,
              "1",
              "seeds of the initial weights and of the shuffling: 1,2,5 or "
              "1..20");
DEFINE_double(target_loss, 0.0, "stop at this train loss; 0: off");
DEFINE_int32(patience,
             0,
             "stop after so many evaluations without a new minimum of the test "
             "loss; 0: off");
DEFINE_string(levels,
              "1e-3,1e-4,1e-5",
              "train losses; the table has the seconds to each");
DEFINE_int32(track_sample,
             0,
             "training sample whose path in y space is kept; -1: none");
DEFINE_bool(resume, false, "go on with the run in the directory");
DEFINE_string(init_weights, "", "initial weights (.npy) for every seed");
DEFINE_string(data, "", "data (.npy) instead of the problem's own");
DEFINE_string(dump_step,
              "",
              "write J, g and every rule's first step (.npy) to this "
              "directory, and stop");
DEFINE_int32(blas_threads, 1, "threads of the linear algebra");

namespace invgrad {
namespace {

bool CheckFlags(std::string* error) {
  return CheckTrainingFlags(error) &&
         CheckFlag("target_loss",
                   FLAGS_target_loss >= 0.0,
                   "0 (off) or more",
                   error) &&
         CheckFlag("patience", FLAGS_patience >= 0, "0 (off) or more", error) &&
         CheckFlag("track_sample",
                   FLAGS_track_sample >= -1,
                   "-1 (none), or the number of a sample",
                   error) &&
         CheckFlag("blas_threads",
                   FLAGS_blas_threads >= 1 && FLAGS_blas_threads <= 256,
                   "1 to 256",
                   error) &&
         CheckFlag("resume",
                   !(FLAGS_overwrite && FLAGS_resume),
                   "false with --overwrite",
                   error);
}

int CompareOnLearningProblem(LearningProblem problem,
                             const std::vector<Method>& methods,
                             const std::vector<int>& seeds,
                             const std::vector<double>& levels) {
  std::string error;
  if (!SetNetwork(NetworkOfFlags(), &problem, &error)) {
    return Fail("--" + error);
  }
  LearningComparisonOptions options;
  options.seeds = seeds;
  options.levels = levels;
  options.batch_size = FLAGS_batch_size;
  options.tracked_sample = FLAGS_track_sample;
  options.resume = FLAGS_resume;
  ApplyTrainingFlags(problem, &options.train);
  options.train.target_loss = FLAGS_target_loss;
  options.train.patience = FLAGS_patience;
  Eigen::VectorXd initial_weights;
  if ((!FLAGS_init_weights.empty() && !ReadNpy(FLAGS_init_weights,
                                               problem.model->num_weights(),
                                               &initial_weights,
                                               &error)) ||
      !CheckLearningComparison(problem, methods, options, &error)) {
    return Fail(error);
  }
  if (!FLAGS_dump_step.empty()) {
    const Eigen::VectorXd weights = initial_weights.size() > 0
                                        ? initial_weights
                                        : InitialWeights(problem, seeds[0]);
    return DumpStep(problem,
                    methods,
                    FLAGS_batch_size,
                    weights,
                    FLAGS_dump_step,
                    &error)
               ? 0
               : Fail(error);
  }
  if (!PrepareRunDirectory(FLAGS_resume ? ExistingDirectory::kResume
                                        : ExistingDirectory::kRefuse,
                           &error)) {
    return Fail(error);
  }
  options.output = FLAGS_output;
  return CompareLearning(
             problem, methods, options, initial_weights, std::cout, &error)
             ? 0
             : Fail(error);
}

int RunPoint(const PointProblem& problem, const std::vector<Method>& methods) {
  std::string error;
  for (const char* name : {"hidden",
                           "activation",
                           "initialization",
                           "epochs",
                           "batch_size",
                           "shuffle",
                           "target_loss",
                           "patience",
                           "init_weights",
                           "dump_step"}) {
    const gflags::CommandLineFlagInfo flag =
        gflags::GetCommandLineFlagInfoOrDie(name);
    if (flag.current_value != flag.default_value) {
      return Fail(fmt::format("--{}={} needs a problem with a network",
                              flag.name,
                              flag.current_value));
    }
  }
  constexpr int kMaxSteps = std::numeric_limits<int>::max();
  if (!CheckFlag("steps",
                 FLAGS_steps <= kMaxSteps,
                 fmt::format("at most {}", kMaxSteps),
                 &error)) {
    return Fail(error);
  }
  if (FLAGS_resume) {
    return Fail("--resume: a point problem runs in seconds; use --overwrite");
  }
  PointPathOptions options;
  if (FLAGS_steps > 0) {
    options.max_num_iterations = static_cast<int>(FLAGS_steps);
  }
  if (FLAGS_seconds > 0.0) options.max_time_in_seconds = FLAGS_seconds;
  return PrepareRunDirectory(ExistingDirectory::kRefuse, &error) &&
                 ComparePoint(
                     problem, methods, options, FLAGS_output, std::cout, &error)
             ? 0
             : Fail(error);
}

int Run() {
  std::string error;
  if (FLAGS_list) {
    PrintListing(std::cout);
    return 0;
  }
  if (!CheckFlag("list_markdown",
                 FLAGS_list_markdown.empty() ||
                     FLAGS_list_markdown == "rules" ||
                     FLAGS_list_markdown == "problems",
                 "rules, problems",
                 &error)) {
    return Fail(error);
  }
  if (FLAGS_list_markdown == "rules") {
    PrintRulesMarkdown(std::cout);
    return 0;
  }
  if (FLAGS_list_markdown == "problems") {
    PrintProblemsMarkdown(std::cout);
    return 0;
  }
  if (!CheckFlags(&error)) return Fail(error);
  std::vector<int> seeds;
  std::vector<double> levels;
  if (!ParseSeeds(FLAGS_seeds, &seeds, &error)) {
    return Fail("--seeds: " + error);
  }
  if (!ParseNumbers(FLAGS_levels, &levels, &error)) {
    return Fail("--levels: " + error);
  }
  Eigen::MatrixXd data;
  if (!FLAGS_data.empty() &&
      (!ReadNpy(FLAGS_data, -1, -1, &data, &error) ||
       !CheckFinite("file " + FLAGS_data, data, &error))) {
    return Fail(error);
  }
  PhysicsProblem problem;
  if (!CreateProblem(FLAGS_problem,
                     FLAGS_data.empty() ? nullptr : &data,
                     &problem,
                     &error)) {
    return Fail(error);
  }
  std::vector<Method> methods;
  if (!ParseMethods(FLAGS_rules, &methods, &error)) {
    return Fail("--rules: " + error);
  }
  SetBlasThreads(FLAGS_blas_threads);
  return problem.point.has_value()
             ? RunPoint(*problem.point, methods)
             : CompareOnLearningProblem(
                   *std::move(problem.learning), methods, seeds, levels);
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgram(
      argc,
      argv,
      "compares methods on one problem: same start, same data, same budget\n\n"
      "  compare --list\n"
      "  compare --problem=toy_network --rules=adam,half_inverse --epochs=20",
      invgrad::Run);
}
