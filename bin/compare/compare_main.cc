// The program compare: methods on one problem, from the same start, with the
// same data and budget. A method is an update rule; LOSS/SIMULATOR/RULE, a rule
// with pull-backs through loss and simulator (sip is newton/inverse/adam); a
// minimizer of Ceres; or a sequence of phases, separated by ">": method.h.
//
// Each kind of problem is compared by the same four steps: check the options,
// prepare the directory, run the methods, report. Ctrl-C ends the current
// method, skips the others, and keeps the results so far.

#include <algorithm>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include "bin/compare/compare_options.h"
#include "bin/compare/learning_comparison.h"
#include "bin/compare/least_squares_comparison.h"
#include "bin/compare/point_comparison.h"
#include "bin/support/listing.h"
#include "bin/support/program.h"
#include "bin/support/ranks.h"
#include "invgrad/blas_threads.h"
#include "invgrad/compare/compare.h"
#include "invgrad/core/finite.h"
#include "invgrad/method.h"
#include "invgrad/npy.h"

namespace invgrad {
namespace {

// For gflags, until the program ends.
CompareOptions& Options() {
  static auto& options = *new CompareOptions;
  return options;
}

const char* DefaultRules(const PhysicsProblem& problem) {
  if (problem.least_squares) {
    return "ceres_lm,ceres_dogleg,ceres_lm+half_inverse,"
           "half_inverse:step_size=auto";
  }
  constexpr const char* kUsual = "adaptive,adam:step_size=1e-3,half_inverse";
  if (!problem.learning) return kUsual;
  const LearningProblem& learning = *problem.learning;
  const Eigen::Index num_samples = learning.train.num_samples();
  const Eigen::Index batch_size =
      learning.batch_size > 0 ? learning.batch_size : num_samples;
  const Eigen::Index rows =
      batch_size * learning.model->simulator().num_outputs();
  // A rule that factorizes a larger Jacobian takes seconds a step. `adaptive`
  // begins with fewer samples, unless all are in each step.
  constexpr Eigen::Index kLarge = 4096;
  if (std::min<Eigen::Index>(rows, learning.model->num_weights()) < kLarge) {
    return kUsual;
  }
  return batch_size < num_samples ? "adaptive,adam:step_size=1e-3,krylov"
                                  : "adam:step_size=1e-3,krylov";
}

bool CheckProblem(CompareOptions* options,
                  PhysicsProblem* problem,
                  std::vector<Method>* methods,
                  std::string* error) {
  Eigen::MatrixXd data;
  const bool has_data = !options->data.empty();
  if (!options->training.Check(error) ||
      !CheckFlags({{"blas_threads", {1, 256}}}, error) ||
      (has_data &&
       !NameFlag("data",
                 ReadNpy(options->data, -1, -1, &data, error) &&
                     CheckFinite("file " + options->data, data, error),
                 error)) ||
      !NameFlag(
          "problem",
          CreateProblem(
              options->problem, has_data ? &data : nullptr, problem, error),
          error)) {
    return false;
  }
  if (options->rules == "auto") options->rules = DefaultRules(*problem);
  return NameFlag("rules", ParseMethods(options->rules, methods, error), error);
}

bool Run(RunCounts* counts, std::string* error) {
  CompareOptions& options = Options();
  if (!CheckFlag("list_markdown", {"rules", "problems"}, error)) {
    return false;
  }
  if (options.list || !options.list_markdown.empty()) {
    std::cout << (options.list                       ? Listing()
                  : options.list_markdown == "rules" ? RulesMarkdown()
                                                     : ProblemsMarkdown());
    return true;
  }
  PhysicsProblem problem;
  std::vector<Method> methods;
  if (!AgreeOnRanks(CheckProblem(&options, &problem, &methods, error), error)) {
    return false;
  }
  SetBlasThreads(options.blas_threads);
  if (problem.point.has_value()) {
    return ComparePoint(&options, *problem.point, methods, counts, error);
  }
  if (problem.least_squares.has_value()) {
    return CompareLeastSquares(
        &options, *problem.least_squares, methods, counts, error);
  }
  return CompareLearning(
      &options, *std::move(problem.learning), methods, counts, error);
}

}  // namespace

int CompareMain(int argc, char** argv) {
  if (!Problems().empty()) Options().problem = Problems().front().name;
  Options().AddFlags();
  return RunProgramOnRanks(
      argc,
      argv,
      "compares methods on one problem: same start, same data, same budget\n\n"
      "  compare --list\n  compare --problem=" +
          Options().problem + " --rules=adaptive,adam --epochs=20",
      Run);
}

}  // namespace invgrad
