// The program estimate: methods on several least-squares problems, which are
// registered or read from files.

#include <algorithm>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include "bin/estimate/estimation_comparison.h"
#include "bin/estimate/file_inputs.h"
#include "bin/estimate/least_squares_estimation.h"
#include "bin/support/flags.h"
#include "bin/support/listing.h"
#include "bin/support/output_options.h"
#include "bin/support/program.h"
#include "bin/support/ranks.h"
#include "bin/support/run_output.h"
#include "invgrad/compare/compare.h"
#include "invgrad/method.h"
#include "invgrad/minimize.h"

namespace invgrad {
namespace {

// What an estimation is. Its flags are the fields.
struct EstimateOptions {
  bool list = false;
  std::string problems;
  std::string methods = "ceres_lm,ceres_dogleg,ceres_lm+geodesic";
  std::string seeds = "1";
  std::string levels;
  EstimationOptions run;

  void AddFlags();
};

// For gflags, until the program ends.
EstimateOptions& Options() {
  static auto& options = *new EstimateOptions;
  return options;
}

FileInputs& Files() {
  static auto& files = *new FileInputs;
  return files;
}

void EstimateOptions::AddFlags() {
  AddFlag("list",
          &list,
          "print problems, formats of files, and methods with their options");
  AddFlag("problems",
          &problems,
          "name[:key=value...],...; --list shows all; empty: all, unless the "
          "program reads files");
  AddFlag("methods",
          &methods,
          "methods to compare, name[:key=value...],...: a rule, a minimizer "
          "of Ceres, or one with a rule that proposes steps, as "
          "ceres_lm+geodesic; --list shows all");
  AddFlag("seeds",
          &seeds,
          "seeds of the starts of --problems, and of the noise on the starts "
          "of files: 1,2,5 or 1..20");
  AddFlag("levels",
          &levels,
          "costs above the known minimum; the table has the seconds to each");
  AddFlag("covariance",
          &run.covariance,
          "standard deviations and correlations of each result (of the "
          "cameras, for BAL), and what the residuals do not determine");
  AddFlag("max_iterations",
          &run.max_iterations,
          "of a run; 0: the input's own, of files 10000, 50, 200 (nist and "
          "csv, bal, g2o)");
  AddFlag("seconds",
          &run.seconds,
          "time after which a run begins no iteration; 0: no limit");
  AddFlag("function_tolerance",
          &run.function_tolerance,
          "a relative change of the cost that ends a run; -1: 2.2e-16 "
          "(problems, nist, csv), 1e-6 (bal), 1e-9 (g2o)");
  AddFlag("threads", &run.threads, "of Ceres and of the linear algebra");
  AddFlag("resume", &run.resume, "go on with the run in the directory");
  AddOutputFlags();
}

// The specifications of --problems, or all problems of the program.
std::vector<std::string> ProblemNames(const EstimateOptions& options) {
  std::vector<std::string> names = SplitList(options.problems);
  if (!names.empty() || Files().read != nullptr) return names;
  for (const ProblemRow& row : Problems()) {
    if (row.is_least_squares) names.push_back(row.name);
  }
  return names;
}

bool AddProblem(const std::string& specification,
                const std::vector<int>& seeds,
                std::vector<EstimationInput>* inputs,
                std::string* error) {
  PhysicsProblem problem;
  if (!CreateProblem(specification, nullptr, &problem, error)) return false;
  if (!problem.least_squares.has_value()) {
    *error = specification +
             " is no least-squares problem; compare and sweep are for others";
    return false;
  }
  EstimationInput input;
  input.name = FileName(specification);
  input.estimation =
      MakeLeastSquaresEstimation(*problem.least_squares,
                                 LeastSquaresBudget(*problem.least_squares),
                                 seeds,
                                 error);
  if (input.estimation == nullptr) {
    *error = specification + ": " + *error;
    return false;
  }
  inputs->push_back(std::move(input));
  return true;
}

bool CheckNames(const std::vector<EstimationInput>& inputs,
                std::string* error) {
  std::vector<std::string> names;
  names.reserve(inputs.size());
  for (const EstimationInput& input : inputs) names.push_back(input.name);
  std::sort(names.begin(), names.end());
  const auto twice = std::adjacent_find(names.begin(), names.end());
  if (twice == names.end()) return true;
  *error = "two inputs are called " + *twice +
           ", which names the results; run them one by one";
  return false;
}

// Makes or reads all inputs before any run, so that an invalid one is found
// first.
bool AddInputs(EstimateOptions* options,
               std::vector<EstimationInput>* inputs,
               std::string* error) {
  for (const std::string& name : ProblemNames(*options)) {
    if (!NameFlag("problems",
                  AddProblem(name, options->run.seeds, inputs, error),
                  error)) {
      return false;
    }
  }
  const bool has_problems = !inputs->empty();
  if (Files().read != nullptr && !Files().read(&options->run, inputs, error)) {
    return false;
  }
  if (!has_problems && options->run.perturb == 0.0 &&
      !CheckNotGiven({"seeds"}, "needs --perturb or --problems", error)) {
    return false;
  }
  if (!inputs->empty()) return CheckNames(*inputs, error);
  *error = Files().read == nullptr
               ? "the program has no least-squares problem"
               : "--input is missing: files, or folders of them (or problems: "
                 "--problems)";
  return false;
}

bool Check(EstimateOptions* options,
           std::vector<Method>* methods,
           std::string* error) {
  if (!NameFlag(
          "methods", ParseMethods(options->methods, methods, error), error) ||
      !CheckFlags({{"max_iterations", {0.0}},
                   {"seconds", {0.0}},
                   {"function_tolerance", {0.0, 1.0, false, true}},
                   {"threads", {1.0, 256.0}}},
                  error) ||
      !NameFlag("seeds",
                ParseSeeds(options->seeds, &options->run.seeds, error),
                error) ||
      !NameFlag("levels",
                ParseNumbers(options->levels, &options->run.levels, error),
                error)) {
    return false;
  }
  for (const Method& method : *methods) {
    if (!IsForProblems(method, error)) {
      *error = "--methods: " + method.label + ": " + *error;
      return false;
    }
  }
  return true;
}

// For flags.txt, where a resumed run finds the budget; inputs with several
// budgets have no number.
void SetMaxIterations(const std::vector<EstimationInput>& inputs,
                      int* max_iterations) {
  const auto own = [](const EstimationInput& input) {
    return input.estimation->traits().budget.max_num_iterations;
  };
  const bool is_one = std::all_of(
      inputs.begin(), inputs.end(), [&](const EstimationInput& input) {
        return own(input) == own(inputs[0]);
      });
  if (*max_iterations == 0 && is_one) *max_iterations = own(inputs[0]);
}

bool Run(RunCounts* counts, std::string* error) {
  EstimateOptions& options = Options();
  if (options.list) {
    if (Files().list != nullptr) std::cout << Files().list() << "\n";
    std::cout << EstimateListing();
    return true;
  }
  std::vector<Method> methods;
  std::vector<EstimationInput> inputs;
  if (!AgreeOnRanks(Check(&options, &methods, error) &&
                        AddInputs(&options, &inputs, error),
                    error)) {
    return false;
  }
  SetMaxIterations(inputs, &options.run.max_iterations);
  return CompareEstimations(options.run, inputs, methods, counts, error);
}

}  // namespace

void SetFileInputs(const FileInputs& files) { Files() = files; }

int EstimateMain(int argc, char** argv) {
  Options().AddFlags();
  if (Files().add_flags != nullptr) Files().add_flags();
  return RunProgramOnRanks(
      argc,
      argv,
      "compares methods on least-squares problems\n\n"
      "  estimate --list\n"
      "  estimate --methods=ceres_lm,ceres_lm+geodesic --seeds=1..5",
      Run);
}

}  // namespace invgrad
