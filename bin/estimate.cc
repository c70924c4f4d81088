/*
Estimates the parameters of public test problems: nonlinear regression (NIST
StRD), bundle adjustment (BAL) and pose graphs (g2o). Compares rules,
Ceres' minimizers, and minimizers with proposals of rules, from the same starts.

Sample runs:

  estimate --list
  estimate --input=nist/BoxBOD.dat \
    --methods=ceres_lm,ceres_dogleg,ceres_lm+half_inverse:step_size=auto
  estimate --input=nist --plots=false --overwrite \
    --methods=ceres_lm,ceres_bfgs
  estimate --input=nist/Lanczos1.dat --separable=both --overwrite
  estimate --input=problem-16-22106-pre.txt.bz2 --threads=2 --overwrite
  estimate --input=nist/BoxBOD.dat --covariance --overwrite
  estimate --input=sphere2500.g2o --perturb=0.1 --seeds=1..3 --overwrite
  estimate --input=M3500.g2o --loss=huber:1 --overwrite \
    --methods=ceres_lm,ceres_lm:linear_solver=cgnr

docs/results/estimation.md lists the sources of the files. Ctrl-C ends the
current method, skips the others, and keeps the results so far.
*/

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include "bin/estimate/estimation_comparison.h"
#include "bin/support/listing.h"
#include "bin/support/program.h"
#include "bin/support/run_output.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/method.h"
#include "invgrad/minimize.h"
#include "problems/estimation/nist_models.h"
#include "problems/estimation/robust_loss.h"

DEFINE_bool(list,
            false,
            "print formats, models and methods with their options");
DEFINE_string(input,
              "",
              "files, or folders of them, comma-separated: .dat (NIST), .txt "
              "or .txt.bz2 (BAL), .g2o; other files of a folder are skipped");
DEFINE_string(format, "", "nist, bal or g2o; empty: as the files' names end");
DEFINE_string(
    information_root,
    "lower",
    "which Cholesky factor of an edge's information weights its residual "
    "(g2o): lower, as in Ceres' examples; upper, as the format defines it");
DEFINE_string(
    methods,
    "ceres_lm,ceres_dogleg",
    "methods to compare, name[:key=value...],...: a rule, a minimizer "
    "of Ceres, or one with a rule that proposes steps, as "
    "ceres_lm+half_inverse; --list shows all");
DEFINE_string(separable,
              "off",
              "on: minimize over the nonlinear parameters, from which the "
              "linear ones follow (nist); both: with and without");
DEFINE_string(start, "both", "of a NIST file: 1, 2, both");
DEFINE_string(loss,
              "none",
              "robust loss: none, or huber, soft_l_one, cauchy, arctan, tukey "
              "[:scale]");
DEFINE_bool(covariance,
            false,
            "standard deviations and correlations of each result (of the "
            "cameras, for BAL), and what the residuals do not determine");
DEFINE_double(perturb,
              0.0,
              "standard deviation of noise on the starts: relative (NIST), in "
              "sizes of the scene and radians (BAL), in units of the graph and "
              "radians (g2o)");
DEFINE_string(seeds, "1", "seeds of the noise: 1,2,5 or 1..20");
DEFINE_int32(max_iterations, 0, "of a run; 0: 10000, 50, 200 (nist, bal, g2o)");
DEFINE_double(seconds,
              0.0,
              "time after which a run begins no iteration; 0: no limit");
DEFINE_double(function_tolerance,
              -1.0,
              "a relative change of the cost that ends a run; -1: 2.2e-16 "
              "(nist), 1e-6 (bal, g2o)");
DEFINE_int32(threads, 1, "of Ceres and of the linear algebra");

