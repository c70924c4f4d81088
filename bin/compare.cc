/*
Compares methods on one problem: same start, same data, same budget. A method
is an update rule; LOSS/SIMULATOR/RULE, a rule with pull-backs through loss
and simulator (sip is newton/inverse/adam); a minimizer of Ceres; or a sequence
of phases, separated by ">": lib/invgrad/method.h.

Sample runs:

  compare --list
  compare --problem=squared_component --steps=10 --overwrite \
    --rules=gradient_descent:step_size=0.01,newton:step_size=0.3333
  compare --problem=oscillator_chain --epochs=5 --overwrite \
    --rules=half_inverse:truncation=1e-10,adam:step_size=1e-3:batch_size=256
  compare --problem=oscillator_chain:coupling=cubic --seconds=20 --seeds=1..3 \
    --rules=half_inverse,gauss_newton,adam:step_size=3e-4:batch_size=512 \
    --output=runs/cubic
  compare --problem=quantum_dipole --seconds=20 --output=runs/quantum \
    --rules=half_inverse:step_size=0.5:truncation=1e-5,adam:step_size=5e-4
  compare --problem=oscillator_chain --epochs=25 --output=runs/phases \
    --rules="half_inverse,adam:batch_size=256:epochs=5>half_inverse"
  compare --flagfile=runs/phases/flags.txt --output=runs/again
  mpirun -n 2 compare --problem=oscillator_chain --steps=20 --overwrite

docs/programs.md has more. Ctrl-C ends the current method, skips the others, and
keeps the results so far.
*/

#include <iostream>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "bin/compare/learning_comparison.h"
#include "bin/compare/point_comparison.h"
#include "bin/support/listing.h"
#include "bin/support/point_path.h"
#include "bin/support/program.h"
#include "bin/support/ranks.h"
#include "bin/support/run_output.h"
#include "bin/support/training_flags.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/blas_threads.h"
#include "invgrad/core/finite.h"
#include "invgrad/npy.h"
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
DEFINE_string(data, "", "data (.npy) instead of the problem's own");
DEFINE_int32(blas_threads, 1, "threads of the linear algebra");

DECLARE_bool(resume);  // of learning_comparison.cc

namespace invgrad {
namespace {

bool ComparePointByFlags(const PointProblem& problem,
                         const std::vector<Method>& methods,
                         RunCounts* counts,
                         std::string* error) {
  for (const char* name : {"hidden",
                           "activation",
                           "initialization",
                           "epochs",
                           "batch_size",
                           "shuffle",
                           "threads",
                           "checkpoint_seconds",
                           "target_loss",
                           "patience",
                           "init_weights"}) {
    const gflags::CommandLineFlagInfo flag =
        gflags::GetCommandLineFlagInfoOrDie(name);
    if (flag.current_value == flag.default_value) continue;
    *error = fmt::format("--{}={} needs a problem with a network",
                         flag.name,
                         flag.current_value);
    return false;
  }
  constexpr int kMaxSteps = std::numeric_limits<int>::max();
  if (!CheckFlags({{"steps", {0.0, kMaxSteps}}}, error)) return false;
  if (FLAGS_resume) {
    *error = "--resume: a point problem runs in seconds; use --overwrite";
    return false;
  }
  if (NumRanks() > 1) {
    *error = "a point problem works in one process: start it without mpirun";
    return false;
  }
  MinimizerOptions options;
  options.max_num_iterations =
      FLAGS_steps > 0 ? static_cast<int>(FLAGS_steps) : 100;
  options.gradient_tolerance = 1e-12;
  if (FLAGS_seconds > 0.0) options.max_time_in_seconds = FLAGS_seconds;
  return PathsFitInMemory(
             problem, options.max_num_iterations, methods.size(), error) &&
         PrepareRunDirectory(ExistingDirectory::kRefuse, error) &&
         ComparePoint(problem, methods, options, counts, error);
}

bool Run(RunCounts* counts, std::string* error) {
  if (!CheckFlag("list_markdown", {"rules", "problems"}, error)) {
    return false;
  }
  if (FLAGS_list || !FLAGS_list_markdown.empty()) {
    std::cout << (FLAGS_list                       ? Listing()
                  : FLAGS_list_markdown == "rules" ? RulesMarkdown()
                                                   : ProblemsMarkdown());
    return true;
  }
  Eigen::MatrixXd data;
  PhysicsProblem problem;
  std::vector<Method> methods;
  if (!CheckTrainingFlags(error) ||
      !CheckFlags({{"blas_threads", {1, 256}}}, error) ||
      (!FLAGS_data.empty() &&
       !NameFlag("data",
                 ReadNpy(FLAGS_data, -1, -1, &data, error) &&
                     CheckFinite("file " + FLAGS_data, data, error),
                 error)) ||
      !NameFlag("problem",
                CreateProblem(FLAGS_problem,
                              FLAGS_data.empty() ? nullptr : &data,
                              &problem,
                              error),
                error) ||
      !ParseFlag("rules", ParseMethods, &methods, error)) {
    return false;
  }
  SetBlasThreads(FLAGS_blas_threads);
  return problem.point.has_value()
             ? ComparePointByFlags(*problem.point, methods, counts, error)
             : CompareLearning(
                   *std::move(problem.learning), methods, counts, error);
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgramOnRanks(
      argc,
      argv,
      "compares methods on one problem: same start, same data, same budget\n\n"
      "  compare --list\n"
      "  compare --problem=toy_network --rules=adam,half_inverse --epochs=20",
      invgrad::Run);
}