namespace invgrad {
namespace {

namespace fs = std::filesystem;

// The files in --input, and those files in its folders that a reader
// recognizes, in alphabetical order; a warning says which others have a known
// extension.
bool FindFiles(std::vector<std::string>* files, std::string* error) {
  for (const std::string& item : SplitList(FLAGS_input)) {
    if (item.empty()) {
      *error = "--input=" + FLAGS_input + " has an empty item";
      return false;
    }
    std::error_code failure;
    if (!fs::is_directory(item, failure)) {
      files->push_back(item);
      continue;
    }
    std::vector<std::string> found, skipped;
    for (fs::directory_iterator at(item, failure), end; !failure && at != end;
         at.increment(failure)) {
      std::error_code unreadable;  // such as a dangling link
      const std::string path = at->path().string();
      if (at->is_regular_file(unreadable) &&
          (!FLAGS_format.empty() || !EstimationKindOf(path).empty())) {
        (IsEstimationFile(path, FLAGS_format) ? found : skipped)
            .push_back(path);
      }
    }
    if (failure) {
      *error = "--input: " + item + ": " + failure.message();
      return false;
    }
    std::sort(skipped.begin(), skipped.end());
    for (const std::string& path : skipped) {
      Warn("--input: " + path + " is skipped: it does not begin as a file of " +
           (FLAGS_format.empty() ? "its extension" : FLAGS_format));
    }
    if (found.empty()) {
      *error = "--input: no file in " + item +
               " is one that --list names; give --format for other extensions";
      return false;
    }
    std::sort(found.begin(), found.end());
    files->insert(files->end(), found.begin(), found.end());
  }
  return true;
}

// "data/problem-16-22106-pre.txt.bz2" -> "problem-16-22106-pre"
std::string InputName(const std::string& file) {
  fs::path name = fs::path(file).filename();
  if (name.extension() == ".bz2") name = name.stem();
  return FileName(name.stem().string());
}

// Reads all files before any run, so that an invalid file is found first.
bool ReadInputs(std::vector<EstimationInput>* inputs, std::string* error) {
  ReadEstimationOptions options;
  options.kind = FLAGS_format;
  options.information_root = FLAGS_information_root == "lower"
                                 ? InformationRoot::kLower
                                 : InformationRoot::kUpper;
  std::vector<std::string> files;
  if (!FindFiles(&files, error)) return false;
  for (const std::string& file : files) {
    EstimationInput input;
    input.name = InputName(file);
    if (input.name == "." || input.name == "..") {
      *error = "--input: " + file + " has no name for its results";
      return false;
    }
    for (const EstimationInput& other : *inputs) {
      if (other.name == input.name) {
        *error = "--input: two files are called " + input.name +
                 ", which names the results; run them one by one";
        return false;
      }
    }
    input.estimation = ReadEstimation(file, options, error);
    if (!NameFlag("input", input.estimation != nullptr, error)) return false;
    inputs->push_back(std::move(input));
  }
  return true;
}

bool ReadOptions(EstimationOptions* options, std::string* error) {
  if (!CheckFlag("separable", {"off", "on", "both"}, error) ||
      !CheckFlag("start", {"1", "2", "both"}, error) ||
      !CheckFlags({{"perturb", {0.0}},
                   {"max_iterations", {0.0}},
                   {"seconds", {0.0}},
                   {"function_tolerance", {0.0, 1.0, false, true}},
                   {"threads", {1.0, 256.0}}},
                  error) ||
      !ParseFlag("seeds", ParseSeeds, &options->seeds, error) ||
      !ParseFlag("loss", ParseRobustLoss, &options->make_loss, error)) {
    return false;
  }
  options->separable = FLAGS_separable;
  options->start = FLAGS_start;
  options->covariance = FLAGS_covariance;
  options->perturb = FLAGS_perturb;
  options->max_iterations = FLAGS_max_iterations;
  options->seconds = FLAGS_seconds;
  options->function_tolerance = FLAGS_function_tolerance;
  options->threads = FLAGS_threads;
  return true;
}

// Formats and models of the files.
std::string FormatsText() {
  std::string text =
      "Formats (--input)\n"
      "  .dat            NIST StRD, nonlinear regression (nist)\n"
      "  .txt, .txt.bz2  Bundle Adjustment in the Large (bal); results are "
      ".txt\n"
      "  .g2o            pose graphs in 2D and 3D (g2o)\n"
      "\nModels of NIST's files\n";
  for (const NistModel& model : NistModels()) {
    text += fmt::format("  {}\n    {}\n", model.name, model.formula);
  }
  return text;
}

bool Run(RunCounts* counts, std::string* error) {
  if (FLAGS_list) {
    std::cout << FormatsText() << "\n" << EstimateListing();
    return true;
  }
  if (FLAGS_input.empty()) {
    *error = "--input is missing: files, or folders of them";
    return false;
  }
  std::vector<Method> methods;
  if (!CheckFlag("format", EstimationKinds(), error) ||
      !CheckFlag("information_root", {"lower", "upper"}, error) ||
      !ParseFlag("methods", ParseMethods, &methods, error)) {
    return false;
  }
  for (const Method& method : methods) {
    if (!IsForProblems(method, error)) {
      *error = "--methods: " + method.label + ": " + *error;
      return false;
    }
  }
  EstimationOptions options;
  std::vector<EstimationInput> inputs;
  return ReadOptions(&options, error) && ReadInputs(&inputs, error) &&
         CompareEstimations(options, inputs, methods, counts, error);
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgram(
      argc,
      argv,
      "estimates the parameters of NIST, BAL and g2o files by several "
      "methods\n\n"
      "  estimate --list\n"
      "  estimate --input=BoxBOD.dat --methods=ceres_lm,ceres_lm+half_inverse",
      invgrad::Run);
}
